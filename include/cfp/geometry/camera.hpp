/// @file camera.hpp
/// The camera interface: any type with the two members of PinholeCamera below (and the alias `ScalarType`) is a camera
/// for cfp. Camera frame: x right, y down, z forward, metres; pixels with the origin of the caller's calibration.
/// And the undistorted image of any such camera: epipolar geometry holds only there.
#pragma once

#include <array>
#include <cmath>
#include <type_traits>
#include <vector>

#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"
#include "cfp/core/types.hpp"

namespace cfp {

/// u = fx x/z + cx, v = fy y/z + cy.
template <typename Scalar>
struct PinholeCamera {
  using ScalarType = Scalar;
  Scalar fx = Scalar(1);  ///< focal length in pixels, > 0
  Scalar fy = Scalar(1);  ///< focal length in pixels, > 0
  Scalar cx = Scalar(0);  ///< principal point in pixels
  Scalar cy = Scalar(0);

  /// Projects a point of the camera frame. Returns whether the projection is valid: a finite z >
  /// Tolerance::min_depth and a finite pixel; otherwise pixel and jacobian are left as they were. jacobian, when asked
  /// for: d pixel / d point.
  [[nodiscard]] CFP_INLINE bool project(const Vector3<Scalar>& point, Vector2<Scalar>& pixel,
                                        Matrix23<Scalar>* jacobian = nullptr) const noexcept {
    if (!(point.z() > Scalar(Tolerance<Scalar>::min_depth)) || !is_finite(point.z())) return false;
    const Scalar inv_z = Scalar(1) / point.z();
    const Scalar x = point.x() * inv_z;
    const Scalar y = point.y() * inv_z;
    const Scalar u = fx * x + cx;
    const Scalar v = fy * y + cy;
    if (!is_finite(u) || !is_finite(v)) return false;
    // No comma initialisers in cfp: g++ 12.2 at -O3 -DNDEBUG loses coefficients of those it inlines into a loop.
    pixel[0] = u;
    pixel[1] = v;
    if (jacobian != nullptr) {
      jacobian->setZero();
      (*jacobian)(0, 0) = fx * inv_z;
      (*jacobian)(0, 2) = -fx * x * inv_z;
      (*jacobian)(1, 1) = fy * inv_z;
      (*jacobian)(1, 2) = -fy * y * inv_z;
    }
    return true;
  }

  /// The ray through a pixel, scaled to z = 1: a point at depth d is d * ray. False, and ray untouched, for a pixel, a
  /// principal point or a result that is not finite, as of a focal length of 0.
  [[nodiscard]] CFP_INLINE bool unproject(const Vector2<Scalar>& pixel, Vector3<Scalar>& ray) const noexcept {
    const Scalar x = (pixel.x() - cx) / fx;
    const Scalar y = (pixel.y() - cy) / fy;
    if (!is_finite(x) || !is_finite(y)) return false;
    ray = {x, y, Scalar(1)};
    return true;
  }

  /// The intrinsic matrix.
  [[nodiscard]] CFP_INLINE Matrix3<Scalar> matrix() const noexcept {
    const Scalar zero(0), one(1);
    return Matrix3<Scalar>{{fx, zero, cx}, {zero, fy, cy}, {zero, zero, one}};
  }

