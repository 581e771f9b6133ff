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

/// The sigmoid fitted to the distances of one constraint, and its confidence.
template <typename Scalar>
struct FittedConstraint {
  ConstraintModel<Scalar> model;
  Scalar confidence{};  // C_s C_c

  [[nodiscard]] bool fitted() const noexcept { return model.status != Status::not_enough_data; }
  /// What it says of a match at this distance.
  [[nodiscard]] Evidence<Scalar> evidence_at(Scalar distance_px) const noexcept {
    return {cfp::static_probability(model, distance_px), confidence, fitted() && distance_px >= Scalar(0)};
  }
  [[nodiscard]] ConstraintReport report() const noexcept {
    return {model.status, static_cast<double>(model.threshold_px), static_cast<double>(confidence)};
  }
};

/// Both constraints of a frame.
template <typename Scalar>
struct FrameConstraints {
  const PoseEstimate& pose;
  span<const Scalar> map_point_probability;
  const FrameOptions& options;
  FrameState<Scalar>& state;
  FrameScratch<Scalar>& scratch = state.scratch;
  bool posterior = options.map_point.weight == WeightRule::posterior;
  FittedConstraint<Scalar> projection = {}, epipolar = {};

  /// The matched point of every keypoint in scratch.points, its depth in scratch.depths; without a match a point that
  /// no distance accepts.
  void gather_matches() {
    const Scalar nowhere = std::numeric_limits<Scalar>::quiet_NaN();
    const FrameMemory<Scalar>& previous = state.previous;
    scratch.points.resize(state.size());
    scratch.depths.resize(state.size());
    for (std::size_t i = 0; i < state.size(); ++i) {
      const bool matched = state.match[i] != no_match;
      const std::size_t j = matched ? static_cast<std::size_t>(state.match[i]) : 0;
      scratch.points[i] = matched ? previous.keypoints[j] : std::array<Scalar, 2>{nowhere, nowhere};
      scratch.depths[i] = matched && !previous.depths.empty() ? previous.depths[j] : Scalar(0);
    }
  }

  /// The distances of all matches from the epipolar lines of the pose, in the undistorted image, scaled to the noise at
  /// its centre.
  template <typename Camera>
  void measure_epipolar(const Camera& camera) {
    const auto previous = undistorted(camera, PointSpan<Scalar, 2>(scratch.points), scratch.undistorted_previous);
    const auto current =
        undistorted(camera, PointSpan<Scalar, 2>(state.current.keypoints), scratch.undistorted_current);
    const Matrix3<Scalar> F =
        fundamental_from_pose(undistorted_camera(camera), pose.T_cur_prev.template cast<Scalar>());
    const span<const Scalar> sigmas = undistorted_sigmas(camera, current, {}, scratch.relative_sigmas);
    epipolar_distances(F, {previous, current, {}, sigmas}, scratch.epipolar);
  }

  /// One constraint, fitted to the distances of the keypoints outside all boxes. If those are too few, also to the
  /// keypoints in boxes with a coarse weight of 1/2 or more (not in the paper, whose stage then gives up).
  [[nodiscard]] FittedConstraint<Scalar> fit_to_static(const std::vector<Scalar>& distances) {
    scratch.samples.resize(distances.size());
    scratch.values.resize(distances.size());
    const auto fit = [&](bool inside) {
      for (std::size_t i = 0; i < distances.size(); ++i) {
        const bool rests =
            (state.label[i] == KeypointLabel::outside && !is_unreported(i, state)) ||
            (inside && model_weight(i, map_point_at(map_point_probability, i), options, state) >= Scalar(0.5));
        scratch.samples[i] = rests ? distances[i] : Scalar(no_distance<double>);
      }
      return fit_constraint(scratch.samples, options.fine.constraint, scratch.values);
    };
    FittedConstraint<Scalar> constraint{fit(false)};
    if (posterior && !constraint.fitted()) constraint.model = fit(true);
    const Scalar cs = statistical_confidence(pose.inliers, static_cast<Scalar>(options.fine.min_pose_inliers));
    constraint.confidence = cs * constraint.model.calculation_confidence;
    return constraint;
  }

