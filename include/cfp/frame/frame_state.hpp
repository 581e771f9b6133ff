/// @file frame_state.hpp
/// Everything that the steps know of a frame and of the one before it: the only state that they read and write.
/// Per-keypoint arrays have the size and order of the frame's keypoints.
#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include "cfp/clustering/depth_foreground.hpp"
#include "cfp/core/status.hpp"
#include "cfp/frame/flow_model_types.hpp"
#include "cfp/frame/frame.hpp"
#include "cfp/frame/health.hpp"
#include "cfp/probability/object.hpp"
#include "cfp/probability/second_stage_probability.hpp"

namespace cfp {

enum class Stage : std::uint8_t { coarse, fine };

/// What a constraint was fitted to in this frame.
struct ConstraintReport {
  Status status = Status::not_enough_data;  ///< not_enough_data: it was not fitted; degenerate: it is a step, or,
                                            ///< with a confidence of 0, |t| was at or below t_Th
  double threshold_px = 0;                  ///< D_Th
  double confidence = 0;                    ///< C_s C_c
};

/// Diagnostics of a frame, step by step.
struct FrameReport {
  Stage stage = Stage::coarse;  ///< fine: the constraints were evaluated
  // boxes
  Status time = Status::ok;                   ///< invalid_input: the time stamp did not grow, and the boxes stayed
  bool after_gap = false;                     ///< of more than tracker.max_gap_s: all tracks ended (stamps in seconds?)
  std::size_t frames_without_detections = 0;  ///< in a row, with the detector running: the commonest cause of no effect
  std::size_t frames_since_detector = 0;      ///< on which the detector did not run
  std::size_t skipped_detections = 0;         ///< improper boxes (x y w h?), or a score that is NaN: as if not there
  std::size_t other_detections = 0;           ///< of classes that FrameOptions::classes does not name: ignored
  // objects
  FlowModelKind flow_model = FlowModelKind::none;            ///< what the flow pairs were judged by,
  FlowSupport flow_support = FlowSupport::none;              ///< what that rests on,
  RansacStatus flow_status = RansacStatus::not_enough_data;  ///< and how its estimation ended
  bool motion_refused = false;      ///< T_cur_prev: not finite, or the flow contradicts it or its covariance
  double flow_sigma_px = 0;         ///< noise of the flow as measured; 0: not
  double flow_shared_px = 0;        ///< error shared by neighbouring pairs, besides the noise; 0: unknown
  int flow_coordinates = 2;         ///< degrees of freedom of most distances: 1 across lines
  std::size_t unknown_objects = 0;  ///< boxes whose O is not known
  // keypoints
  std::size_t outside = 0, foreground = 0, background = 0, invalid = 0;  ///< by label
  std::size_t stray_labels = 0;  ///< keypoints whose mask or object_of_keypoint names no detection of the frame, and
                                 ///< those beyond the mask (is it of a smaller image?)
  std::size_t unreported = 0;    ///< keypoints on no object around which the flow moves: see UnreportedOptions
  std::size_t undecided_foregrounds = 0;  ///< boxes that the depths could not separate: all inside is foreground
  // constraints
  ConstraintReport projection, epipolar;
  std::size_t matched_in_boxes = 0;      ///< keypoints that the descriptors matched
  std::size_t unmatched_foreground = 0;  ///< foreground keypoints without a match in the frame before
  std::size_t constrained = 0;           ///< keypoints in boxes whose K the constraints have set
  // map points and weights
  std::size_t mismatched = 0;  ///< observations left out because K and M differ too much
  std::size_t deletable = 0;   ///< map points whose M fell below the deletion threshold: is_deletable(M)
  FrameHealth health;          ///< of the weights, fallback included
};

/// A value that belongs to the object of a track.
template <typename T>
struct OfTrack {
  std::int64_t id = 0;  ///< of the track
  T value{};
};

/// What is kept of a frame for the next one.
template <typename Scalar>
struct FrameMemory {
  bool known = false;  ///< false: there was no such frame
  double timestamp_s = 0;
  std::vector<std::array<Scalar, 2>> keypoints;
  std::vector<Scalar> depths;                  ///< empty: none
  std::vector<OfTrack<Scalar>> object_depths;  ///< where the foregrounds stood that the depths could separate: median
  std::vector<std::uint8_t> descriptors;       ///< one after the other; empty: none
  std::size_t descriptor_bytes = 0;            ///< of each
  TimedMotion<double> motion;                  ///< of the camera until then, by the flow's depths
  std::optional<double> shared_error_sq;       ///< px^2: what pairs with depth erred by together until then, mean

