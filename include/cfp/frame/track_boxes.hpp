/// @file track_boxes.hpp
/// The step from detections to the boxes of a frame (paper section IV-A): missed detections are compensated, and every
/// box knows whether its object had one in the frame before.
#pragma once

#include <algorithm>

#include "cfp/detection/box_tracker.hpp"
#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/frame_state.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// Sets state.boxes: what the tracker gives of the classes that can move. A frame whose detector did not run moves the
/// tracks and misses nothing. A time stamp that did not grow or is not finite is reported, and the boxes stay; so is
/// the frame after a first one of that kind, a gap that ended the tracks, and how many detections were none.
template <typename Scalar>
void track_boxes(const Frame<Scalar>& frame, const FrameOptions& options, BoxTracker<Scalar>& tracker,
                 FrameState<Scalar>& state) {
  state.boxes.clear();
  if (!options.use_boxes) return;
  FrameReport& report = state.report;
  double dt = detail::elapsed_s(state);
  if (!is_finite(frame.timestamp_s) || (state.previous.known && !(dt > 0 && is_finite(dt)))) {
    report.time = Status::invalid_input;
    dt = 0;
  }
  const Matrix3<Scalar>* const motion = frame.image_motion ? &*frame.image_motion : nullptr;
  const bool ran = frame.detections.has_value();
  const BoxTrackerResult<Scalar> tracked = ran ? tracker.track(*frame.detections, static_cast<Scalar>(dt), motion)
                                               : tracker.coast(static_cast<Scalar>(dt), motion);
  report.frames_since_detector = ran ? 0 : report.frames_since_detector + 1;
  report.after_gap = dt > options.tracker.max_gap_s;
  report.skipped_detections = tracked.skipped;
  const bool blind = ran && frame.detections->size() == tracked.skipped;
  if (ran) report.frames_without_detections = blind ? report.frames_without_detections + 1 : 0;
  const auto is_other = [&](const auto& object) { return find_class(object.class_id, options) == nullptr; };
  if (ran)
    report.other_detections =
        static_cast<std::size_t>(std::count_if(frame.detections->begin(), frame.detections->end(), is_other));
  std::remove_copy_if(tracked.boxes.begin(), tracked.boxes.end(), std::back_inserter(state.boxes), is_other);
}

}  // namespace CFP_ISA
}  // namespace cfp
