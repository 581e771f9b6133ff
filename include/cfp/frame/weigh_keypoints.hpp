/// @file weigh_keypoints.hpp
/// The steps from K to what a host keeps and uses (paper section IV-D): M of its map points, and the weight of every
/// observation. The rules stand here once, for whole frames and for single keypoints alike.
#pragma once

#include <cstddef>

#include "cfp/core/span.hpp"
#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/frame_state.hpp"
#include "cfp/probability/map_point.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// M of the map point that keypoint i observes, after this frame. No map point (M negative or NaN) stays none, and a
/// keypoint without a pixel says nothing.
template <typename Scalar>
[[nodiscard]] Scalar updated_map_point(std::size_t i, non_deduced<Scalar> map_point_probability,
                                       const FrameOptions& options, const FrameState<Scalar>& state) noexcept {
  if (!(map_point_probability >= Scalar(0)) || state.label[i] == KeypointLabel::invalid) return map_point_probability;
  return updated_map_point(state.static_probability[i], map_point_probability, options.map_point);
}

/// The weight of keypoint i for a map point of probability M, before any fallback: K without a map point (M negative or
/// NaN), K and M by MapPointOptions::weight with one. In the fine stage a mismatch (K and M too far apart) gets 0; in
/// the coarse stage K is too rough for that, and a foreground point's 0 says nothing of its match.
template <typename Scalar>
[[nodiscard]] Scalar model_weight(std::size_t i, non_deduced<Scalar> map_point_probability, const FrameOptions& options,
                                  const FrameState<Scalar>& state) noexcept {
  const Scalar k = state.static_probability[i];
  if (!(map_point_probability >= Scalar(0))) return k;
  if (state.report.stage == Stage::fine && is_mismatch(k, map_point_probability, options.map_point)) return Scalar(0);
  return observation_weight(k, map_point_probability, options.map_point.weight);
}

/// The weight of keypoint i for a map point of probability M, the frame's fallback included.
template <typename Scalar>
[[nodiscard]] Scalar keypoint_weight(std::size_t i, non_deduced<Scalar> map_point_probability,
                                     const FrameOptions& options, const FrameState<Scalar>& state) noexcept {
  return map_point_probability >= Scalar(0) && is_raised(state.label[i], state.report.health.fallback)
             ? Scalar(1)
             : model_weight(i, map_point_probability, options, state);
}

/// M of every map point after this frame, in place.
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
template <typename Scalar>
void weigh_keypoints(span<const non_deduced<Scalar>> map_point_probability, const FrameOptions& options,
                     FrameState<Scalar>& state) noexcept {
  CFP_ASSERT(map_point_probability.size() == state.size());
  state.report.mismatched = 0;
  for (std::size_t i = 0; i < state.size(); ++i) {
    const Scalar m = map_point_probability[i];
    state.weight[i] = model_weight(i, m, options, state);
    if (state.report.stage == Stage::fine && m >= Scalar(0) &&
        is_mismatch(state.static_probability[i], m, options.map_point))
      ++state.report.mismatched;
  }
  state.report.health = apply_fallback(span<const KeypointLabel>(state.label), map_point_probability,
                                       span<Scalar>(state.weight), options.health);
}

/// Whether a keypoint with this K may make a map point: one that moves would be a landmark that walks.
template <typename Scalar>
[[nodiscard]] bool may_create_map_point(Scalar keypoint_probability, const FrameOptions& options) noexcept {
  return static_cast<double>(keypoint_probability) >= options.min_creation_probability;
}

/// Whether an inlier of this weight should count when a host asks how many its pose rests on (mnMatchesInliers).
template <typename Scalar>
[[nodiscard]] bool counts_as_inlier(Scalar weight, const FrameOptions& options) noexcept {
  return static_cast<double>(weight) > options.min_inlier_weight;
}

}  // namespace CFP_ISA
}  // namespace cfp
