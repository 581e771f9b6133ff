/// @file distorted_point_impl.hpp
/// What cameras with a distortion share: the way from a point through the distorted plane z = 1 to its pixel. Not an
/// interface.
#pragma once

#include "cfp/core/numeric.hpp"
#include "cfp/geometry/camera.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

/// A distorted point of the plane z = 1 and the (symmetric) Jacobian of the distortion.
template <typename Scalar>
struct DistortedPoint {
  Scalar x{}, y{}, xx{}, xy{}, yy{};
};

/// Camera::project by `camera.distort(x, y, distorted)`, which is false where the camera sees nothing.
template <typename Camera, typename Scalar>
[[nodiscard]] CFP_INLINE bool project_distorted(const Camera& camera, const Vector3<Scalar>& point,
                                                Vector2<Scalar>& pixel, Matrix23<Scalar>* jacobian) noexcept {
  if (!(point.z() > Scalar(Tolerance<Scalar>::min_depth)) || !is_finite(point.z())) return false;
  const Scalar inv_z = Scalar(1) / point.z();
  const Scalar x = point.x() * inv_z;
  const Scalar y = point.y() * inv_z;
  DistortedPoint<Scalar> d;
  if (!camera.distort(x, y, d) || !camera.pinhole().project({d.x, d.y, Scalar(1)}, pixel)) return false;
  if (jacobian != nullptr) {
    const Scalar fx_z = camera.fx * inv_z;
    const Scalar fy_z = camera.fy * inv_z;
    *jacobian = Matrix23<Scalar>{{fx_z * d.xx, fx_z * d.xy, -fx_z * (d.xx * x + d.xy * y)},
                                 {fy_z * d.xy, fy_z * d.yy, -fy_z * (d.xy * x + d.yy * y)}};
  }
  return true;
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
