/// @file pose_refinement.hpp
/// Weighted pose refinement (motion-only bundle adjustment; paper section IV-A.2, the probabilities as weights).
///
///   minimise over T = T_cam_world   sum over i of  w_i rho(s_i),   s_i = |r_i|^2 / sigma_i^2
///   r_i = projection of T X_i - pixel_i        (2 rows; with a depth a third one: u - fx b / z - u_right)
///
/// The weight stands outside the loss and the outlier test sees s alone (5.991 for 2 rows, 7.815 for 3): a point that
/// is probably moving never becomes harder to reject. The g2o / ORB-SLAM2 way, rho(w s) tested on w s, is one switch
/// away. Units: metres, pixels. Updates multiply from the left, T <- exp(xi) T, xi = (rho, w) as in math/se3.hpp.
#pragma once

#include "cfp/geometry/camera.hpp"
#include "cfp/optimization/pose/pose_refinement_impl.hpp"
#include "cfp/optimization/pose/pose_refinement_types.hpp"
#include "cfp/simd/packet.hpp"

namespace cfp {

/// Refines T_cam_world from the start pose. Arithmetic in Scalar (of the workspace), sums and pose in double; float is
/// as accurate as double wherever the world's origin is, because points are taken relative to the start position. In
/// double, a pinhole camera's passes on the way are drafts in float, two points for one: those whose step promised to
/// move pixels by more than 0.1 sigma on average, all but the last one or two of the default rounds. Pose, information,
/// cost, chi2 and inliers come from double, and only double arithmetic alone refuses a pose. Against double alone that
/// saves 15 % to 34 % of the default rounds' time from 300 points on (ORB-SLAM2's schedule: 7 % to 20 %); the pose
/// differs by 1e-4 of its sigma in the median, at most by what min_decrease leaves open, and rounds that run to their
/// minimum end in the same one (pose_refinement_draft_test.cpp). Points behind the camera (z below
/// Tolerance::min_depth, or more than 89.4 degrees off the axis of a pinhole camera) count for nothing and are no
/// inliers. `inliers` (empty, or length n): 1 for an inlier, else 0; all 0 when the pose is untouched. Same input, same
/// bits. Allocates only when the workspace grows. O(n) per evaluation; a pinhole camera takes the packet path
/// (simd/packet.hpp), other cameras one projection with Jacobian per point.
/// `options` must be valid (invalid_field), spans of matching length: asserted.
template <typename Scalar, typename Input, typename Camera>
PoseResult refine_pose(const PoseObservations<Input>& observations, const Camera& camera,
                       const SE3<double>& T_cam_world, const PoseOptions& options, PoseWorkspace<Scalar>& workspace,
                       span<char> inliers = {}) {
  return detail::refine_pose_with<Packet<Scalar>>(observations, camera, T_cam_world, options, workspace, inliers);
}

}  // namespace cfp
