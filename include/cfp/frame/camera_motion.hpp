/// @file camera_motion.hpp
/// The camera's motion between two frames from optical-flow pairs whose depth is known, and the noise of the flow. Not
/// in the paper, which judges objects by a fundamental matrix: that has nothing to say of planes, rotations and cameras
/// at rest, and is blind along its lines.
#pragma once

#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include "cfp/core/options.hpp"
#include "cfp/core/span.hpp"
#include "cfp/frame/frame.hpp"
#include "cfp/frame/lone_depths_impl.hpp"
#include "cfp/geometry/motion_distance.hpp"
#include "cfp/math/order_statistic.hpp"
#include "cfp/optimization/pose/pose_refinement.hpp"
#include "cfp/robust/pnp_ransac.hpp"

namespace cfp {

struct CameraMotionOptions {
  std::size_t min_pairs = 12;  ///< with depth, on no object: with fewer there is no motion, >= 3
  /// of these, within the outlier threshold of `pose`: a motion that fewer agree to is none, in [0, 1]
  double min_inlier_share = 0.5;
  double min_sigma_px = 0.05;  ///< the noise of the flow is measured and kept in these bounds, > 0
  double max_sigma_px = 1;     ///< >= min_sigma_px
  /// More noise than this may be something that moves and no box holds: the motion is then searched by pnp_ransac,
  /// which a third of such pairs seldom mislead (cfp_camera_motion_study); px, > 0.
  double search_above_px = 0.25;
  /// A depth that fewer than two of some seven neighbours in the image share to this ratio takes no part, unless that
  /// is over three eighths of them; a ratio without unit, >= 0. 0: all take part (cfp_object_motion_study).
  double shared_depth_ratio = 0.12;
  /// A pair tells no more of the translation than if it were as far as this share of them, in [0, 1]: few near ones are
  /// a lever that a wrong depth would move. 0: each tells what it can (cfp_object_motion_study).
  double nearest_share = 0.2;
  MotionDistanceOptions distance;
  PoseOptions pose;
};

template <typename Scalar>
struct CameraMotion : UncertainMotion<Scalar> {
  bool known = false;
  Scalar sigma_px = Scalar(1);  ///< standard deviation of one coordinate of a static flow pair, robust
  int coordinates = 2;          ///< of a pixel that most distances see: one where a depth is unknown and counts

