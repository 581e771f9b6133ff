/// @file constrain_keypoints.hpp
/// The step from the coarse pose to the fine K of every keypoint in a box (paper section IV-D): the projection and the
/// epipolar constraint, each fitted to the matches outside all boxes.
#pragma once

#include <array>
#include <limits>
#include <vector>

#include "cfp/core/span.hpp"
#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/frame_state.hpp"
#include "cfp/frame/weigh_keypoints.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/geometry/epipolar.hpp"
#include "cfp/geometry/reprojection.hpp"
#include "cfp/probability/distance_sigmoid.hpp"
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

/// The distances of all matches from the epipolar lines of the pose, in the undistorted image, on the scale of its
/// middle.
template <typename Scalar, typename Camera>
void pose_epipolar_distances(const SE3<double>& T_cur_prev, const Camera& camera, FrameState<Scalar>& state) {
  FrameScratch<Scalar>& scratch = state.scratch;
  const PointSpan<Scalar, 2> previous =
      undistorted(camera, PointSpan<Scalar, 2>(scratch.points), scratch.undistorted_previous);
  const PointSpan<Scalar, 2> current =
      undistorted(camera, PointSpan<Scalar, 2>(state.current.keypoints), scratch.undistorted_current);
  const Matrix3<Scalar> F = fundamental_from_pose(undistorted_camera(camera), T_cur_prev.template cast<Scalar>());
  const span<const Scalar> sigmas = undistorted_sigmas(camera, current, {}, scratch.relative_sigmas);
  epipolar_distances(F, {previous, current, {}, sigmas}, scratch.epipolar);
}

/// One constraint, fitted to the distances of the keypoints outside all boxes. Too few of those: to what is more likely
/// static than not as well, by the coarse stage's weights (not in the paper, whose stage then gives up).
template <typename Scalar>
[[nodiscard]] ConstraintModel<Scalar> fit_to_static(const std::vector<Scalar>& distances,
                                                    span<const Scalar> map_point_probability,
                                                    const FrameOptions& options, FrameState<Scalar>& state) {
  FrameScratch<Scalar>& scratch = state.scratch;
  scratch.values.resize(distances.size());
  const auto fit = [&](bool inside) {
    scratch.samples.clear();
    for (std::size_t i = 0; i < distances.size(); ++i) {
      if ((state.label[i] == KeypointLabel::outside && !is_unreported(i, state)) ||
          (inside && model_weight(i, map_point_at(map_point_probability, i), options, state) >= Scalar(0.5)))
        scratch.samples.push_back(distances[i]);
    }
    return fit_constraint(scratch.samples, options.fine.constraint, scratch.values);
  };
  const ConstraintModel<Scalar> outside = fit(false);
  const bool enough = outside.status != Status::not_enough_data || options.map_point.weight != WeightRule::posterior;
  return enough ? outside : fit(true);
}

/// What a constraint says of a match at this distance.
template <typename Scalar>
[[nodiscard]] Evidence<Scalar> evidence_of(const ConstraintModel<Scalar>& model, Scalar distance_px,
                                           Scalar confidence) noexcept {
  const bool fitted = model.status != Status::not_enough_data;
  return {static_probability(model, distance_px), confidence, fitted && distance_px >= Scalar(0)};
}

/// How much of somebody's motion shows who goes way_px in the image: all of it from D_Th on, its square below.
template <typename Scalar>
[[nodiscard]] Scalar visibility_of(Scalar way_px, Scalar threshold_px) noexcept {
  const Scalar share = way_px < threshold_px ? way_px / threshold_px : Scalar(1);
  return share * share;
}

/// Both constraints of a frame, and how far each is believed: C_s C_c.
template <typename Scalar>
struct FrameConstraints {
  ConstraintModel<Scalar> projection, epipolar;
  Scalar projection_confidence{}, epipolar_confidence{};
};

/// Sets the distances of all matches in scratch.projection and scratch.epipolar, and fits both constraints to them.
template <typename Scalar, typename Camera>
[[nodiscard]] FrameConstraints<Scalar> fit_constraints(const PoseEstimate& pose,
                                                       span<const Scalar> map_point_probability, const Camera& camera,
                                                       const FrameOptions& options, FrameState<Scalar>& state) {
  FrameScratch<Scalar>& scratch = state.scratch;
  FrameConstraints<Scalar> fitted;
  gather_matches(state);
  scratch.projection.resize(state.size());
  scratch.epipolar.resize(state.size());
  reprojection_distances(PointSpan<Scalar, 2>(scratch.points), span<const Scalar>(scratch.depths),
                         PointSpan<Scalar, 2>(state.current.keypoints), pose.T_cur_prev.template cast<Scalar>(), camera,
                         span<Scalar>(scratch.projection));
  fitted.projection = fit_to_static(scratch.projection, map_point_probability, options, state);
  const bool alone =
      fitted.projection.status == Status::not_enough_data && options.map_point.weight == WeightRule::posterior;
  const bool moved = pose.T_cur_prev.translation.norm() > (alone ? 0 : options.fine.min_translation_m);
  if (moved) {
    pose_epipolar_distances(pose.T_cur_prev, camera, state);
    fitted.epipolar = fit_to_static(scratch.epipolar, map_point_probability, options, state);
  }
  const Scalar cs = statistical_confidence(pose.inliers, static_cast<Scalar>(options.fine.min_pose_inliers));
  fitted.projection_confidence = cs * fitted.projection.calculation_confidence;
  fitted.epipolar_confidence = cs * fitted.epipolar.calculation_confidence;
  const auto told = [](const ConstraintModel<Scalar>& model, Scalar confidence) {
    return ConstraintReport{model.status, static_cast<double>(model.threshold_px), static_cast<double>(confidence)};
  };
  state.report.projection = told(fitted.projection, fitted.projection_confidence);
  state.report.epipolar = told(fitted.epipolar, fitted.epipolar_confidence);
  if (!moved) state.report.epipolar.status = Status::degenerate;
  return fitted;
}

