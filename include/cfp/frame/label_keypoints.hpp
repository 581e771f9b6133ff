/// @file label_keypoints.hpp
/// The step from boxes and depths to the coarse K of every keypoint (paper section IV-C): foreground and background of
/// each object, and K by the first stage's rule; also the flow score at each keypoint, inside boxes and outside.
#pragma once

#include <algorithm>
#include <cmath>

#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/frame_state.hpp"
#include "cfp/frame/object_members_impl.hpp"
#include "cfp/frame/point_grid_impl.hpp"
#include "cfp/frame/unreported_impl.hpp"
#include "cfp/frame/weigh_keypoints.hpp"
#include "cfp/probability/first_stage_probability.hpp"

namespace cfp {

namespace detail {
inline namespace CFP_ISA {

/// Sets state.flow_probability: the score of the flow pair next to the keypoint, among the pairs in its box and, where
/// both have one, at its depth: a pair beside a person's silhouette is not on him. If an object's pairs reveal its
/// motion only by their common shift, no single pair may show it static: the score is then at most
/// ObjectProbability::together. After estimate_objects.
template <typename Scalar>
void score_flow_at_keypoints(const Frame<Scalar>& frame, const FrameOptions& options, FrameState<Scalar>& state) {
  const Scalar radius_px = static_cast<Scalar>(options.coarse.flow_radius_px);
  if (radius_px <= 0 || state.report.flow_model == FlowModelKind::none || state.boxes.empty()) return;
  const ObjectProbabilityOptions scored = scaled_to_flow(options.coarse.object, state.report);
  const Scalar depth_share = static_cast<Scalar>(options.coarse.unreported.depth_share);
  PointGrid<Scalar>& grid = state.scratch.grid;
  const auto is_known = [&](std::size_t p) { return has_distance(state.flow_distances[p]); };
  const FlowPairs<Scalar> flow = flow_with_depths(frame, state);
  fill_grid(flow.current, is_known, radius_px, grid);
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.box[i] == no_box) continue;
    const Box<Scalar>& box = state.boxes[static_cast<std::size_t>(state.box[i])].box;
    const auto& [x, y] = state.current.keypoints[i];
    const Scalar depth = state.current.depths.empty() ? Scalar(0) : state.current.depths[i];
    const std::size_t pair = nearest(grid, x, y, state.flow_distances.size(), [&](const auto& p) {
      const Scalar its = flow.depth(p.index);
      const bool apart = is_valid_depth(depth) && is_valid_depth(its) && std::abs(its - depth) > depth_share * depth;
      return contains(box, p.x, p.y) && !apart;
    });
    if (pair >= state.flow_distances.size()) continue;
    Scalar score = object_score(state.flow_distances[pair], scored);
    if (is_placed(i, options, state))
      score = (std::min)(score, static_cast<Scalar>(state.objects[static_cast<std::size_t>(state.box[i])].together));
    state.flow_probability[i] = score;
  }
}

/// Gives the members of box b, foreground where scratch.mask marks them, to its object: see label_keypoints.
template <typename Scalar>
void label_members(std::size_t b, const FrameOptions& options, FrameState<Scalar>& state) noexcept {
  const FrameScratch<Scalar>& scratch = state.scratch;
  const Scalar threshold = static_cast<Scalar>(options.object_threshold);
  const Scalar o = static_cast<Scalar>(state.objects[b].static_probability);
  const Scalar k_foreground = first_stage_probability(o, true, threshold);
  const Scalar k_background = options.coarse.soft_background ? first_stage_probability(o, false, threshold) : Scalar(1);
  for (std::size_t j = 0; j < scratch.members.size(); ++j) {
    const std::size_t i = static_cast<std::size_t>(scratch.members[j]);
    const bool foreground = scratch.mask[j] != 0;
    const Scalar k = foreground ? k_foreground : k_background;
    const bool lower = k < state.static_probability[i] ||
                       (k == state.static_probability[i] && foreground && state.label[i] == KeypointLabel::background);
    if (state.box[i] != no_box && !lower) continue;
    state.static_probability[i] = k;
    state.label[i] = foreground ? KeypointLabel::foreground : KeypointLabel::background;
    state.box[i] = static_cast<std::int32_t>(b);
  }
}

/// The detection that object_of_keypoint or the mask at its pixel names for keypoint i; negative: none.
template <typename Scalar>
[[nodiscard]] std::int32_t detection_of_keypoint(std::size_t i, const Frame<Scalar>& frame,
                                                 const FrameState<Scalar>& state) noexcept {
  const auto& [x, y] = state.current.keypoints[i];
  if (state.label[i] == KeypointLabel::invalid) return no_object;
  return frame.object_of_keypoint.empty() ? label_at(frame.labels, x, y) - 1 : frame.object_of_keypoint[i];
}

/// Adds what lies in the box of an object and on no object's mask to scratch.members, as its background: what a
/// detection covers that is no object, of another class or skipped, may be part of this one (a bag on a back).
template <typename Scalar, typename DetectionAt>
void take_what_masks_leave_out(const Box<Scalar>& box, const DetectionAt& detection_at, FrameState<Scalar>& state) {
  for (std::size_t i = 0; i < state.size(); ++i) {
    const auto& [x, y] = state.current.keypoints[i];
    if (!contains(box, x, y)) continue;
    const std::int32_t detection = detection_at(i);
    const auto is_its_own = [&](const TrackedBox<Scalar>& b) { return b.detection == detection; };
    if (detection >= 0 && std::any_of(state.boxes.begin(), state.boxes.end(), is_its_own)) continue;
    state.scratch.members.push_back(static_cast<std::int32_t>(i));
    state.scratch.mask.push_back(char(0));
  }
}

/// How many keypoints are said to lie on a detection that the frame has not, or lie beside the mask.
template <typename Scalar>
[[nodiscard]] std::size_t stray_labels(const Frame<Scalar>& frame, const FrameState<Scalar>& state) noexcept {
  const std::size_t detections = frame.detections ? frame.detections->size() : 0;
  const bool by_mask = frame.object_of_keypoint.empty();
  if (by_mask && frame.labels.empty()) return 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.label[i] == KeypointLabel::invalid) continue;
    const auto& [x, y] = state.current.keypoints[i];
    const std::int32_t detection = detection_of_keypoint(i, frame, state);
    const bool unnamed = detection >= 0 && static_cast<std::size_t>(detection) >= detections;
    count += unnamed || (by_mask && !contains(frame.labels, x, y)) ? 1U : 0U;
  }
  return count;
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// Sets K, label and box of every keypoint from state.boxes and state.objects. A keypoint on several objects takes the
/// smallest of their K, and belongs to that box from then on (ties: foreground before background, then the lower
/// index). Keypoints on no object keep K = 1. If a mask or object_of_keypoint names keypoints of an object, these are
/// its foreground, depth only gives its distance, and keypoints in its box on no object's mask are background: masks
/// miss hands and feet, which the flow there reveals (cfp_posterior_study). In a box without named keypoints depth
/// decides. O(keypoints x boxes), and flow pairs near each keypoint. Outside boxes see UnreportedOptions.
template <typename Scalar>
void label_keypoints(const Frame<Scalar>& frame, const FrameOptions& options, FrameState<Scalar>& state) {
  CFP_ASSERT(state.objects.size() == state.boxes.size());
  CFP_ASSERT(detail::fits(state.size(), frame.object_of_keypoint));
  FrameReport& report = state.report;
  report.undecided_foregrounds = 0;
  const bool named = !frame.labels.empty() || !frame.object_of_keypoint.empty();
  const auto detection_at = [&](std::size_t i) { return detail::detection_of_keypoint(i, frame, state); };
  for (std::size_t b = 0; b < state.boxes.size(); ++b) {
    const TrackedBox<Scalar>& box = state.boxes[b];
    const bool by_depth = detail::is_told_by_depth(box, options);
    const auto [by_mask, separated] =
        detail::find_members(box, PointSpan<Scalar, 2>(state.current.keypoints),
                             by_depth ? span<const Scalar>(state.current.depths) : span<const Scalar>(), named,
                             detection_at, options, state);
    if (separated.status == ForegroundStatus::ok)
      state.current.object_depths.push_back({box.id, static_cast<Scalar>(separated.depth_m)});
    else if (by_depth && !by_mask)
      ++report.undecided_foregrounds;
    if (by_mask) {
      std::fill(state.scratch.mask.begin(), state.scratch.mask.end(), char(1));
      detail::take_what_masks_leave_out(box.box, detection_at, state);
    }
    detail::label_members(b, options, state);
  }
  report.stray_labels = detail::stray_labels(frame, state);
  detail::score_flow_at_keypoints(frame, options, state);
  detail::UnreportedSearch<Scalar>{detail::flow_with_depths(frame, state), options, state}.score_keypoints();
  // In the order of KeypointLabel.
  std::size_t* const counts[] = {&report.outside, &report.foreground, &report.background, &report.invalid};
  for (std::size_t* const count : counts) *count = 0;
  for (const KeypointLabel label : state.label) ++*counts[static_cast<std::size_t>(label)];
}

}  // namespace CFP_ISA
}  // namespace cfp