  CFP_INLINE CameraMotion() noexcept {}  // NOLINT(modernize-use-equals-default): inline
};

/// Scratch memory, reused: after a call with depths and one without, calls of at most the same sizes allocate nothing.
template <typename Scalar>
struct CameraMotionWorkspace {
  std::vector<std::array<Scalar, 3>> points;  // of the pairs, in the previous camera; NaN: takes no part
  detail::LoneDepthsWorkspace<Scalar> depths;
  std::vector<Scalar> sigmas, distances;
  PoseWorkspace<Scalar> pose;
  PnpRansacWorkspace search;
};

inline namespace CFP_ISA {

[[nodiscard]] inline OptionPath invalid_field(const CameraMotionOptions& o) noexcept {
  if (o.min_pairs < 3) return "min_pairs";
  if (!(o.min_inlier_share >= 0 && o.min_inlier_share <= 1)) return "min_inlier_share";
  if (!detail::positive(o.min_sigma_px)) return "min_sigma_px";
  if (!(o.max_sigma_px >= o.min_sigma_px) || !is_finite(o.max_sigma_px)) return "max_sigma_px";
  if (!detail::positive(o.search_above_px)) return "search_above_px";
  if (!detail::non_negative(o.shared_depth_ratio)) return "shared_depth_ratio";
  if (!(o.nearest_share >= 0 && o.nearest_share <= 1)) return "nearest_share";
  if (const OptionPath field = nested("distance", invalid_field(o.distance))) return field;
  return nested("pose", invalid_field(o.pose));
}

}  // namespace CFP_ISA

namespace detail {
inline namespace CFP_ISA {

/// The noise of the flow by robust_sigma, within the bounds of the options.
template <typename Scalar>
[[nodiscard]] Scalar flow_sigma(span<Scalar> distances, int coordinates, const CameraMotionOptions& options) noexcept {
  return std::clamp(robust_sigma(distances, coordinates), Scalar(options.min_sigma_px), Scalar(options.max_sigma_px));
}

/// The pairs marked in `outside` whose depth is valid, as points of the previous camera; the others as NaN.
template <typename Scalar>
void place_points(const FlowPairs<Scalar>& flow, span<const char> outside, const PinholeCamera<Scalar>& camera,
                  std::vector<std::array<Scalar, 3>>& points) {
  const Scalar nowhere = std::numeric_limits<Scalar>::quiet_NaN();
  points.assign(outside.size(), {nowhere, nowhere, nowhere});
  for (std::size_t i = 0; i < flow.previous_depths.size(); ++i) {
    const Scalar z = flow.previous_depths[i];
    Vector3<Scalar> ray;
    if (outside[i] == 0 || !is_valid_depth(z) || !camera.unproject(flow.previous[i], ray)) continue;
    points[i] = {ray.x() * z, ray.y() * z, z};
  }
}

/// The depth that the given share of the points do not exceed. At least one point must be finite.
template <typename Scalar>
[[nodiscard]] Scalar depth_at_share(const std::vector<std::array<Scalar, 3>>& points, double share,
                                    std::vector<Scalar>& depths) {
  depths.clear();
  for (const auto& point : points) {
    if (is_finite(point[0])) depths.push_back(point[2]);
  }
  return quantile(span<Scalar>(depths), share);
}

/// The motion that most of the `taken` workspace.points agree to; false, and T untouched, without one. Its threshold is
/// below sigma_px, their noise under a motion which what moves may have led astray: a wider one would hold both.
template <typename Scalar>
[[nodiscard]] bool search_camera_motion(const PointSpan<Scalar, 2>& current, std::size_t taken,
                                        const PinholeCamera<Scalar>& camera, Scalar sigma_px,
                                        CameraMotionWorkspace<Scalar>& workspace, SE3<double>& T) {
  constexpr std::size_t most = 150;  // pairs; more take their time and find little more
  PnpRansacOptions search;
  search.threshold_px = 0.7 * (std::min)(static_cast<double>(sigma_px), 1e3);
  search.max_iterations = 50;
  workspace.sigmas.assign(current.size(), Scalar(0));
  for (std::size_t i = 0, k = 0; i < current.size(); ++i) {
    if (!is_finite(workspace.points[i][0])) continue;
    if (k * most / taken != (k + 1) * most / taken) workspace.sigmas[i] = Scalar(1);
    ++k;
  }
  const PnpRansacResult<Scalar> found =
      pnp_ransac(PointSpan<Scalar, 3>(workspace.points), current, workspace.sigmas, camera, search, workspace.search);
  if (found.found()) T = found.T_cam_world.template cast<double>();
  return found.found();
}

/// The last round alone, its scale times a factor.
[[nodiscard]] inline PoseOptions last_round(PoseOptions options, double factor) noexcept {
  options.rounds[0] = options.rounds[options.round_count - 1];
  options.rounds[0].scale *= factor;
  options.round_count = 1;
  return options;
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// The motion of the camera from the pairs of the undistorted image that `outside` marks as on no object and whose
/// depth is known and shared by neighbours. Unknown where too few pairs have such a depth or agree. O(pairs).
///  1. refine_pose from `start` at the largest noise; then the noise that the pairs show is measured.
///  2. If that is at most search_above_px, or pnp_ransac finds nothing: refine_pose again, at the noise measured.
///  3. Else from what pnp_ransac finds by the last round of `pose` alone, at a third of its scale, then at its own; the
///     second counts unless the noise grows by more than chance.
template <typename Scalar>
[[nodiscard]] CameraMotion<Scalar> estimate_camera_motion(const FlowPairs<Scalar>& flow, span<const char> outside,
                                                          const SE3<double>& start, const PinholeCamera<Scalar>& camera,
                                                          const CameraMotionOptions& options,
                                                          CameraMotionWorkspace<Scalar>& workspace) {
  CFP_ASSERT(outside.size() == flow.current.size());
  CameraMotion<Scalar> motion;
  detail::place_points(flow, outside, camera, workspace.points);
  const std::size_t taken =
      detail::leave_out_lone_depths(flow.previous, Scalar(options.shared_depth_ratio),
                                    span<std::array<Scalar, 3>>(workspace.points), workspace.depths);
  if (taken < options.min_pairs) return motion;

  const Scalar near_m = detail::depth_at_share(workspace.points, options.nearest_share, workspace.distances);
  workspace.distances.resize(outside.size());
  if (workspace.search.observations.index.size() < outside.size())  // a later call may search and must not allocate
    workspace.search.observations.begin(outside.size());
  workspace.search.sampling.reserve(outside.size());
  const auto believe = [&](const SE3<double>& T_cur_prev) {
    motion.T_cur_prev = T_cur_prev.template cast<Scalar>();
    motion_distances(flow.previous, flow.previous_depths, flow.current, UncertainMotion<Scalar>(motion.T_cur_prev),
                     camera, motion.sigma_px, options.distance, workspace.distances);
    for (std::size_t i = 0; i < outside.size(); ++i) {
      if (!is_finite(workspace.points[i][0])) workspace.distances[i] = Scalar(no_distance<double>);
    }
    motion.sigma_px = detail::flow_sigma(span<Scalar>(workspace.distances), 2, options);
  };
  const auto refine = [&](SE3<double>& T, const PoseOptions& rounds) {
    workspace.sigmas.clear();
    for (const auto& point : workspace.points)
      workspace.sigmas.push_back(motion.sigma_px * (std::max)(Scalar(1), near_m / point[2]));
    PoseObservations<Scalar> observations;
    observations.points = workspace.points;
    observations.pixels = flow.current;
    observations.sigmas = workspace.sigmas;
    const PoseResult refined = refine_pose(observations, camera, T, rounds, workspace.pose);
    Matrix6<double> covariance;
    motion.known = is_solved(refined.status) &&
                   static_cast<double>(refined.inliers) >= options.min_inlier_share * static_cast<double>(taken) &&
                   invert_normal_equations<6>(refined.information, 1e-12, covariance);
    if (!motion.known) return false;
    T = refined.T_cam_world;
    motion.covariance = covariance.template cast<Scalar>();
    believe(T);
    return true;
  };
  SE3<double> T = start;
  motion.sigma_px = Scalar(options.max_sigma_px);
  if (!refine(T, options.pose)) return motion;
  if (!(motion.sigma_px > Scalar(options.search_above_px)) ||
      !detail::search_camera_motion(flow.current, taken, camera, motion.sigma_px, workspace, T)) {
    refine(T, options.pose);
    return motion;
  }
  // A wide loss would lose what was found again to what moves: a tight one first. The usual one errs less, and counts
  // unless the pairs agree to it less, by more than chance (cfp_camera_motion_study, cfp_object_motion_study).
  believe(T);
  if (!refine(T, detail::last_round(options.pose, 1.0 / 3))) return motion;
  const CameraMotion<Scalar> tight = motion;
  const Scalar most_px = tight.sigma_px * (1 + 20 / static_cast<Scalar>(taken));
  return refine(T, detail::last_round(options.pose, 1)) && motion.sigma_px <= most_px ? motion : tight;
}

}  // namespace CFP_ISA
}  // namespace cfp