  template <typename Other>
  [[nodiscard]] CFP_INLINE PinholeCamera<Other> cast() const noexcept {
    return {static_cast<Other>(fx), static_cast<Other>(fy), static_cast<Other>(cx), static_cast<Other>(cy)};
  }
};

template <typename Scalar>
struct AnyCamera;  // any_camera.hpp

namespace detail {

template <typename Camera>
inline constexpr bool is_pinhole = std::is_same_v<Camera, PinholeCamera<typename Camera::ScalarType>>;
template <typename Camera>
inline constexpr bool is_any = std::is_same_v<Camera, AnyCamera<typename Camera::ScalarType>>;

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
}  // namespace detail

inline namespace CFP_ISA {

/// The pinhole camera of a camera's undistorted image: focal lengths and principal point of its projection at the
/// optical axis. A pinhole camera gives itself. All zero (every unprojection invalid) for a camera that cannot project
/// its own axis.
template <typename Camera, typename Scalar = typename Camera::ScalarType>
[[nodiscard]] PinholeCamera<Scalar> undistorted_camera(const Camera& camera) noexcept {
  Vector2<Scalar> centre;
  Matrix23<Scalar> jacobian;
  if (!camera.project(Vector3<Scalar>(Scalar(0), Scalar(0), Scalar(1)), centre, &jacobian))
    return {Scalar(0), Scalar(0), Scalar(0), Scalar(0)};
  return {jacobian(0, 0), jacobian(1, 1), centre.x(), centre.y()};
}

/// The points in the camera's undistorted image, kept in `storage`, which the returned view refers to; a pinhole
/// camera's points are their own, and storage is not touched. A pixel without a ray becomes NaN, which no distance
/// accepts. Allocates only to grow storage.
template <typename Camera, typename Scalar = typename Camera::ScalarType>
[[nodiscard]] PointSpan<Scalar, 2> undistorted(const Camera& camera, const PointSpan<non_deduced<Scalar>, 2>& points,
                                               std::vector<std::array<non_deduced<Scalar>, 2>>& storage) {
  if constexpr (detail::is_pinhole<Camera>) {
    return points;
  } else if constexpr (detail::is_any<Camera>) {
    return camera.visit([&](const auto& held) { return undistorted(held, points, storage); });
  } else {
    const PinholeCamera<Scalar> pinhole = undistorted_camera(camera);
    storage.resize(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      Vector3<Scalar> ray;
      Vector2<Scalar> pixel;
      if (!camera.unproject(points[i], ray) || !pinhole.project(ray, pixel))
        pixel.setConstant(std::numeric_limits<Scalar>::quiet_NaN());
      storage[i] = {pixel.x(), pixel.y()};
    }
    return PointSpan<Scalar, 2>(storage);
  }
}

/// The noise of points in the undistorted image relative to that of the camera's own pixels, which undistortion
/// magnifies at the edge of a fisheye: root mean square over both directions, times `relative` if that is not empty.
/// Kept in `storage`, which the returned view refers to; for a pinhole camera `relative` itself. 1 for a point that the
/// camera does not see. Allocates only to grow storage.
template <typename Camera, typename Scalar = typename Camera::ScalarType>
[[nodiscard]] span<const Scalar> undistorted_sigmas(const Camera& camera,
                                                    const PointSpan<non_deduced<Scalar>, 2>& undistorted_points,
                                                    span<const non_deduced<Scalar>> relative,
                                                    std::vector<non_deduced<Scalar>>& storage) {
  if constexpr (detail::is_pinhole<Camera>) {
    return relative;
  } else if constexpr (detail::is_any<Camera>) {
    return camera.visit(
        [&](const auto& held) { return undistorted_sigmas(held, undistorted_points, relative, storage); });
  } else {
    using std::sqrt;
    const PinholeCamera<Scalar> pinhole = undistorted_camera(camera);
    storage.resize(undistorted_points.size());
    for (std::size_t i = 0; i < undistorted_points.size(); ++i) {
      Vector3<Scalar> ray;
      Vector2<Scalar> pixel;
      Matrix23<Scalar> J;  // its left part inverted: d undistorted pixel / d pixel is that times the focal lengths
      Scalar sigma(1);
      if (pinhole.unproject(undistorted_points[i], ray) && camera.project(ray, pixel, &J)) {
        const Scalar x = pinhole.fx * pinhole.fx * (J(1, 1) * J(1, 1) + J(0, 1) * J(0, 1)),
                     y = pinhole.fy * pinhole.fy * (J(0, 0) * J(0, 0) + J(1, 0) * J(1, 0)),
                     found = sqrt(Scalar(0.5) * (x + y)) / (J(0, 0) * J(1, 1) - J(0, 1) * J(1, 0));
        if (found > Scalar(0) && is_finite(found)) sigma = found;
      }
      storage[i] = relative.empty() ? sigma : sigma * relative[i];
    }
    return storage;
  }
}

}  // namespace CFP_ISA
}  // namespace cfp
