/// @file constrain_keypoints.hpp
/// The step from the coarse pose to the fine K of every keypoint in a box (paper section IV-D): the projection and the
/// epipolar constraint, each fitted to the matches outside all boxes.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <limits>

#include "cfp/core/span.hpp"
#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/frame_state.hpp"
#include "cfp/geometry/epipolar.hpp"
#include "cfp/geometry/reprojection.hpp"
#include "cfp/geometry/undistort.hpp"
#include "cfp/probability/distance_sigmoid.hpp"
#include "cfp/probability/map_point.hpp"
#include "cfp/probability/second_stage_probability.hpp"

namespace cfp {

namespace detail {
inline namespace CFP_ISA {

/// The matched point of every keypoint in scratch.points, its depth in scratch.depths; without a match a point that no
/// distance accepts.
template <typename Scalar>
void gather_matches(FrameState<Scalar>& state) {
  const Scalar nowhere = std::numeric_limits<Scalar>::quiet_NaN();
  const FrameMemory<Scalar>& previous = state.previous;
  state.scratch.points.resize(state.size());
  state.scratch.depths.resize(state.size());
  for (std::size_t i = 0; i < state.size(); ++i) {
    const bool matched = state.match[i] != no_match;
    const std::size_t j = matched ? static_cast<std::size_t>(state.match[i]) : 0;
    state.scratch.points[i] = matched ? previous.keypoints[j] : std::array<Scalar, 2>{nowhere, nowhere};
    state.scratch.depths[i] = matched && !previous.depths.empty() ? previous.depths[j] : Scalar(0);
  }
}

/// The distances of all matches from the epipolar lines of the pose, in the undistorted image.
template <typename Scalar, typename Camera>
void pose_epipolar_distances(const SE3<double>& T_cur_prev, const Camera& camera, FrameState<Scalar>& state) {
  FrameScratch<Scalar>& scratch = state.scratch;
  const PointSpan<Scalar, 2> previous =
      undistorted(camera, PointSpan<Scalar, 2>(scratch.points), scratch.undistorted_previous);
  const PointSpan<Scalar, 2> current =
      undistorted(camera, PointSpan<Scalar, 2>(state.current.keypoints), scratch.undistorted_current);
  const Matrix3<Scalar> F = fundamental_from_pose(undistorted_camera(camera), T_cur_prev.template cast<Scalar>());
  epipolar_distances(F, previous, current, span<Scalar>(scratch.epipolar));
}

/// One constraint, fitted to the distances of the keypoints outside all boxes.
template <typename Scalar>
[[nodiscard]] ConstraintModel<Scalar> fit_outside(const std::vector<Scalar>& distances,
                                                  const ConstraintOptions& options, FrameState<Scalar>& state) {
  FrameScratch<Scalar>& scratch = state.scratch;
  scratch.samples.clear();
  scratch.samples.reserve(distances.size());
  for (std::size_t i = 0; i < distances.size(); ++i) {
    if (state.label[i] == KeypointLabel::outside) scratch.samples.push_back(distances[i]);
  }
  scratch.scratch.resize(distances.size());
  return fit_constraint(scratch.samples, options, scratch.scratch);
}

/// Median of the valid depths among the matches, 0 without any; for the parallax form of t_Th.
template <typename Scalar>
[[nodiscard]] double median_depth(FrameScratch<Scalar>& scratch) {
  scratch.scratch.clear();
  scratch.scratch.reserve(scratch.depths.size());
  std::copy_if(scratch.depths.begin(), scratch.depths.end(), std::back_inserter(scratch.scratch),
               [](Scalar z) { return is_valid_depth(z); });
  if (scratch.scratch.empty()) return 0;
  return static_cast<double>(
      order_statistic(span<Scalar>(scratch.scratch), quantile_rank(0.5, scratch.scratch.size()) - 1));
}

template <typename Scalar>
[[nodiscard]] bool has_enough_translation(const SE3<double>& T_cur_prev, const FineOptions& options,
                                          FrameScratch<Scalar>& scratch) {
  const double t = T_cur_prev.translation.norm();
  if (!(t > options.min_translation_m)) return false;
  return options.min_parallax <= 0 || t > options.min_parallax * median_depth(scratch);
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// Sets K of every keypoint in a box, and its posterior. In order: the distances d^T (reprojection_distances) and d^F
/// (epipolar_distances under F = K^-T [t]x R K^-1 with the camera matrix K, skipped for |t| <= t_Th) of all matches; a
/// sigmoid for each from the keypoints outside all boxes; second_stage_probability for those inside. M is that of
/// before this frame, negative where there is no map point. When neither sigmoid has enough samples, the coarse K
/// stays; a pose that is not finite has that effect. O(keypoints).
template <typename Scalar, typename Camera>
void constrain_keypoints(const PoseEstimate& pose, span<const non_deduced<Scalar>> map_point_probability,
                         const Camera& camera, const FrameOptions& options, FrameState<Scalar>& state) {
  CFP_ASSERT(map_point_probability.size() == state.size());
  const std::size_t n = state.size();
  FrameScratch<Scalar>& scratch = state.scratch;
  state.posterior = state.static_probability;
  state.report.stage = Stage::fine;
  state.report.constrained = 0;
  if (!options.fine.enabled) return;

  detail::gather_matches(state);
  scratch.projection.resize(n);
  scratch.epipolar.resize(n);
  reprojection_distances(PointSpan<Scalar, 2>(scratch.points), span<const Scalar>(scratch.depths),
                         PointSpan<Scalar, 2>(state.current.keypoints), pose.T_cur_prev.template cast<Scalar>(), camera,
                         span<Scalar>(scratch.projection));
  const ConstraintModel<Scalar> projection = detail::fit_outside(scratch.projection, options.fine.projection, state);
  ConstraintModel<Scalar> epipolar;
  const bool moved = detail::has_enough_translation(pose.T_cur_prev, options.fine, scratch);
  if (moved) {
    detail::pose_epipolar_distances(pose.T_cur_prev, camera, state);
    epipolar = detail::fit_outside(scratch.epipolar, options.fine.epipolar, state);
  }
  const Scalar cs = statistical_confidence(pose.inliers, static_cast<Scalar>(options.fine.min_pose_inliers));
  const Scalar ct = cs * projection.calculation_confidence, cf = cs * epipolar.calculation_confidence;
  state.report.projection = {projection.status, static_cast<double>(projection.threshold_px), static_cast<double>(ct)};
  state.report.epipolar = {moved ? epipolar.status : Status::degenerate, static_cast<double>(epipolar.threshold_px),
                           static_cast<double>(cf)};

  const bool has_projection = projection.status != Status::not_enough_data,
             has_epipolar = epipolar.status != Status::not_enough_data;
  if (!has_projection && !has_epipolar) return;
  state.evidence.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    if (state.box[i] == no_box) continue;
    const std::size_t b = static_cast<std::size_t>(state.box[i]);
    const Scalar m = map_point_probability[i];
    SecondStageKeypoint<Scalar>& keypoint = state.evidence[i] = {};
    keypoint.projection = {static_probability(projection, scratch.projection[i]), ct,
                           has_projection && scratch.projection[i] >= Scalar(0)};
    if (has_epipolar)
      keypoint.epipolar = {static_probability(epipolar, scratch.epipolar[i]), cf, scratch.epipolar[i] >= Scalar(0)};
    keypoint.object_probability = static_cast<Scalar>(state.objects[b].static_probability);
    keypoint.map_point_probability = m >= Scalar(0) ? m : Scalar(1);
    keypoint.foreground = state.label[i] == KeypointLabel::foreground;
    keypoint.matched = is_finite(scratch.points[i][0]) && is_finite(scratch.points[i][1]);
    keypoint.box_associated = state.boxes[b].associated;
    const Scalar k = second_stage_probability(keypoint, static_cast<Scalar>(options.object_threshold));
    state.static_probability[i] = k;
    // Where neither constraint had anything to say, K stands for a lack of evidence; only an object that came from
    // nowhere is a rule.
    const bool silent = !keypoint.projection.available && !keypoint.epipolar.available &&
                        (keypoint.box_associated || !keypoint.foreground);
    state.posterior[i] =
        keypoint.matched && m >= Scalar(0) ? posterior_probability(silent ? Scalar(0.5) : k, m, options.map_point) : k;
    ++state.report.constrained;
  }
}

}  // namespace CFP_ISA
}  // namespace cfp