/// Sets state.evidence of keypoint i, which is in a box: what the fine stage knows of it; its M is m, negative: none.
template <typename Scalar>
void gather_evidence(std::size_t i, const FrameConstraints<Scalar>& constraints, Scalar m, Scalar way_at_metre_px,
                     bool posterior, FrameState<Scalar>& state) noexcept {
  const FrameScratch<Scalar>& scratch = state.scratch;
  const ConstraintModel<Scalar>&projection = constraints.projection, &epipolar = constraints.epipolar;
  const std::size_t b = static_cast<std::size_t>(state.box[i]);
  SecondStageKeypoint<Scalar>& keypoint = state.evidence[i];
  keypoint.projection = evidence_of(projection, scratch.projection[i], constraints.projection_confidence);
  keypoint.epipolar = evidence_of(epipolar, scratch.epipolar[i], constraints.epipolar_confidence);
  keypoint.object_probability = static_cast<Scalar>(state.objects[b].static_probability);
  keypoint.map_point_probability = m >= Scalar(0) ? m : Scalar(1);
  keypoint.foreground = state.label[i] == KeypointLabel::foreground;
  keypoint.matched = is_finite(scratch.points[i][0]) && is_finite(scratch.points[i][1]);
  keypoint.box_associated = posterior || state.boxes[b].associated;
  const Scalar seen_px = projection.status != Status::not_enough_data ? projection.threshold_px : epipolar.threshold_px;
  keypoint.visibility = way_at_metre_px > Scalar(0) && is_valid_depth(scratch.depths[i])
                            ? visibility_of(way_at_metre_px / scratch.depths[i], seen_px)
                            : Scalar(1);
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// Sets K of every keypoint in a box. In order: the distances d^T (reprojection_distances) and d^F
/// (epipolar_distances under F = K^-T [t]x R K^-1 with the camera matrix K, skipped for |t| <= t_Th: see
/// FineOptions::min_translation_m) of all matches; a
/// sigmoid for each from the keypoints outside all boxes; second_stage_probability for those inside. M is that of
/// before this frame, negative where there is no map point; empty for a host that keeps none. With
/// WeightRule::posterior a keypoint that neither constraint judges, for want of a match, a depth or a translation, gets
/// 1/2: its weight is what was known before; K counts as much as a walker's motion would show at its depth
/// (FineOptions::least_speed_m_s); and a box that was not there before is as any: the paper's 0 in it takes the wall in
/// a false box, and somebody's second one, where a false match's distance shows it anyway (examples/slam/WEIGHTS.md).
/// When neither sigmoid has enough samples, the coarse K stays; a pose that is not finite has that effect.
/// O(keypoints).
template <typename Scalar, typename Camera>
void constrain_keypoints(const PoseEstimate& pose, span<const non_deduced<Scalar>> map_point_probability,
                         const Camera& camera, const FrameOptions& options, FrameState<Scalar>& state) {
  CFP_ASSERT(detail::fits(state.size(), map_point_probability));
  state.report.stage = Stage::fine;
  state.report.constrained = 0;
  if (!options.fine.enabled) return;
  const detail::FrameConstraints<Scalar> constraints =
      detail::fit_constraints<Scalar>(pose, map_point_probability, camera, options, state);
  if (constraints.projection.status == Status::not_enough_data &&
      constraints.epipolar.status == Status::not_enough_data)
    return;

  const std::size_t n = state.size();
  state.evidence.resize(n);
  const bool posterior = options.map_point.weight == WeightRule::posterior;
  const Scalar threshold = static_cast<Scalar>(options.object_threshold);
  const Scalar way_at_metre_px =
      undistorted_camera(camera).fx * static_cast<Scalar>(options.fine.least_speed_m_s * detail::elapsed_s(state));
  for (std::size_t i = 0; i < n; ++i) {
    if (state.box[i] == no_box) continue;
    const Scalar m = detail::map_point_at(map_point_probability, i);
    detail::gather_evidence(i, constraints, m, way_at_metre_px, posterior, state);
    const SecondStageKeypoint<Scalar>& keypoint = state.evidence[i];
    state.static_probability[i] =
        posterior ? second_stage_evidence(keypoint, threshold) : second_stage_probability(keypoint, threshold);
    ++state.report.constrained;
  }
}

}  // namespace CFP_ISA
}  // namespace cfp
