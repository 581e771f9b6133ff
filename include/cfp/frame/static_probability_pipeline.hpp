/// @file static_probability_pipeline.hpp
/// One frame of CFP-SLAM in the paper's order, around the host's own pose solver: compensate and associate boxes, first
/// stage, pose, second stage, pose. The host keeps its features, its map and its optimiser; it hands over arrays and
/// gets weights. Who wants another order calls first_stage and second_stage.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cfp/core/span.hpp"
#include "cfp/detection/box_tracker.hpp"
#include "cfp/frame/first_stage.hpp"
#include "cfp/frame/frame_state.hpp"
#include "cfp/frame/health.hpp"
#include "cfp/frame/object_box.hpp"
#include "cfp/frame/options.hpp"
#include "cfp/frame/second_stage.hpp"

namespace cfp {

/// The parts of a frame, in their order. An observer is told at the end of each.
enum class PipelineStep : std::uint8_t {
  boxes,             ///< missed-detection compensation and association
  objects,           ///< O from the optical flow
  first_keypoints,   ///< depth clustering, K of the first stage
  first_pose,        ///< the host's solver
  second_keypoints,  ///< K of the second stage, M, weights; not for frames without a first pose or without matches
  second_pose        ///< the host's solver
};

/// The observer that observes nothing.
struct NoObserver {
  template <typename Result>
  void operator()(PipelineStep, const Result&) const noexcept {}
};

/// Frame k as the host has it. Empty arrays mean "none", except for keypoints.
template <typename Scalar>
struct FrameInput {
  double timestamp_s = 0;
  PointSpan<Scalar, 2> keypoints;            ///< pixels, in the image of the detections
  span<const Scalar> depths_m;               ///< one per keypoint; not positive or not finite: no depth
  span<const Detection<Scalar>> detections;  ///< of the object detector, all classes
  PointSpan<Scalar, 2> flow_previous;        ///< optical-flow pairs, pixels, frame k-1 ...
  PointSpan<Scalar, 2> flow_current;         ///< ... and frame k
  span<const std::int32_t> match;      ///< per keypoint: index among the keypoints of the call before, or no_match
  span<Scalar> map_point_probability;  ///< in, out: M per keypoint, negative where there is no map point; empty: all
                                       ///< have one with M = 1
  const Matrix3<Scalar>* fundamental = nullptr;  ///< F of the undistorted flow pairs if the host has one
  const Matrix3<Scalar>* image_motion =
      nullptr;  ///< homography from the previous image to this one, for the box prediction
};

/// The answer. The views refer to the pipeline's memory and hold until its next call.
template <typename Scalar>
struct FrameResult {
  span<const Scalar> static_probability;  ///< K per keypoint, of the last stage that ran
  span<const Scalar> weight;              ///< weight per keypoint that the last pose was to use
  span<const KeypointLabel> label;
  span<const std::int32_t> ruling_box;    ///< index into `boxes`, or no_box
  span<const TrackedBox<Scalar>> boxes;   ///< of potentially moving classes: detected and compensated
  span<const ObjectProbability> objects;  ///< O, one per box
  PoseEstimate pose;                      ///< of the last stage that had one
  Stage stage = Stage::coarse;            ///< the last stage that ran
  FirstStageResult first;
  SecondStageResult second;
  FrameHealth health;        ///< of the weights of that stage, fallback included
  Status time = Status::ok;  ///< invalid_input: the time stamp did not grow, and the boxes were not moved
  std::size_t frames_without_detections = 0;  ///< in a row; a silent detector is the commonest cause of a plain result
};

/// Holds the box tracker, the previous frame's keypoints and the scratch memory of one camera. Not thread-safe; objects
/// do not share anything. After the largest frame has been seen, a frame allocates nothing. Same frames and options,
/// same bits.
template <typename Scalar>
class StaticProbabilityPipeline {
 public:
  /// Options outside their ranges are the caller's error: see `validate`.
  explicit StaticProbabilityPipeline(const PipelineOptions& options = {})
      : options_(options), tracker_(options.tracker) {
    CFP_ASSERT(!invalid_field(options));
  }

