/// @file homography.hpp
/// What is left of two-view geometry when the camera only turns or stands still, where no fundamental matrix exists:
/// the homography of a rotation.
#pragma once

#include "cfp/core/span.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/math/matrix3.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// The motion of the whole image when the camera turns by R (of T_cur_prev): K R K^-1 with the camera matrix K, pixels
/// of the undistorted image. For the box tracker, which knows nothing of the camera.
template <typename Scalar>
[[nodiscard]] Matrix3<Scalar> rotation_homography(const PinholeCamera<Scalar>& camera,
                                                  const Matrix3<non_deduced<Scalar>>& R) noexcept {
  return camera.matrix() * R * inverse(camera.matrix());
}

}  // namespace CFP_ISA
}  // namespace cfp
