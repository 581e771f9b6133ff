/// @file static_probability.hpp
/// CFP-SLAM for a host that keeps its own features, map, optimiser and control flow: two calls per frame, each of which
/// returns the weights for the host's next pose optimisation.
///
///   const auto coarse = probability.coarse(frame);               // stage 1: boxes, objects, depth
///   pose = optimise(coarse.weight);                              // the host's own
///   const auto fine = probability.fine({pose, inliers}, match, m);  // stage 2: the constraints of that pose
///   pose = optimise(fine.weight);
///   probability.update_map_points(m);                            // M of all that the frame saw
///
/// For another order, call the steps directly: begin_frame, track_boxes, estimate_objects, remember_objects,
/// label_keypoints, match_in_boxes, constrain_keypoints, weigh_keypoints, update_map_points.
///
/// A unit that calls `coarse` compiles all engines. A host whose units are compiled often keeps them in one file:
/// `extern template class cfp::StaticProbability<Camera>;` in its own header, `template class` without extern there.
#pragma once

#include "cfp/core/span.hpp"
#include "cfp/detection/box_tracker.hpp"
#include "cfp/frame/begin_frame.hpp"
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
/// largest frame of each FlowModelKind has been seen, a call allocates nothing. Same frames and options, same bits. The
/// camera is any type with the interface of PinholeCamera.
template <typename Camera>
class StaticProbability {
 public:
  using Scalar = typename Camera::ScalarType;

  /// Options outside their ranges are the caller's error: see `validate`.
  explicit StaticProbability(const Camera& camera, const FrameOptions& options = {})
      : camera_(camera), options_(options), tracker_(options.tracker) {
    CFP_ASSERT(!invalid_field(options));
  }

  /// Stage 1, the first call of every frame. Without frame.map_point_probability every keypoint counts as an
  /// observation of a new map point; see `weights` for matches that are made later.
  StageResult<Scalar> coarse(const Frame<Scalar>& frame);

  /// Stage 2, at most once per frame, with the pose that was optimised with stage 1's weights; not called if there is
  /// none. match: per keypoint the index among the keypoints of the frame of the `coarse` call before, or no_match; may
  /// be empty. map_point_probability: M per keypoint, negative where there is no map point; empty for a host that keeps
  /// none. In the first frame after a reset nothing is matched: K and the weights stay those of stage 1.
  StageResult<Scalar> fine(const PoseEstimate& pose, span<const std::int32_t> match,
                           span<const Scalar> map_point_probability = {});

  /// The weights of the stage that ran last, for matches made since (motion model, then local map): M per keypoint as
  /// it was before this frame, negative where there is no map point.
  span<const Scalar> weights(span<const Scalar> map_point_probability) { return result(map_point_probability).weight; }
  /// The same for one keypoint that is matched later, under the fallback that the last of these calls decided on: after
  /// many new matches call `weights` again. M negative: it has no map point.
  [[nodiscard]] Scalar weight(std::size_t keypoint, Scalar map_point_probability) const noexcept {
    return keypoint_weight(keypoint, map_point_probability, options_, state_);
  }

  /// The static probability of one keypoint with a map point of probability M: with WeightRule::posterior its weight
  /// before any fallback, otherwise K.
  [[nodiscard]] Scalar static_probability(std::size_t keypoint, Scalar map_point_probability) const noexcept {
    return options_.map_point.weight == WeightRule::posterior
               ? model_weight(keypoint, map_point_probability, options_, state_)
               : state_.static_probability[keypoint];
  }

  /// The last call of a frame, with all its matches: updates M per keypoint from the constraints; without `fine`, M
  /// stays. It comes last because the frame's weights use the M of before as their prior: nothing is counted twice.
  void update_map_points(span<Scalar> map_point_probability) noexcept {
    cfp::update_map_points(options_, state_, map_point_probability);
  }
  /// The same for one keypoint.
  [[nodiscard]] Scalar updated_map_point(std::size_t keypoint, Scalar map_point_probability) const noexcept {
    return cfp::updated_map_point(keypoint, map_point_probability, options_, state_);
  }
  /// Whether the host may make a map point of this keypoint; its M is then static_probability(keypoint, -1).
  [[nodiscard]] bool may_create_map_point(std::size_t keypoint) const noexcept {
    return cfp::may_create_map_point(static_probability(keypoint, Scalar(-1)), options_);
  }

  /// Forgets tracks and frames: call it after a jump in time or of the camera. The state of the last frame's keypoints
  /// stays readable until the next frame.
  void reset() noexcept {
    tracker_.reset();
    state_.previous.known = state_.current.known = false;
  }

  [[nodiscard]] const Camera& camera() const noexcept { return camera_; }
  [[nodiscard]] const FrameOptions& options() const noexcept { return options_; }
  /// Boxes, objects, labels and all else of this frame.
  [[nodiscard]] const FrameState<Scalar>& state() const noexcept { return state_; }

 private:
  StageResult<Scalar> result(span<const Scalar> map_point_probability) {
    weigh_keypoints(map_point_probability, options_, state_);
    return {state_.weight, state_.static_probability, state_.report};
  }

  Camera camera_;
  FrameOptions options_;
  BoxTracker<Scalar> tracker_;
  FrameState<Scalar> state_;
};

// Outside of the class, so that `extern template class` keeps the engines behind them out of a unit.

template <typename Camera>
auto StaticProbability<Camera>::coarse(const Frame<Scalar>& frame) -> StageResult<Scalar> {
  begin_frame(frame, state_);
  track_boxes(frame, options_, tracker_, state_);
  estimate_objects(frame, camera_, options_, state_);
  remember_objects(options_, state_);
  label_keypoints(frame, options_, state_);
  return result(frame.map_point_probability);
}

template <typename Camera>
auto StaticProbability<Camera>::fine(const PoseEstimate& pose, span<const std::int32_t> match,
                                     span<const Scalar> map_point_probability) -> StageResult<Scalar> {
  match_in_boxes(pose.T_cur_prev, match, camera_, options_, state_);
  if (state_.previous.known && !(match.empty() && state_.current.descriptors.empty()))
    constrain_keypoints(pose, map_point_probability, camera_, options_, state_);
  return result(map_point_probability);
}

}  // namespace CFP_ISA
}  // namespace cfp
