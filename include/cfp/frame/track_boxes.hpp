/// @file track_boxes.hpp
/// The step from detections to the boxes of a frame (paper section IV-A): missed detections are compensated, and every
/// box knows whether its object had one in the frame before. Departure: predictions include the motion of the image.
#pragma once

#include <algorithm>
#include <cmath>

#include "cfp/detection/box_tracker.hpp"
#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/frame_state.hpp"
#include "cfp/geometry/image_motion.hpp"

namespace cfp {

namespace detail {
inline namespace CFP_ISA {

/// Sets state.image_motion: the host's, else that of the flow outside the boxes of the frame before, whose objects move
/// by themselves. 256 pairs are as good as all. Without such boxes nothing is estimated, as there is hardly anything to
/// predict.
template <typename Scalar>
void find_image_motion(const Frame<Scalar>& frame, FrameState<Scalar>& state) {
  CFP_ASSERT(frame.flow.previous.size() == frame.flow.current.size());
  state.image_motion = frame.image_motion;
  if (frame.image_motion || state.previous_boxes.empty()) return;
  FrameScratch<Scalar>& scratch = state.scratch;
  auto &from = scratch.undistorted_previous, &to = scratch.undistorted_current;  // free until the flow is judged
  from.clear();
  to.clear();
  const auto usable = [](Scalar x) { return std::abs(x) <= Scalar(box_farthest_px); };
  const std::size_t n = frame.flow.current.size(), step = (n + 255) / 256;
  for (std::size_t i = 0; i < n; i += step) {
    const Scalar x = frame.flow.previous(i, 0), y = frame.flow.previous(i, 1);
    const Scalar u = frame.flow.current(i, 0), v = frame.flow.current(i, 1);
    const auto holds = [&](const TrackedBox<Scalar>& box) { return contains(box.box, x, y); };
    if (!(usable(x) && usable(y) && usable(u) && usable(v))) continue;
    if (std::any_of(state.previous_boxes.begin(), state.previous_boxes.end(), holds)) continue;
    from.push_back({x, y});
    to.push_back({u, v});
  }
  Matrix3<Scalar> motion;
  if (image_motion(PointSpan<Scalar, 2>(from), PointSpan<Scalar, 2>(to), scratch.values, motion))
    state.image_motion = motion;
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// Sets state.boxes: what the tracker gives of the classes that can move. A frame whose detector did not run moves the
/// tracks and misses nothing. A time stamp that did not grow or is not finite is reported, and the boxes stay; so are
/// the frame after a first one of that kind, a gap that ended the tracks, and the number of improper detections.
template <typename Scalar>
void track_boxes(const Frame<Scalar>& frame, const FrameOptions& options, BoxTracker<Scalar>& tracker,
                 FrameState<Scalar>& state) {
  state.boxes.clear();
  state.image_motion.reset();
  if (!options.use_boxes) return;
  FrameReport& report = state.report;
  double dt = detail::elapsed_s(state);
  if (!is_finite(frame.timestamp_s) || (state.previous.known && !(dt > 0 && is_finite(dt)))) {
    report.time = Status::invalid_input;
    dt = 0;
  }
  detail::find_image_motion(frame, state);
  const Matrix3<Scalar>* const motion = state.image_motion ? &*state.image_motion : nullptr;
  const bool ran = frame.detections.has_value();
  const BoxTrackerResult<Scalar> tracked = ran ? tracker.track(*frame.detections, static_cast<Scalar>(dt), motion)
                                               : tracker.coast(static_cast<Scalar>(dt), motion);
  report.frames_since_detector = ran ? 0 : report.frames_since_detector + 1;
  report.after_gap = tracked.after_gap;
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