  /// Sets the distances of all matches in scratch.projection and scratch.epipolar, and fits both constraints to them.
  template <typename Camera>
  void fit(const Camera& camera) {
    gather_matches();
    scratch.projection.resize(state.size());
    scratch.epipolar.resize(state.size());
    reprojection_distances(PointSpan<Scalar, 2>(scratch.points), span<const Scalar>(scratch.depths),
                           PointSpan<Scalar, 2>(state.current.keypoints), pose.T_cur_prev.template cast<Scalar>(),
                           camera, span<Scalar>(scratch.projection));
    projection = fit_to_static(scratch.projection);
    const bool alone = posterior && !projection.fitted();
    const bool moved = pose.T_cur_prev.translation.norm() > (alone ? 0 : options.fine.min_translation_m);
    if (moved) {
      measure_epipolar(camera);
      epipolar = fit_to_static(scratch.epipolar);
    }
    state.report.projection = projection.report();
    state.report.epipolar = epipolar.report();
    if (!moved) state.report.epipolar.status = Status::degenerate;
  }

  /// How visible a motion of way_px in the image is: 1 from D_Th on, (way_px / D_Th)^2 below.
  [[nodiscard]] Scalar visibility_of(Scalar way_px) const noexcept {
    const Scalar threshold_px = (projection.fitted() ? projection : epipolar).model.threshold_px;
    const Scalar share = way_px < threshold_px ? way_px / threshold_px : Scalar(1);
    return share * share;
  }

  /// Sets state.evidence of keypoint i, which is in a box: what the fine stage knows of it.
  const SecondStageKeypoint<Scalar>& gather_evidence(std::size_t i, Scalar way_at_metre_px) noexcept {
    const Scalar m = map_point_at(map_point_probability, i);
    const std::size_t b = static_cast<std::size_t>(state.box[i]);
    SecondStageKeypoint<Scalar>& keypoint = state.evidence[i];
    keypoint.projection = projection.evidence_at(scratch.projection[i]);
    keypoint.epipolar = epipolar.evidence_at(scratch.epipolar[i]);
    keypoint.object_probability = static_cast<Scalar>(state.objects[b].static_probability);
    keypoint.map_point_probability = m >= Scalar(0) ? m : Scalar(1);
    keypoint.foreground = state.label[i] == KeypointLabel::foreground;
    keypoint.matched = is_finite(scratch.points[i][0]) && is_finite(scratch.points[i][1]);
    keypoint.box_associated = posterior || state.boxes[b].associated;
    const bool seen = way_at_metre_px > Scalar(0) && is_valid_depth(scratch.depths[i]);
    keypoint.visibility = seen ? visibility_of(way_at_metre_px / scratch.depths[i]) : Scalar(1);
    return keypoint;
  }
};

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// Sets K of every keypoint in a box. In order: the distances d^T (reprojection_distances) and d^F
/// (epipolar_distances under F = K^-T [t]x R K^-1 with the camera matrix K, skipped for |t| <= t_Th: see
/// FineOptions::min_translation_m) of all matches; a
/// sigmoid for each from the keypoints outside all boxes; second_stage_probability for those inside. M is that of
/// before this frame, negative where there is no map point; empty for a host that keeps none. With
/// WeightRule::posterior a keypoint that neither constraint can judge (no match, depth or translation) gets 1/2, so
/// that its weight is what was known before; K counts only as far as a walker's motion would be visible at its depth
/// (FineOptions::least_speed_m_s); and a new box is treated as any other: the paper's K = 0 in it removes the wall in a
/// false box, while a false match is found by its distance anyway (examples/slam/WEIGHTS.md). If neither sigmoid has
/// enough samples, the coarse K stays; so it does for a pose that is not finite. O(keypoints).
template <typename Scalar, typename Camera>
void constrain_keypoints(const PoseEstimate& pose, span<const non_deduced<Scalar>> map_point_probability,
                         const Camera& camera, const FrameOptions& options, FrameState<Scalar>& state) {
  CFP_ASSERT(detail::fits(state.size(), map_point_probability));
  state.report.stage = Stage::fine;
  state.report.constrained = 0;
  if (!options.fine.enabled) return;
  detail::FrameConstraints<Scalar> constraints{pose, map_point_probability, options, state};
  constraints.fit(camera);
  if (!constraints.projection.fitted() && !constraints.epipolar.fitted()) return;

  state.evidence.resize(state.size());
  const Scalar threshold = static_cast<Scalar>(options.object_threshold);
  const Scalar way_at_metre_px =
      undistorted_camera(camera).fx * static_cast<Scalar>(options.fine.least_speed_m_s * detail::elapsed_s(state));
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.box[i] == no_box) continue;
    const SecondStageKeypoint<Scalar>& keypoint = constraints.gather_evidence(i, way_at_metre_px);
    state.static_probability[i] = constraints.posterior ? second_stage_evidence(keypoint, threshold)
                                                        : second_stage_probability(keypoint, threshold);
    ++state.report.constrained;
  }
}

}  // namespace CFP_ISA
}  // namespace cfp
