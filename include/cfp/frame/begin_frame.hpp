/// @file begin_frame.hpp
/// The first step: the new frame is copied in, and what was the current frame becomes the previous one.
#pragma once

#include <algorithm>
#include <utility>

#include "cfp/frame/frame_state.hpp"

namespace cfp {

namespace detail {
inline namespace CFP_ISA {

/// Copies what the next frame has to know. A time stamp that is not finite leaves the clock where it was.
template <typename Scalar>
void copy_frame(const Frame<Scalar>& frame, const FrameMemory<Scalar>& previous, FrameMemory<Scalar>& current) {
  current.known = false;  // until it is whole: what allocates may throw
  const bool stamped = is_finite(frame.timestamp_s) || !previous.known;
  current.timestamp_s = stamped ? frame.timestamp_s : previous.timestamp_s;
  current.object_depths.clear();
  current.motion = {};
  current.shared_error_sq = previous.known ? previous.shared_error_sq : std::nullopt;
  current.keypoints.resize(frame.keypoints.size());
  for (std::size_t i = 0; i < frame.keypoints.size(); ++i)
    current.keypoints[i] = {frame.keypoints(i, 0), frame.keypoints(i, 1)};
  current.depths.assign(frame.depths.begin(), frame.depths.end());
  const std::size_t bytes = current.descriptor_bytes = frame.descriptors.bytes;
  current.descriptors.resize(frame.descriptors.size * bytes);
  for (std::size_t i = 0; i < frame.descriptors.size; ++i)
    std::copy_n(frame.descriptors.row(i), bytes, current.descriptors.data() + i * bytes);
}

/// A box may hold all that the frame has, or none of it.
template <typename Scalar>
void reserve_scratch(std::size_t most, FrameScratch<Scalar>& scratch) {
  const auto reserve = [most](auto&... memory) { (memory.reserve(most), ...); };
  reserve(scratch.members, scratch.mask, scratch.points, scratch.undistorted_previous, scratch.undistorted_current,
          scratch.depths, scratch.samples, scratch.values, scratch.foreground, scratch.flow.distances);
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// No keypoint is in a box yet. Nothing has to be done for a frame before whose pose failed or threw.
template <typename Scalar>
void begin_frame(const Frame<Scalar>& frame, FrameState<Scalar>& state) {
  const std::size_t n = frame.keypoints.size();
  CFP_ASSERT(detail::fits(n, frame.depths));
  CFP_ASSERT(frame.descriptors.size == 0 || frame.descriptors.size == n);
  CFP_ASSERT(frame.descriptors.size == 0 || frame.descriptors.row_bytes >= frame.descriptors.bytes);
  CFP_ASSERT(frame.labels.empty() || frame.labels.row_bytes >= static_cast<std::size_t>(frame.labels.width));
  std::swap(state.previous, state.current);
  detail::copy_frame(frame, state.previous, state.current);
  state.static_probability.resize(n);
  state.label.resize(n);
  state.box.assign(n, no_box);
  state.match.assign(n, no_match);
  state.flow_probability.assign(n, Scalar(-1));
  state.flow_depths.clear();
  state.flow_distances.clear();
  for (std::size_t i = 0; i < n; ++i) {
    const auto& [x, y] = state.current.keypoints[i];
    const bool valid = is_finite(x) && is_finite(y);
    state.static_probability[i] = valid ? Scalar(1) : Scalar(0);
    state.label[i] = valid ? KeypointLabel::outside : KeypointLabel::invalid;
  }
  state.weight = state.static_probability;
  detail::reserve_scratch((std::max)(n, frame.flow.current.size()), state.scratch);
  if (!state.previous.known) {
    state.boxes.clear();
    state.report = {};
  }
  std::swap(state.previous_boxes, state.boxes);
  state.boxes.clear();
  state.objects.clear();
  FrameReport report;
  report.frames_without_detections = state.report.frames_without_detections;
  report.frames_since_detector = state.report.frames_since_detector;
  state.report = report;
  state.current.known = true;
}

}  // namespace CFP_ISA
}  // namespace cfp
