/// @file static_probability.hpp
/// CFP-SLAM for a host that keeps its own features, map, optimiser and order of things: two calls per frame, each of
/// which gives the weights for the host's next pose optimisation.
///
///   const auto coarse = probability.coarse(frame);               // stage 1: boxes, objects, depth
///   pose = optimise(coarse.weight);                              // the host's own
///   const auto fine = probability.fine({pose, inliers}, match, m);  // stage 2: the constraints of that pose
///   pose = optimise(fine.weight);
///
/// Who wants another order calls the steps themselves: begin_frame, track_boxes, estimate_objects, label_keypoints,
/// match_in_boxes, constrain_keypoints, update_map_points, weigh_keypoints.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "cfp/core/span.hpp"
#include "cfp/detection/box_tracker.hpp"
#include "cfp/frame/constrain_keypoints.hpp"
#include "cfp/frame/estimate_objects.hpp"
#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/frame_state.hpp"
#include "cfp/frame/label_keypoints.hpp"
#include "cfp/frame/match_in_boxes.hpp"
#include "cfp/frame/track_boxes.hpp"
#include "cfp/frame/weigh_keypoints.hpp"

namespace cfp {

/// The answer of either stage. The views refer to memory of StaticProbability and hold until its next call.
template <typename Scalar>
struct StageResult {
  span<const Scalar> weight;              ///< per keypoint: for the host's pose, outside its robust loss; 0: leave out
  span<const Scalar> static_probability;  ///< per keypoint: K
  FrameReport report;                     ///< what the frame had, and what it lacked
};

inline namespace CFP_ISA {

/// One per camera: tracks of boxes, the frame before, scratch memory. Not thread-safe; objects share nothing. After the
/// largest frame has been seen, a call allocates nothing. Same frames and options, same bits. The camera is any type
/// with the interface of PinholeCamera.
template <typename Camera>
class StaticProbability {
 public:
  using Scalar = typename Camera::ScalarType;

  /// Options outside their ranges are the caller's error: see `validate`.
  explicit StaticProbability(const Camera& camera, const FrameOptions& options = {})
      : camera_(camera), options_(options), tracker_(options.tracker) {
    CFP_ASSERT(!invalid_field(options));
  }

  /// Stage 1, once per frame, first of all. Without frame.map_point_probability every keypoint counts as an observation
  /// of a sure map point; see `weights` for matches that are made later.
  StageResult<Scalar> coarse(const Frame<Scalar>& frame) {
    begin_frame(frame, state_);
    track_boxes(frame, options_, tracker_, state_);
    estimate_objects(frame, camera_, options_, state_);
    remember_objects(options_, state_);
    label_keypoints(frame, options_, state_);
    weigh_keypoints(or_sure(frame.map_point_probability), options_, state_);
    return result(state_.static_probability);
  }

  /// Stage 2, at most once per frame, with the pose that stage 1's weights led to; left out when there is none. match:
  /// per keypoint the index among the keypoints of the frame of the `coarse` call before, or no_match; may be empty.
  /// map_point_probability, in and out: M per keypoint, negative where there is no map point; it learns from this
  /// frame. In the frame after a reset nothing is matched: K and M stay, and the weights are stage 1's.
  StageResult<Scalar> fine(const PoseEstimate& pose, span<const std::int32_t> match,
                           span<Scalar> map_point_probability = {}) {
    const span<Scalar> m = or_sure(map_point_probability);
    match_in_boxes(pose.T_cur_prev, match, camera_, options_, state_);
    if (state_.previous.known && !(match.empty() && state_.current.descriptors.empty())) {
      constrain_keypoints(pose, m, camera_, options_, state_);
      update_map_points(options_, state_, m);
    }
    weigh_keypoints(m, options_, state_);
    return result(options_.fine.map_point_prior ? state_.posterior : state_.static_probability);
  }

  /// The weights of the stage that ran last, for matches made since (motion model, then local map): M per keypoint,
  /// negative where there is no map point.
  span<const Scalar> weights(span<const Scalar> map_point_probability) {
    weigh_keypoints(map_point_probability, options_, state_);
    return state_.weight;
  }
  /// The same for one keypoint that joins later. M negative: it has no map point.
  [[nodiscard]] Scalar weight(std::size_t keypoint, Scalar map_point_probability) const noexcept {
    return keypoint_weight(keypoint, map_point_probability, options_, state_);
  }
  /// M after this frame, of a map point that joined after `fine`.
  [[nodiscard]] Scalar updated_map_point(std::size_t keypoint, Scalar map_point_probability) const noexcept {
    return cfp::updated_map_point(keypoint, map_point_probability, options_, state_);
  }
  /// Whether the host may make a map point of this keypoint.
  [[nodiscard]] bool may_create_map_point(std::size_t keypoint) const noexcept {
    return cfp::may_create_map_point(state_.static_probability[keypoint], options_);
  }

  /// Forgets tracks and frames: after a jump in time or of the camera.
  void reset() noexcept {
    tracker_.reset();
    state_.previous.known = state_.current.known = false;
    state_.report = {};
  }

  [[nodiscard]] const Camera& camera() const noexcept { return camera_; }
  [[nodiscard]] const FrameOptions& options() const noexcept { return options_; }
  /// Boxes, objects, labels and all else of this frame.
  [[nodiscard]] const FrameState<Scalar>& state() const noexcept { return state_; }

 private:
  /// M of every keypoint, 1 for a host that keeps none.
  template <typename Element>
  span<Element> or_sure(span<Element> map_point_probability) {
    if (!map_point_probability.empty()) return map_point_probability;
    sure_.assign(state_.size(), Scalar(1));
    return sure_;
  }
  StageResult<Scalar> result(const std::vector<Scalar>& static_probability) const noexcept {
    return {state_.weight, static_probability, state_.report};
  }

  Camera camera_;
  FrameOptions options_;
  BoxTracker<Scalar> tracker_;
  FrameState<Scalar> state_;
  std::vector<Scalar> sure_;
};

}  // namespace CFP_ISA
}  // namespace cfp
