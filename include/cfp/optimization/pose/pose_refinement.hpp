/// @file pose_refinement.hpp
/// Weighted pose refinement (motion-only bundle adjustment; paper section IV-A.2, the probabilities as weights).
///
///   minimise over T = T_cam_world   sum over i of  w_i rho(s_i),   s_i = |r_i|^2 / sigma_i^2
///   r_i = projection of T X_i - pixel_i        (2 rows; with a depth a third one: u - fx b / z - u_right)
///
/// The weight stands outside the loss and the outlier test sees s alone (5.991 for 2 rows, 7.815 for 3): a point that
/// is probably moving never becomes harder to reject. (g2o as ORB-SLAM2 uses it puts the factor inside, rho(w s) tested
/// on w s; the two agree for w in {0, 1}.) Units: metres, pixels. Updates multiply from the left, T <- exp(xi) T,
/// xi = (rho, w) as in math/se3.hpp.
#pragma once

#include "cfp/geometry/camera.hpp"
#include "cfp/optimization/pose/pose_problem.hpp"
#include "cfp/optimization/pose/pose_refinement_impl.hpp"
#include "cfp/simd/packet.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// Refines T_cam_world from the start pose. Arithmetic in Scalar (of the workspace), sums and pose in double: a
/// PoseWorkspace<float> is the fast path, as accurate as double wherever the world's origin is, because points are
/// taken relative to the start position. Points behind the camera (z below Tolerance::min_depth, or more than 89.4
/// degrees off the axis of a pinhole camera) count for nothing and are no inliers. `inliers` (empty, or length n): 1
/// for an inlier, else 0; all 0 when the pose is untouched. Same input, same bits. Allocates only when the workspace
/// grows. O(n) per evaluation; a pinhole camera is evaluated in vector instructions, any other point by point.
///
/// A start that is no rigid motion (a non-finite one is returned as identity), an unusable camera, or two arrays for
/// one quantity (PoseObservations): invalid_input. `options` must be valid (invalid_field), spans of matching length:
/// asserted.
template <typename Scalar, typename Input, typename Camera>
[[nodiscard]] PoseResult refine_pose(const PoseObservations<Input>& observations, const Camera& camera,
                                     const SE3<double>& T_cam_world, const PoseOptions& options,
                                     PoseWorkspace<Scalar>& workspace, span<char> inliers = {}) {
  return detail::refine_pose_with<simd::Packet<Scalar>>(observations, camera, T_cam_world, options, workspace, inliers);
}

}  // namespace CFP_ISA
}  // namespace cfp
