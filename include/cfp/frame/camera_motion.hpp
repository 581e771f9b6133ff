/// @file camera_motion.hpp
/// The camera's motion between two frames from optical-flow pairs whose depth is known, and the noise of the flow. Not
/// in the paper, which judges objects by a fundamental matrix: that has nothing to say of planes, rotations and cameras
/// at rest, and is blind along its lines.
#pragma once

#include <array>

#include "cfp/core/span.hpp"
#include "cfp/frame/camera_motion_impl.hpp"
#include "cfp/frame/camera_motion_types.hpp"
#include "cfp/frame/pair_points_impl.hpp"
#include "cfp/geometry/flow_pairs.hpp"

namespace cfp {

inline namespace CFP_ISA {

/// The motion of the camera from the pairs of the undistorted image that `outside` marks as on no object and whose
/// depth is known and shared by neighbours. Unknown where too few pairs have such a depth or agree. O(pairs).
///  1. refine_pose from rest at the largest noise; then the noise that the pairs show is measured.
///  2. If that is at most search_above_px, or pnp_ransac finds nothing: refine_pose again, at the noise measured and
///     what the errors of the depths add to it under the motion so far.
///  3. Else, and where too few agreed to the first, from what pnp_ransac finds by the last round of `pose` alone, at a
///     third of its scale, then at its own; the second counts unless the noise grows by more than chance.
template <typename Scalar>
[[nodiscard]] CameraMotion<Scalar> estimate_camera_motion(const FlowPairs<Scalar>& flow, span<const char> outside,
                                                          const PinholeCamera<Scalar>& camera,
                                                          const CameraMotionOptions& options,
                                                          CameraMotionWorkspace<Scalar>& workspace) {
  CFP_ASSERT(outside.size() == flow.current.size());
  detail::place_points(flow, outside, camera, workspace.points);
  workspace.taken = detail::leave_out_lone_depths(flow.previous, Scalar(options.shared_depth_ratio),
                                                  span<std::array<Scalar, 3>>(workspace.points), workspace.grid);
  if (workspace.taken < options.min_pairs) return {};

  if (workspace.search.observations.index.size() < outside.size())  // a later call may search and must not allocate
    workspace.search.observations.begin(outside.size());
  workspace.search.sampling.reserve(outside.size());
  workspace.near_m = detail::depth_at_share(workspace.points, options.nearest_share, workspace.distances);
  const detail::PairsWithDepth<Scalar> pairs{flow, camera, options, workspace};
  SE3<double> T;
  const CameraMotion<Scalar> first = pairs.refine(Scalar(options.max_sigma_px), options.pose, T);
  const Scalar noise_px = first.known ? first.sigma_px : Scalar(options.max_sigma_px);
  if (!(noise_px > Scalar(options.search_above_px)) || !pairs.search(noise_px, T))
    return first.known ? pairs.refine(noise_px, options.pose, T) : first;
  // A wide loss would lose what was found again to what moves: a tight one first. The usual one errs less, and counts
  // unless the pairs agree to it less, by more than chance (cfp_camera_motion_study, cfp_object_motion_study).
  const Scalar found_px = pairs.noise_under(T, noise_px);
  const CameraMotion<Scalar> tight = pairs.refine(found_px, detail::last_round(options.pose, 1.0 / 3), T);
  if (!tight.known) return tight;
  const CameraMotion<Scalar> usual = pairs.refine(tight.sigma_px, detail::last_round(options.pose, 1), T);
  return usual.known && usual.sigma_px <= tight.sigma_px * (1 + 20 / static_cast<Scalar>(workspace.taken)) ? usual
                                                                                                           : tight;
}

}  // namespace CFP_ISA
}  // namespace cfp
