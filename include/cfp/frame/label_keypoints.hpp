/// @file label_keypoints.hpp
/// The step from boxes and depths to the coarse K of every keypoint (paper section IV-C): foreground and background of
/// each object, and K by the first stage's rule.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "cfp/clustering/depth_foreground.hpp"
#include "cfp/frame/estimate_objects.hpp"
#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/frame_state.hpp"
#include "cfp/probability/first_stage_probability.hpp"

namespace cfp {

namespace detail {
inline namespace CFP_ISA {

/// Collects the keypoints of one object in scratch.members. Returns whether a segmentation chose them.
template <typename Scalar>
bool collect_members(const Frame<Scalar>& frame, const TrackedBox<Scalar>& box, FrameState<Scalar>& state) {
  const bool by_index = !frame.object_of_keypoint.empty() && !box.compensated();
  state.scratch.members.clear();
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.label[i] == KeypointLabel::invalid) continue;
    const auto& [x, y] = state.current.keypoints[i];
    if (by_index ? frame.object_of_keypoint[i] == box.detection : lies_on(box, frame.labels, x, y))
      state.scratch.members.push_back(static_cast<std::int32_t>(i));
  }
  return by_index || (!frame.labels.empty() && !box.compensated());
}

/// Marks in scratch.mask which of the members lie on their object, and remembers its depth for the next frame. Returns
/// whether the depths could tell.
template <typename Scalar>
bool separate_foreground(const TrackedBox<Scalar>& box, const CoarseOptions& options, FrameState<Scalar>& state) {
  FrameScratch<Scalar>& scratch = state.scratch;
  if (state.current.depths.empty()) return false;
  scratch.depths.clear();
  scratch.points.clear();
  for (const std::int32_t i : scratch.members) {
    scratch.depths.push_back(state.current.depths[static_cast<std::size_t>(i)]);
    scratch.points.push_back(state.current.keypoints[static_cast<std::size_t>(i)]);
  }
  const ForegroundInput<Scalar> in{scratch.depths, scratch.points, box.box, remembered_depth(box, state)};
  const ForegroundResult result = depth_foreground(in, options.foreground, scratch.foreground, scratch.mask);
  if (result.status != ForegroundStatus::ok) return false;
  state.current.object_depths.push_back({box.id, static_cast<Scalar>(result.depth_m)});
  return true;
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// Sets K, label and box of every keypoint from state.boxes and state.objects. A keypoint on several objects takes the
/// smallest of their K, and that box decides for it from then on (ties: foreground before background, then the lower
/// index). Keypoints on no object keep K = 1. O(keypoints x boxes).
template <typename Scalar>
void label_keypoints(const Frame<Scalar>& frame, const FrameOptions& options, FrameState<Scalar>& state) {
  CFP_ASSERT(state.objects.size() == state.boxes.size());
  CFP_ASSERT(frame.object_of_keypoint.empty() || frame.object_of_keypoint.size() == state.size());
  FrameScratch<Scalar>& scratch = state.scratch;
  FrameReport& report = state.report;
  report.undecided_foregrounds = 0;
  scratch.members.reserve(state.size());
  scratch.depths.reserve(state.size());
  scratch.mask.reserve(state.size());
  const Scalar threshold = static_cast<Scalar>(options.object_threshold);
  for (std::size_t b = 0; b < state.boxes.size(); ++b) {
    const bool segmented = detail::collect_members(frame, state.boxes[b], state);
    scratch.mask.assign(scratch.members.size(), char(1));
    if (!segmented && is_non_rigid(state.boxes[b].class_id, options) && options.coarse.use_depth_foreground &&
        !detail::separate_foreground(state.boxes[b], options.coarse, state))
      ++report.undecided_foregrounds;

    const Scalar o = static_cast<Scalar>(state.objects[b].static_probability);
    const Scalar k_foreground = first_stage_probability(o, true, threshold);
    const Scalar k_background =
        options.coarse.soft_background ? first_stage_probability(o, false, threshold) : Scalar(1);
    for (std::size_t j = 0; j < scratch.members.size(); ++j) {
      const std::size_t i = static_cast<std::size_t>(scratch.members[j]);
      const bool foreground = scratch.mask[j] != 0;
      const Scalar k = foreground ? k_foreground : k_background;
      const bool lower = k < state.static_probability[i] || (k == state.static_probability[i] && foreground &&
                                                             state.label[i] == KeypointLabel::background);
      if (state.box[i] != no_box && !lower) continue;
      state.static_probability[i] = k;
      state.label[i] = foreground ? KeypointLabel::foreground : KeypointLabel::background;
      state.box[i] = static_cast<std::int32_t>(b);
    }
  }
  const auto count = [&](KeypointLabel label) {
    return static_cast<std::size_t>(std::count(state.label.begin(), state.label.end(), label));
  };
  report.outside = count(KeypointLabel::outside);
  report.foreground = count(KeypointLabel::foreground);
  report.background = count(KeypointLabel::background);
  report.invalid = count(KeypointLabel::invalid);
}

}  // namespace CFP_ISA
}  // namespace cfp
