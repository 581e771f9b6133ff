/// @file weigh_keypoints.hpp
/// The steps from K to the M of the host's map points and the weight of every observation (paper section IV-D). Whole
/// frames and single keypoints share the rules.
#pragma once

#include <algorithm>
#include <array>

#include "cfp/core/span.hpp"
#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/frame_state.hpp"
#include "cfp/frame/object_members_impl.hpp"
#include "cfp/probability/first_stage_probability.hpp"
#include "cfp/probability/map_point.hpp"
#include "cfp/probability/second_stage_probability.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// Whether a keypoint is outside all boxes but the flow around it moves: something that no detector reported.
template <typename Scalar>
[[nodiscard]] bool is_unreported(std::size_t i, const FrameState<Scalar>& state) noexcept {
  return state.box[i] == no_box && state.flow_probability[i] >= Scalar(0);
}

/// Whether a keypoint is on an object that may move, reported or not.
template <typename Scalar>
[[nodiscard]] bool is_on_object(std::size_t i, const FrameState<Scalar>& state) noexcept {
  return state.label[i] == KeypointLabel::foreground || is_unreported(i, state);
}

/// Whether keypoint i is background in more than one box. Where boxes overlap, depth takes the nearer object for that
/// of both, so the keypoint may lie on the farther one.
template <typename Scalar>
[[nodiscard]] bool is_behind_two(std::size_t i, const FrameState<Scalar>& state) noexcept {
  if (state.label[i] != KeypointLabel::background) return false;
  const std::array<Scalar, 2>& at = state.current.keypoints[i];
  const auto holds = [&](const TrackedBox<Scalar>& box) { return contains(box.box, at[0], at[1]); };
  return std::count_if(state.boxes.begin(), state.boxes.end(), holds) > 1;
}

/// Whether the depth of keypoint i places it on an object of known O. The label is not enough: without depths, and in
/// boxes of rigid classes, the wall is foreground, too.
template <typename Scalar>
[[nodiscard]] bool is_placed(std::size_t i, const FrameOptions& options, const FrameState<Scalar>& state) noexcept {
  if (state.label[i] != KeypointLabel::foreground || i >= state.current.depths.size()) return false;
  const auto b = static_cast<std::size_t>(state.box[i]);
  return detail::is_told_by_depth(state.boxes[b], options) && is_valid_depth(state.current.depths[i]) &&
         state.objects[b].status == Status::ok;
}

/// E of keypoint i: first_stage_evidence of the flow at its place and of its object; 1/2 on none.
template <typename Scalar>
[[nodiscard]] Scalar first_stage_evidence(std::size_t i, const FrameOptions& options,
                                          const FrameState<Scalar>& state) noexcept {
  const double o =
      state.box[i] != no_box ? state.objects[static_cast<std::size_t>(state.box[i])].static_probability : 1;
  return static_cast<Scalar>(first_stage_evidence(static_cast<double>(state.flow_probability[i]), o,
                                                  state.label[i] == KeypointLabel::foreground, options.object_threshold,
                                                  is_placed(i, options, state)));
}

/// M of a new map point on the object of keypoint i: its class's, or that of any object.
template <typename Scalar>
[[nodiscard]] double foreground_prior(std::size_t i, const FrameOptions& options,
                                      const FrameState<Scalar>& state) noexcept {
  const double of_any = options.map_point.foreground_prior;
  if (state.box[i] == no_box) return of_any;
  const auto* const known = find_class(state.boxes[static_cast<std::size_t>(state.box[i])].class_id, options);
  return known != nullptr ? known->prior.value_or(of_any) : of_any;
}