  /// solve_pose(Stage, span<const Scalar> weight) -> PoseEstimate: the host's optimiser over its own observations,
  /// weight[i] being that of keypoint i (MODEL: outside the robust loss; 0: leave out). Called once for the first stage
  /// and, when that gave a pose and there are matches, once more for the second. observe(PipelineStep, const
  /// FrameResult<Scalar>&): called after every step with what is known by then; for clocks and recordings, as this
  /// library has neither.
  template <typename Camera, typename PoseSolver, typename Observer = NoObserver>
  FrameResult<Scalar> process(const FrameInput<Scalar>& frame, const Camera& camera, PoseSolver&& solve_pose,
                              Observer&& observe = Observer{}) {
    const std::size_t n = frame.keypoints.size();
    CFP_ASSERT(frame.match.empty() || frame.match.size() == n);
    CFP_ASSERT(frame.map_point_probability.empty() || frame.map_point_probability.size() == n);
    resize(n);
    FrameResult<Scalar> result;
    track_boxes(frame, result);
    result.static_probability = k_;
    result.weight = weight_;
    result.label = label_;
    result.ruling_box = ruling_box_;
    result.boxes = boxes_;
    result.objects = objects_;
    observe(PipelineStep::boxes, result);
    const FirstStageInput<Scalar> first{frame.keypoints,     frame.depths_m,     objects_in_view_,
                                        frame.flow_previous, frame.flow_current, frame.fundamental};
    result.first = first_stage_objects(first, camera, span<ObjectProbability>(objects_), options_.first, first_work_);
    observe(PipelineStep::objects, result);
    first_stage_keypoints(first, {k_, label_, ruling_box_, objects_}, options_.first, first_work_, result.first);
    observe(PipelineStep::first_keypoints, result);

    span<Scalar> m = frame.map_point_probability;
    if (m.empty()) {
      m_.assign(n, Scalar(1));
      m = m_;
    }
    for (std::size_t i = 0; i < n; ++i)
      weight_[i] = observation_weight(k_[i], m[i] >= Scalar(0) ? m[i] : Scalar(1), options_.second.map_point.weight);
    solve(Stage::coarse, m, solve_pose, result);
    observe(PipelineStep::first_pose, result);
    if (result.pose.valid && has_previous_ && !frame.match.empty()) {
      const SecondStageInput<Scalar> second{
          frame.keypoints,     label_,           ruling_box_, objects_in_view_,       objects_,
          previous_keypoints_, previous_depths_, frame.match, result.pose.T_cur_prev, result.pose.inliers};
      result.second = second_stage(second, camera, {k_, m, weight_}, options_.second, second_work_);
      observe(PipelineStep::second_keypoints, result);
      solve(Stage::fine, m, solve_pose, result);
      observe(PipelineStep::second_pose, result);
    }
    remember(frame);
    return result;
  }

  /// Forgets tracks and the previous frame, as after a lost pose or a jump in time.
  void reset() noexcept {
    tracker_.reset();
    has_previous_ = false;
    frames_without_detections_ = 0;
  }
  [[nodiscard]] const PipelineOptions& options() const noexcept { return options_; }

 private:
  void resize(std::size_t n) {
    k_.assign(n, Scalar(1));
    label_.assign(n, KeypointLabel::outside);
    ruling_box_.assign(n, no_box);
    weight_.assign(n, Scalar(1));
  }

  /// The boxes of this frame, of the classes that can move.
  void track_boxes(const FrameInput<Scalar>& frame, FrameResult<Scalar>& result) {
    boxes_.clear();
    objects_in_view_.clear();
    if (options_.use_boxes) {
      // The difference of two clocks of 10^9 s fits a double to a fraction of a microsecond, a float not at all.
      const double dt = has_previous_ ? frame.timestamp_s - previous_timestamp_s_ : 0.0;
      const BoxTrackerResult<Scalar> tracked =
          tracker_.track(frame.detections, static_cast<Scalar>(dt), frame.image_motion);
      result.time = tracked.status;
      frames_without_detections_ = frame.detections.empty() ? frames_without_detections_ + 1 : 0;
      result.frames_without_detections = frames_without_detections_;
      for (const TrackedBox<Scalar>& box : tracked.boxes) {
        for (const ObjectClass& object_class : options_.classes) {
          if (object_class.class_id != box.class_id) continue;
          boxes_.push_back(box);
          objects_in_view_.push_back({box.box, object_class.non_rigid, box.associated});
          break;
        }
      }
    }
    objects_.resize(boxes_.size());
  }

  template <typename PoseSolver>
  void solve(Stage stage, span<const Scalar> m, PoseSolver& solve_pose, FrameResult<Scalar>& result) {
    result.stage = stage;
    result.health = apply_fallback(span<const KeypointLabel>(label_), m, span<Scalar>(weight_), options_.health);
    const PoseEstimate pose = solve_pose(stage, span<const Scalar>(weight_));
    if (pose.valid || stage == Stage::coarse) result.pose = pose;
  }

  void remember(const FrameInput<Scalar>& frame) {
    const std::size_t n = frame.keypoints.size();
    previous_keypoints_.resize(n);
    for (std::size_t i = 0; i < n; ++i) previous_keypoints_[i] = {frame.keypoints(i, 0), frame.keypoints(i, 1)};
    previous_depths_.assign(frame.depths_m.begin(), frame.depths_m.end());
    previous_timestamp_s_ = frame.timestamp_s;
    has_previous_ = true;
  }

  PipelineOptions options_;
  BoxTracker<Scalar> tracker_;
  bool has_previous_ = false;
  double previous_timestamp_s_ = 0;
  std::size_t frames_without_detections_ = 0;
  std::vector<std::array<Scalar, 2>> previous_keypoints_;
  std::vector<Scalar> previous_depths_, k_, m_, weight_;
  std::vector<KeypointLabel> label_;
  std::vector<std::int32_t> ruling_box_;
  std::vector<TrackedBox<Scalar>> boxes_;
  std::vector<ObjectBox<Scalar>> objects_in_view_;
  std::vector<ObjectProbability> objects_;
  FirstStageWorkspace<Scalar> first_work_;
  SecondStageWorkspace<Scalar> second_work_;
};

}  // namespace cfp