  [[nodiscard]] DescriptorSpan descriptor_view() const noexcept {
    return {descriptors.data(), descriptors.empty() ? 0 : keypoints.size(), descriptor_bytes, descriptor_bytes};
  }
};

namespace detail {

/// Where a flow pair lies relative to the object of a box.
enum class PairLabel : std::uint8_t {
  outside,     // not in its box
  foreground,  // on the object
  background,  // behind it
  undecided    // before it, or where box, mask or depth end: it may be on it, or on somebody else
};

}  // namespace detail

/// Scratch memory of the steps.
template <typename Scalar>
struct FrameScratch {
  FlowModelWorkspace<Scalar> flow;
  ForegroundWorkspace<Scalar> foreground;
  DescriptorMatchWorkspace<Scalar> matching;
  detail::PointGrid<Scalar> grid, resting;
  std::vector<std::array<Scalar, 2>> points, undistorted_previous, undistorted_current, straight;
  std::vector<Scalar> depths, projection, epipolar, samples, values, room_distances, object_distances, relative_sigmas;
  std::vector<std::int32_t> members;
  std::vector<char> mask, outside;
  std::vector<detail::PairLabel> pair_label;  // per box and flow pair
  std::vector<OfTrack<ObjectMemory>> memories;
};

/// Reused from frame to frame: after the largest frame has been seen, the steps allocate nothing.
template <typename Scalar>
struct FrameState {
  FrameMemory<Scalar> previous, current;
  std::vector<TrackedBox<Scalar>> boxes;              ///< of objects that can move: detected and compensated
  std::vector<TrackedBox<Scalar>> previous_boxes;     ///< the same of the frame before
  std::optional<Matrix3<Scalar>> image_motion;        ///< that moved the predicted boxes; not set: none
  std::vector<ObjectProbability> objects;             ///< O, one per box
  std::vector<OfTrack<ObjectMemory>> memories;        ///< of the objects
  std::vector<KeypointLabel> label;                   ///< per keypoint
  std::vector<std::int32_t> box;                      ///< per keypoint: the box that decides its K, or no_box
  std::vector<std::int32_t> match;                    ///< per keypoint: index in the frame before, or no_match
  std::vector<SecondStageKeypoint<Scalar>> evidence;  ///< per keypoint in a box: what the fine stage knew of it
  std::vector<Scalar> flow_depths;                    ///< per flow pair: in the frame before, m; empty: none
  std::vector<Scalar> flow_distances;                 ///< per flow pair, px, under the flow's model; empty: no model
  std::vector<Scalar> flow_probability;  ///< per keypoint: flow score at its place, at most ObjectProbability::together
                                         ///< of its object; negative: none. Outside boxes only where the flow moves
  std::vector<Scalar> static_probability;  ///< per keypoint: K
  std::vector<Scalar> weight;              ///< per keypoint: what the pose is to use
  bool all_observe = false;                ///< they were asked for without M: each counts as an observation
  FrameReport report;
  FrameScratch<Scalar> scratch;

  [[nodiscard]] std::size_t size() const noexcept { return current.keypoints.size(); }
};

namespace detail {
inline namespace CFP_ISA {

// s since the frame before, 0 without one. The difference of two clocks of 10^9 s fits a double to a fraction of a
// microsecond, a float not at all.
template <typename Scalar>
[[nodiscard]] double elapsed_s(const FrameState<Scalar>& state) noexcept {
  return state.previous.known ? state.current.timestamp_s - state.previous.timestamp_s : 0;
}

/// The flow of a frame with its known depths; after find_flow_depths.
template <typename Scalar>
[[nodiscard]] FlowPairs<Scalar> flow_with_depths(const Frame<Scalar>& frame, const FrameState<Scalar>& state) noexcept {
  return {frame.flow.previous, frame.flow.current, state.flow_depths};
}

/// M of keypoint i; -1, as of one without a map point, for a host that keeps none.
template <typename Scalar>
[[nodiscard]] Scalar map_point_at(span<const Scalar> map_point_probability, std::size_t i) noexcept {
  return map_point_probability.empty() ? Scalar(-1) : map_point_probability[i];
}

/// The options on the scale of the noise of this frame's flow.
[[nodiscard]] inline ObjectProbabilityOptions scaled_to_flow(const ObjectProbabilityOptions& options,
                                                             const FrameReport& report) noexcept {
  return scaled_to_noise(options, report.flow_sigma_px, report.flow_coordinates);
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// The value stored for a track; T{}, for a depth 0, if there is none.
template <typename T>
[[nodiscard]] T of_track(const std::vector<OfTrack<T>>& known, std::int64_t id) noexcept {
  const auto found = std::find_if(known.begin(), known.end(), [id](const auto& object) { return object.id == id; });
  return found == known.end() ? T{} : found->value;
}

}  // namespace CFP_ISA
}  // namespace cfp