/// M of a new map point that keypoint i observes. 1 outside all boxes where nothing moves, and by the printed rules.
/// Otherwise the prior of its label (that of an object if it is_behind_two), raised by evidence for static.
template <typename Scalar>
[[nodiscard]] Scalar unknown_map_point(std::size_t i, const FrameOptions& options,
                                       const FrameState<Scalar>& state) noexcept {
  const MapPointOptions& o = options.map_point;
  const bool on_object = is_on_object(i, state) || is_behind_two(i, state);
  if (o.weight != WeightRule::posterior || (state.box[i] == no_box && !on_object)) return Scalar(1);
  const Scalar e = (std::max)(first_stage_evidence(i, options, state), Scalar(0.5));
  const double prior = on_object ? foreground_prior(i, options, state) : o.background_prior;
  return posterior_probability(Scalar(0.5), e, Scalar(prior), o);
}

/// The weight by Bayes' rule, before any fallback. Outside all boxes it is M. Inside a box, and where it is_unreported,
/// E can only lower it, because what rests may move in the next frame; K counts, limited by keypoint_evidence, once the
/// constraints were evaluated.
template <typename Scalar>
[[nodiscard]] Scalar posterior_weight(std::size_t i, non_deduced<Scalar> map_point_probability,
                                      const FrameOptions& options, const FrameState<Scalar>& state) noexcept {
  const Scalar m =
      map_point_probability >= Scalar(0) ? Scalar(map_point_probability) : unknown_map_point(i, options, state);
  if (state.label[i] == KeypointLabel::invalid) return Scalar(0);
  if (state.box[i] == no_box && !is_unreported(i, state)) return clamp_probability(m);
  const Scalar e = (std::min)(first_stage_evidence(i, options, state), Scalar(0.5));
  const Scalar k = keypoint_evidence(state.static_probability[i], e, is_on_object(i, state));
  return posterior_probability(state.report.constrained > 0 ? k : Scalar(0.5), e, m, options.map_point);
}

/// Whether WeightRule::product rejects the observation because K and M are too far apart. Not in the coarse stage,
/// where K is too rough and a foreground point's 0 says nothing about its match.
template <typename Scalar>
[[nodiscard]] bool is_mismatched(std::size_t i, non_deduced<Scalar> map_point_probability, const FrameOptions& options,
                                 const FrameState<Scalar>& state) noexcept {
  return options.map_point.weight != WeightRule::posterior && state.report.stage == Stage::fine &&
         map_point_probability >= Scalar(0) &&
         is_mismatch(state.static_probability[i], map_point_probability, options.map_point);
}

/// The weight of keypoint i for a map point of probability M (negative or NaN: none), before any fallback:
/// posterior_weight or, by the printed rules, K without a map point, K and M with one, 0 for a mismatch.
template <typename Scalar>
[[nodiscard]] Scalar model_weight(std::size_t i, non_deduced<Scalar> map_point_probability, const FrameOptions& options,
                                  const FrameState<Scalar>& state) noexcept {
  CFP_ASSERT(i < state.size());
  if (options.map_point.weight == WeightRule::posterior)
    return posterior_weight(i, map_point_probability, options, state);
  const Scalar k = state.static_probability[i];
  if (!(map_point_probability >= Scalar(0))) return k;
  if (is_mismatched(i, map_point_probability, options, state)) return Scalar(0);
  return observation_weight(k, map_point_probability);
}

/// Whether the frame's fallback raises the weight of keypoint i: of those that observe a map point, with M, or of all
/// where the host keeps none.
template <typename Scalar>
[[nodiscard]] bool is_raised(std::size_t i, non_deduced<Scalar> map_point_probability,
                             const FrameState<Scalar>& state) noexcept {
  return (map_point_probability >= Scalar(0) || state.all_observe) &&
         is_raised(state.label[i], state.report.health.fallback);
}

/// The weight of keypoint i for a map point of probability M, the frame's fallback included.
template <typename Scalar>
[[nodiscard]] Scalar keypoint_weight(std::size_t i, non_deduced<Scalar> map_point_probability,
                                     const FrameOptions& options, const FrameState<Scalar>& state) noexcept {
  CFP_ASSERT(i < state.size());
  return is_raised(i, map_point_probability, state) ? Scalar(1)
                                                    : model_weight(i, map_point_probability, options, state);
}

