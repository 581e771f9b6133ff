/// @file homography.hpp
/// What is left of two-view geometry when the camera only turns or stands still, where no fundamental matrix exists:
/// the homography of a rotation, and the transfer distance of correspondences.
#pragma once

#include <cmath>

#include "cfp/core/span.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/geometry/distance.hpp"
#include "cfp/math/matrix3.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// || x_cur - H x_prev || in pixels of the current image, H x_prev divided by its last component. `no_distance` (-1)
/// where that component is not positive (the point maps behind the camera or to infinity; H is taken with det > 0) or
/// the distance is not finite. Does not depend on the scale of H.
template <typename Scalar>
[[nodiscard]] Scalar transfer_distance(const Matrix3<Scalar>& H, const Vector2<Scalar>& x_prev,
                                       const Vector2<Scalar>& x_cur) noexcept {
  using std::sqrt;
  const Vector3<Scalar> mapped = H.col(0) * x_prev.x() + H.col(1) * x_prev.y() + H.col(2);
  if (!(mapped.z() > Scalar(0))) return Scalar(no_distance<double>);
  const Scalar distance = sqrt((mapped.template head<2>() / mapped.z() - x_cur).squaredNorm());
  return has_distance(distance) ? distance : Scalar(no_distance<double>);
}

/// The motion of the whole image when the camera turns by R (of T_cur_prev): K R K^-1 with the camera matrix K, pixels
/// of the undistorted image. For the box tracker, which knows nothing of the camera.
template <typename Scalar>
[[nodiscard]] Matrix3<Scalar> rotation_homography(const PinholeCamera<Scalar>& camera,
                                                  const Matrix3<non_deduced<Scalar>>& R) noexcept {
  return camera.matrix() * R * inverse(camera.matrix());
}

/// transfer_distance of every correspondence. Allocates nothing.
template <typename Scalar>
void transfer_distances(const Matrix3<Scalar>& H, const PointSpan<non_deduced<Scalar>, 2>& prev,
                        const PointSpan<non_deduced<Scalar>, 2>& cur, span<non_deduced<Scalar>> out) noexcept {
  CFP_ASSERT(prev.size() == out.size() && cur.size() == out.size());
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = transfer_distance<Scalar>(H, prev[i], cur[i]);
}

}  // namespace CFP_ISA
}  // namespace cfp
