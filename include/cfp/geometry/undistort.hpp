/// @file undistort.hpp
/// The undistorted image of any camera behind the small camera interface: epipolar geometry holds only there.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <type_traits>
#include <vector>

#include "cfp/core/span.hpp"
#include "cfp/geometry/camera.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// The pinhole camera of a camera's undistorted image: focal lengths and principal point of its projection at the
/// optical axis. A pinhole camera gives itself. All zero (every unprojection invalid) for a camera that cannot project
/// its own axis.
template <typename Camera>
[[nodiscard]] PinholeCamera<typename Camera::ScalarType> undistorted_camera(const Camera& camera) noexcept {
  using Scalar = typename Camera::ScalarType;
  Vector2<Scalar> centre;
  Matrix23<Scalar> jacobian;
  if (!camera.project(Vector3<Scalar>(Scalar(0), Scalar(0), Scalar(1)), centre, &jacobian))
    return {Scalar(0), Scalar(0), Scalar(0), Scalar(0)};
  return {jacobian(0, 0), jacobian(1, 1), centre.x(), centre.y()};
}

/// The pixel of `camera` in its undistorted image, that of `pinhole` = undistorted_camera(camera). False, and
/// undistorted untouched, where the pixel has no ray.
template <typename Camera>
[[nodiscard]] bool undistort(const Camera& camera, const PinholeCamera<typename Camera::ScalarType>& pinhole,
                             const Vector2<typename Camera::ScalarType>& pixel,
                             Vector2<typename Camera::ScalarType>& undistorted) noexcept {
  Vector3<typename Camera::ScalarType> ray;
  return camera.unproject(pixel, ray) && pinhole.project(ray, undistorted);
}

/// The points in the camera's undistorted image, kept in `storage`, which the returned view refers to; a pinhole
/// camera's points are their own, and storage is not touched. A pixel without a ray becomes NaN, which no distance
/// accepts. Allocates only to grow storage.
template <typename Camera>
[[nodiscard]] PointSpan<typename Camera::ScalarType, 2> undistorted(
    const Camera& camera, const PointSpan<typename Camera::ScalarType, 2>& points,
    std::vector<std::array<typename Camera::ScalarType, 2>>& storage) {
  using Scalar = typename Camera::ScalarType;
  if constexpr (std::is_same_v<Camera, PinholeCamera<Scalar>>) {
    return points;
  } else {
    const PinholeCamera<Scalar> pinhole = undistorted_camera(camera);
    storage.resize(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      Vector2<Scalar> pixel;
      if (!undistort(camera, pinhole, points[i], pixel)) pixel.setConstant(std::numeric_limits<Scalar>::quiet_NaN());
      storage[i] = {pixel.x(), pixel.y()};
    }
    return PointSpan<Scalar, 2>(storage);
  }
}

}  // namespace CFP_ISA
}  // namespace cfp
