/// @file camera_motion.hpp
/// The camera's motion between two frames from optical-flow pairs whose depth is known, and the noise of the flow. Not
/// in the paper, which judges objects by a fundamental matrix: planes, rotations and cameras at rest have none, and it
/// cannot see motion along its lines.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "cfp/core/span.hpp"
#include "cfp/frame/camera_motion_types.hpp"
#include "cfp/frame/pair_points_impl.hpp"
#include "cfp/geometry/flow_pairs.hpp"
#include "cfp/geometry/motion_distance.hpp"
#include "cfp/optimization/pose/pose_refinement.hpp"
#include "cfp/robust/pnp_ransac.hpp"

namespace cfp {

namespace detail {
inline namespace CFP_ISA {

/// The noise of the flow by robust_sigma, within the bounds of the options, corrected for the degrees of freedom:
/// `parameters` were fitted to the pairs that have a distance, with `coordinates` measurements each.
template <typename Scalar>
[[nodiscard]] Scalar flow_sigma(span<Scalar> distances, int coordinates, int parameters,
                                const CameraMotionOptions& options) noexcept {
  const span<Scalar> kept = distances.subspan(0, copy_distances(span<const Scalar>(distances), distances));
  const auto told = static_cast<Scalar>(kept.size()) * static_cast<Scalar>(coordinates);
  const Scalar free = std::sqrt(told / (std::max)(told - static_cast<Scalar>(parameters), Scalar(1)));
  return std::clamp(free * robust_sigma(kept, coordinates), Scalar(options.min_sigma_px), Scalar(options.max_sigma_px));
}

/// The usable pairs (those with a point in workspace.points) and what is computed from them.
template <typename Scalar>
struct PairsWithDepth {
  const FlowPairs<Scalar>& flow;
  const PinholeCamera<Scalar>& camera;
  const CameraMotionOptions& options;
  CameraMotionWorkspace<Scalar>& workspace;

  [[nodiscard]] bool tells(std::size_t i) const noexcept { return is_finite(workspace.points[i][0]); }

  /// expected_residual of pair i under a motion.
  [[nodiscard]] bool residual_of(std::size_t i, const SE3<Scalar>& T, MotionResidual<Scalar>& out) const noexcept {
    return expected_residual<PinholeCamera<Scalar>, Scalar>(flow.previous[i], workspace.points[i][2], flow.current[i],
                                                            T, camera, options.distance, out);
  }

  /// The noise of pair i's pixel, inflated for near points to limit their leverage.
  [[nodiscard]] Scalar pixel_sigma_of(std::size_t i, Scalar sigma_px) const noexcept {
    return sigma_px * flow.relative_sigma(i) * (std::max)(Scalar(1), workspace.near_m / workspace.points[i][2]);
  }

  /// The noise of the pairs, measured under a motion.
  [[nodiscard]] Scalar noise_under(const SE3<double>& T_cur_prev, Scalar sigma_px) const {
    std::vector<Scalar>& distances = workspace.distances;
    distances.clear();
    distances.reserve(workspace.points.size());
    const SE3<Scalar> T = T_cur_prev.template cast<Scalar>();
    MotionResidual<Scalar> pair;
    for (std::size_t i = 0; i < workspace.points.size(); ++i) {
      const Scalar relative = flow.relative_sigma(i);
      if (tells(i) && residual_of(i, T, pair)) distances.push_back(distance_of(pair, sigma_px * relative) / relative);
    }
    return flow_sigma(span<Scalar>(distances), 2, 6, options);
  }

  /// What the error of its depth adds to the variance of its pixel; 0 where the camera does not translate.
  [[nodiscard]] Scalar depth_variance_of(std::size_t i, const SE3<Scalar>& T) const noexcept {
    MotionResidual<Scalar> pair;
    if (T.translation.isZero(0) || !residual_of(i, T, pair)) return Scalar(0);
    return pair.sigma_z * pair.sigma_z * pair.along.squaredNorm();
  }

  /// refine_pose from T at the given noise; T becomes the result, and the motion carries the noise measured under it.
  [[nodiscard]] CameraMotion<Scalar> refine(Scalar sigma_px, const PoseOptions& rounds, SE3<double>& T) const {
    const SE3<Scalar> so_far = T.template cast<Scalar>();
    workspace.sigmas.clear();
    Scalar depth_share = 0;  // of what they add to the variances of the pixels, the mean
    for (std::size_t i = 0; i < workspace.points.size(); ++i) {
      const Scalar of_pixel = pixel_sigma_of(i, sigma_px), of_depth = tells(i) ? depth_variance_of(i, so_far) : 0;
      workspace.sigmas.push_back(std::sqrt(of_pixel * of_pixel + of_depth));
      depth_share += of_depth / (of_pixel * of_pixel);
    }
    PoseObservations<Scalar> observations;
    observations.points = workspace.points;
    observations.pixels = flow.current;
    observations.sigmas = workspace.sigmas;
    const PoseResult refined = refine_pose(observations, camera, T, rounds, workspace.pose);
    CameraMotion<Scalar> motion;
    Matrix6<double> covariance;
    motion.known =
        is_solved(refined.status) &&
        static_cast<double>(refined.inliers) >= options.min_inlier_share * static_cast<double>(workspace.taken) &&
        invert_normal_equations<6>(refined.information, 1e-12, covariance);
    if (!motion.known) return motion;
    T = refined.T_cam_world;
    motion.T_cur_prev = T.template cast<Scalar>();
    motion.covariance = covariance.template cast<Scalar>();
    motion.sigma_px = noise_under(T, sigma_px);
    return depth_share > Scalar(0.1) * static_cast<Scalar>(workspace.taken) ? settle(motion) : motion;
  }

  /// Two Gauss-Newton steps from a refined motion, with the errors of the depths along the line alone and not in both
  /// coordinates, as refine_pose has to take them.
  [[nodiscard]] CameraMotion<Scalar> settle(CameraMotion<Scalar> motion) const {
    for (int step = 0; step < 2; ++step) {
      NormalEquations<6> sums;
      double weight = 0, agreeing = 0;
      MotionResidual<Scalar> pair;
      for (std::size_t i = 0; i < workspace.points.size(); ++i) {
        const Scalar sigma_px = pixel_sigma_of(i, motion.sigma_px);
        if (!tells(i) || !likely_residual<PinholeCamera<Scalar>, Scalar>(flow.previous[i], workspace.points[i][2],
                                                                         flow.current[i], motion.T_cur_prev, camera,
                                                                         sigma_px, options.distance, pair))
          continue;
        const PairTerm term = add_pair(pair, static_cast<double>(sigma_px), Vector6<double>::Zero(), sums);
        weight += term.weight;
        agreeing += term.distance_sq <= options.pose.chi2_mono ? 1 : 0;
      }
      Matrix6<double> covariance;
      if (!(agreeing > 0) || !invert_normal_equations<6>(sums.H, 1e-12, covariance)) break;
      const SE3<double> T =
          se3_exp(Vector6<double>(-covariance.lazyProduct(sums.g))) * motion.T_cur_prev.template cast<double>();
      motion.T_cur_prev = T.template cast<Scalar>();
      motion.covariance = (covariance * (weight / agreeing)).template cast<Scalar>();  // H counts by the loss's weights
      motion.sigma_px = noise_under(T, motion.sigma_px);
    }
    return motion;
  }

  /// The motion with most support; false, and T untouched, if there is none. The threshold is below sigma_px, since
  /// that noise was measured under a motion that moving pairs may have biased: a wider one would accept both.
  [[nodiscard]] bool search(Scalar sigma_px, SE3<double>& T) const {
    constexpr std::size_t most = 150;  // pairs; more take their time and find little more
    PnpRansacOptions ransac;
    ransac.threshold_px = 0.7 * (std::min)(static_cast<double>(sigma_px), 1e3);
    ransac.max_iterations = 50;
    workspace.sigmas.assign(workspace.points.size(), Scalar(0));
    for (std::size_t i = 0, k = 0; i < workspace.points.size(); ++i) {
      if (!tells(i)) continue;
      if (k * most / workspace.taken != (k + 1) * most / workspace.taken) workspace.sigmas[i] = Scalar(1);
      ++k;
    }
    const PnpRansacResult<Scalar> found = pnp_ransac(PointSpan<Scalar, 3>(workspace.points), flow.current,
                                                     workspace.sigmas, camera, ransac, workspace.search);
    if (found.found()) T = found.T_cam_world.template cast<double>();
    return found.found();
  }
};

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
/// depth is known and shared by neighbours. Unknown if too few pairs have such a depth or are inliers. O(pairs).
///  1. refine_pose from rest at the largest noise; then the noise that the pairs show is measured.
///  2. If that is at most search_above_px, or pnp_ransac finds nothing: refine_pose again, at the noise measured and
///     what the errors of the depths add to it under the motion so far.
///  3. Else, and where too few agreed to the first, from what pnp_ransac finds by the last round of `pose` alone, at a
///     third of its scale, then at its own; the second counts unless the noise grows by more than chance.
///  4. Two Gauss-Newton steps under the noise of each pair, that of its depth along the epipolar line alone, where the
///     depths' errors are over a tenth of the variances: else, 0.2 m a frame before a wall 7 m away, the translation
///     would come out 1.6 of its sigmas too short and err twice as much.
/// The noise counts that six parameters were fitted to the pairs.
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

  workspace.search.reserve(outside.size());  // a later call may search and must not allocate
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