/// M of the map point that keypoint i observes, after this frame. It is updated by K once the constraints were
/// evaluated and, with WeightRule::posterior, by moving flow at the keypoint, which also limits K (keypoint_evidence);
/// never by its object. A negative or NaN M (no map point) is returned as it is; a keypoint without a finite pixel
/// changes nothing.
template <typename Scalar>
[[nodiscard]] Scalar updated_map_point(std::size_t i, non_deduced<Scalar> map_point_probability,
                                       const FrameOptions& options, const FrameState<Scalar>& state) noexcept {
  CFP_ASSERT(i < state.size());
  if (!(map_point_probability >= Scalar(0))) return map_point_probability;
  const bool silent =
      state.label[i] == KeypointLabel::invalid ||
      (options.map_point.weight == WeightRule::posterior && state.box[i] != no_box && state.report.constrained == 0);
  if (state.report.stage != Stage::fine || silent) return clamp_probability(map_point_probability);
  Scalar k = state.static_probability[i];
  if (options.map_point.weight == WeightRule::posterior && state.flow_probability[i] >= Scalar(0)) {
    const Scalar e = (std::min)(first_stage_evidence(i, options, state), Scalar(0.5));
    k = keypoint_evidence(k, e, is_on_object(i, state));
    k = posterior_probability(Scalar(0.5), e, k, options.map_point);
  }
  return updated_map_point(k, map_point_probability, options.map_point);
}

/// M of every map point after this frame, in place: the last step of a frame, since its weights have M of before as
/// their prior.
template <typename Scalar>
void update_map_points(const FrameOptions& options, FrameState<Scalar>& state,
                       span<non_deduced<Scalar>> map_point_probability) noexcept {
  CFP_ASSERT(map_point_probability.size() == state.size());
  state.report.deletable = 0;
  for (std::size_t i = 0; i < state.size(); ++i) {
    Scalar& m = map_point_probability[i];
    m = updated_map_point(i, m, options, state);
    if (m >= Scalar(0) && is_deletable(m, options.map_point)) ++state.report.deletable;
  }
}

/// Sets the weight of every keypoint, and with too few effective observations raises them (apply_fallback).
/// map_point_probability may be empty, for a host that keeps none: every keypoint then counts as an observation.
template <typename Scalar>
void weigh_keypoints(span<const non_deduced<Scalar>> map_point_probability, const FrameOptions& options,
                     FrameState<Scalar>& state) noexcept {
  CFP_ASSERT(detail::fits(state.size(), map_point_probability));
  state.report.mismatched = 0;
  state.all_observe = map_point_probability.empty();
  for (std::size_t i = 0; i < state.size(); ++i) {
    const Scalar m = detail::map_point_at(map_point_probability, i);
    state.weight[i] = model_weight(i, m, options, state);
    if (is_mismatched(i, m, options, state)) ++state.report.mismatched;
  }
  const span<const Scalar> observed =
      map_point_probability.empty() ? span<const Scalar>(state.weight) : map_point_probability;
  state.report.health =
      apply_fallback(span<const KeypointLabel>(state.label), observed, span<Scalar>(state.weight), options.health);
}

/// Whether a keypoint with this K may become a map point: a moving one would corrupt the map.
template <typename Scalar>
[[nodiscard]] bool may_create_map_point(Scalar keypoint_probability, const FrameOptions& options) noexcept {
  return static_cast<double>(keypoint_probability) >= options.min_creation_probability;
}

/// Whether an inlier of this weight should count when a host asks how many its pose rests on (mnMatchesInliers).
template <typename Scalar>
[[nodiscard]] bool counts_as_inlier(Scalar weight, const FrameOptions& options) noexcept {
  return carries_pose(static_cast<double>(weight), options.health);
}

}  // namespace CFP_ISA
}  // namespace cfp
