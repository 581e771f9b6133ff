// The tracking thread: one frame in, its pose out. The order is the paper's; the probabilities come from
// cfp::StaticProbability in two calls, each of which weighs the observations of the pose after it.
#pragma once

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cfp/evaluation/trajectory.hpp"
#include "cfp/frame/detector_health.hpp"
#include "cfp/frame/detector_lag.hpp"
#include "cfp/frame/static_probability.hpp"
#include "cfp/interop/opencv.hpp"
#include "front_end.hpp"
#include "local_bundle.hpp"
#include "local_map.hpp"
#include "mapping.hpp"
#include "motion.hpp"
#include "pose.hpp"
#include "relocalization.hpp"
#include "run.hpp"

namespace cfp_slam {

class Tracking {
 public:
  // The observer must stay.
  Tracking(const Camera& camera, const View& view, const Options& options, Observer& observer)
      : options_(options),
        view_(view),
        observer_(observer),
        probability_(camera, options.probability),
        refine_pose_(options),
        relocalize_(options.seed),
        local_map_(options.features),
        mapping_(options),
        detector_(options.detector_health),
        lag_(options.detector_lag) {}

  // `record` comes with time and image; the rest is filled in.
  void track(FrontEndResult&& input, FrameRecord& record) {
    take_bundle(false);
    Frame& frame = input.frame;
    relocalised_ = false;
    pose_ = {};
    const double step_s = frame.time_s - last_.time_s;
    if (step_s > 0 && cfp::is_finite(step_s)) {  // a clock that was set back says nothing
      lost_s_ += step_s;
      if (trial_) trial_->left_s -= step_s;
    }
    if (interval_.is_gap(frame.time_s)) {  // the last frame says nothing of where its points are now
      note(record, "gap before this frame: " + std::to_string(frame.time_s - last_.time_s) + " s");
      input.flow_from.clear();
      input.flow_to.clear();
      input.flow_depths_m.clear();
      last_.has_pose = false;
    }
    estimate(input, record);
    const Part part(observer_, Module::mapping);
    record.keypoints = frame.size();
    record.matches = static_cast<std::size_t>(
        std::count_if(from_last_.match.begin(), from_last_.match.end(), [](int j) { return j != cfp::no_match; }));
    if (map_.keyframes.empty()) {
      initialize(frame, record);
    } else {
      follow_trial(frame, record);
      follow_probation(frame, record);
      if (frame.has_pose) {
        world_ = map_.keyframe(local_map_.reference()).world;
        join_worlds(frame, record);
        extend_map(frame, record);
      } else if (lost_s_ < options_.new_map_after_s || !begin_world(frame, record)) {
        record.outcome = Outcome::lost;
        note(record, std::string("lost, ") + cfp::to_string(pose_.health.status));
      }
    }
    record.inliers = pose_.inliers;
    record.pose = pose_.health;
    if (frame.has_pose) {
      poses_.push_back({frame.time_s, local_map_.reference(), frame.T_cam_world * reference_pose().inverse()});
      believed_ = BelievedPose{frame.time_s, frame.T_cam_world};
      lost_s_ = 0;
    }
    motion_.learn(last_, frame);
    last_ = std::move(frame);
  }

  // Puts the last bundle adjustment's result into the map. The poses of the tracked frames are relative to their
  // reference keyframes after all bundle adjustment, as ORB-SLAM2 writes trajectories.
  RunResult finish() {
    take_bundle(true);
    RunResult result;
    for (const RelativePose& p : poses_) {
      result.trajectory.push_back({p.time_s, (p.T_cam_reference * map_.pose(p.reference)).inverse()});
      result.world.push_back(map_.keyframe(p.reference).world);
    }
    result.keyframes = map_.alive_keyframes.size();
    result.map_points = map_.alive_points();
    return result;
  }

 private:
  struct RelativePose {
    double time_s = 0;
    int reference = 0;
    cfp::SE3<double> T_cam_reference;
  };
  struct Trial {  // of the newest map
    double left_s = 0;
    std::size_t first_pose = 0;  // of poses_
  };

  static void note(FrameRecord& record, const std::string& what) {
    record.note += (record.note.empty() ? "" : "; ") + what;
  }

  // Matches, probabilities, weights and the pose, each twice.
  void estimate(FrontEndResult& input, FrameRecord& record) {
    Frame& frame = input.frame;
    predicted_ = motion_.predict(last_, frame.time_s, view_);
    {
      const Part part(observer_, Module::matching);
      grid_.build(frame, view_);
      match_last(frame, predicted_.T_cam_world);
    }
    cfp::StageResult<float> stage = coarse(input, record);
    observer_.weighted(stage, probability_.state(), frame);
    note_boxes(record);
    if (const std::optional<cfp::PoseEstimate> pose = first_pose(frame, stage.weight)) {
      {
        const Part part(observer_, Module::fine);
        stage = probability_.fine(*pose, from_last_.match, frame.map_point_probability);
      }
      observer_.weighted(stage, probability_.state(), frame);
    }
    record.health = stage.report.health;
    for (std::size_t i = 0; i < frame.size(); ++i)
      frame.static_probability[i] = probability_.static_probability(i, frame.map_point_probability[i]);
    if (frame.has_pose) second_pose(frame, stage.weight);
    observer_.decided(probability_, frame, map_);
  }

  void match_last(Frame& frame, const cfp::SE3<double>& T_cam_world) {
    match_last_(frame, grid_, last_, map_, T_cam_world, view_, options_.search_radius, options_.enough_matches,
                from_last_);
  }

  cfp::StageResult<float> coarse(const FrontEndResult& input, FrameRecord& record) {
    cfp::Frame<float> frame;
    frame.timestamp_s = input.frame.time_s;
    frame.keypoints = cfp::view(input.frame.keypoints);
    frame.depths = input.frame.depths_m;
    if (input.detections) frame.detections = believed_detections(*input.detections, record);
    frame.flow = {cfp::view(input.flow_from), cfp::view(input.flow_to), input.flow_depths_m};
    frame.map_point_probability = input.frame.map_point_probability;
    frame.image_motion = predicted_.image_motion;
    const Part part(observer_, Module::coarse);
    const auto stage = probability_.coarse(frame);
    const double lag_s = lag_.update(frame, probability_.state());
    if (lag_s > 0) {
      note(record, "detector late by " + cfp_examples::fixed(lag_s, 1) + " s");
      detector_ok_ = false;  // its boxes are used: they are near
    }
    return stage;
  }

  // Nothing, as if it had not run, of a detector that is silent or stuck: its boxes are carried on. Where they have
  // left the view, nothing is left to be seen.
  std::optional<cfp::span<const cfp::Detection<float>>> believed_detections(const cfp_examples::Detections& detections,
                                                                            FrameRecord& record) {
    cfp::DetectorStatus status = detector_.update(cfp::span<const cfp::Detection<float>>(detections));
    const auto& before = probability_.state();
    const bool left = before.boxes.empty() && int(before.report.frames_since_detector) < options_.max_idle;
    if (status == cfp::DetectorStatus::silent && left) {
      detector_.reset();
      status = cfp::DetectorStatus::ok;
    }
    if (status != cfp::DetectorStatus::ok) note(record, std::string("detector ") + cfp::to_string(status));
    detector_ok_ = status == cfp::DetectorStatus::ok || status == cfp::DetectorStatus::absurd;
    if (!detector_ok_) return std::nullopt;
    detections_.clear();
    std::copy_if(detections.begin(), detections.end(), std::back_inserter(detections_),
                 [&](const auto& d) { return !cfp::is_absurd(d, options_.detector_health); });
    return cfp::span<const cfp::Detection<float>>(detections_);
  }

  void note_boxes(FrameRecord& record) const {
    const auto& state = probability_.state();
    for (std::size_t b = 0; b < state.boxes.size(); ++b) {
      const auto& box = state.boxes[b];
      const auto& object = state.objects[b];
      record.boxes.push_back({box.id, box.box, box.compensated(), object.static_probability,
                              object.status == cfp::Status::ok, object.pairs,
                              cfp::object_depth(state.current, box.id)});
    }
  }

  // From the last frame's points or, when those do not give it and over a gap, from the map. The motion since the last
  // frame, if both frames have a pose.
  std::optional<cfp::PoseEstimate> first_pose(Frame& frame, cfp::span<const float> weight) {
    if (map_.keyframes.empty()) return std::nullopt;
    const Part part(observer_, Module::pose);
    frame.T_cam_world = predicted_.T_cam_world;
    if (last_.has_pose) pose_ = refine(frame, weight, from_last_.expected_proven, false, options_.first_health);
    if (!pose_.health.ok()) {
      relocalised_ = relocalize_(frame, map_, local_map_.points(), probability_, view_.camera);
      if (relocalised_) {
        match_last(frame, frame.T_cam_world);
        pose_ = refine(frame, weight, from_last_.expected_proven, false, options_.first_health);
      }
    }
    frame.has_pose = pose_.health.ok();
    if (!frame.has_pose || !last_.has_pose) return std::nullopt;
    return cfp::PoseEstimate{frame.T_cam_world * last_.T_cam_world.inverse(), pose_.inliers};
  }

  // With the local map.
  void second_pose(Frame& frame, cfp::span<const float> weight) {
    if (relocalised_) (void)from_local_map(frame, local_map_, weight, true);
    pose_ = from_local_map(frame, local_map_, weight, false);
    frame.has_pose = pose_.health.ok();
  }

  // What is new is searched for twice: a wide search finds many a wrong match, a narrow one from there tells what the
  // pose is worth.
  RefinedPose from_local_map(Frame& frame, LocalMap& local_map, cfp::span<const float> weight, bool wide) {
    {
      const Part part(observer_, Module::matching);
      local_map.search(frame, grid_, map_, view_, wide);
    }
    const Part part(observer_, Module::pose);
    return refine(frame, weight, local_map.expected_proven(), true,
                  relocalised_ ? options_.relocalised_health : options_.health);
  }

  // What took the view may take it for as long again as it has: so long a new map is on trial. Is it lost within that,
  // or an older one found, it goes, with its poses.
  void follow_trial(const Frame& frame, FrameRecord& record) {
    if (!trial_) return;
    const int reference = local_map_.reference();
    const bool in_it = frame.has_pose && map_.keyframe(reference).world == map_.newest_world();
    if (!in_it) {
      end_trial(record);
      local_map_.set_reference(frame.has_pose ? reference : 0);
      lost_s_ = 0;
    } else if (trial_->left_s <= 0) {
      trial_.reset();
    }
  }
  void end_trial(FrameRecord& record) {
    take_bundle(true);
    poses_.resize(trial_->first_pose);
    map_.drop_world();
    trial_.reset();
    believed_.reset();
    probation_ = 0;
    note(record, "the new map is given up, its poses are taken back");
  }

  // A pose from the map alone is on probation until some frames have been tracked from it. When it turns out to have
  // been wrong, the poses given since are taken back.
  void follow_probation(const Frame& frame, FrameRecord& record) {
    const bool failed = probation_ > 0 && (!frame.has_pose || (relocalised_ && is_jump(frame)));
    if (failed) {
      poses_.resize(first_on_probation_);
      believed_.reset();
      note(record, "a relocalisation was wrong, its poses are taken back");
    }
    if (relocalised_ && frame.has_pose && (failed || probation_ == 0)) first_on_probation_ = poses_.size();
    probation_ = !frame.has_pose ? 0 : relocalised_ ? options_.probation : std::max(probation_ - 1, 0);
  }
  [[nodiscard]] bool is_jump(const Frame& frame) const {
    if (!believed_) return false;
    const cfp::PoseStep<double> step{frame.T_cam_world * believed_->T_cam_world.inverse(),
                                     frame.time_s - believed_->time_s};
    return cfp::is_jump(step, options_.health);
  }

  // The stage's weights hold M of what the last frame saw; that of points which joined since comes on top.
  RefinedPose refine(Frame& frame, cfp::span<const float> weight, std::size_t expected, bool prune,
                     const cfp::PoseHealthOptions& health) {
    weights_.assign(weight.begin(), weight.end());
    for (std::size_t i = 0; i < frame.size(); ++i) {
      if (map_.is_alive(frame.map_point[i]))
        weights_[i] = probability_.weight(i, map_.point(frame.map_point[i]).static_probability);
    }
    return refine_pose_(frame, from_last_, map_, weights_, view_, expected, prune, health,
                        relocalised_ ? std::nullopt : believed_);
  }

  [[nodiscard]] std::size_t usable_points(const Frame& frame) const {
    std::size_t usable = 0;
    for (std::size_t i = 0; i < frame.size(); ++i) usable += mapping_.may_create(frame, i) ? 1U : 0U;
    return usable;
  }

  // The first frame is the world. It needs enough points that may be static.
  void initialize(Frame& frame, FrameRecord& record) {
    const std::size_t usable = usable_points(frame);
    if (usable < options_.min_initial_points) {
      record.outcome = Outcome::lost;
      note(record, "waiting for " + std::to_string(options_.min_initial_points) +
                       " static points with depth: this frame has " + std::to_string(usable));
      return;
    }
    frame.T_cam_world = {};
    frame.has_pose = true;
    pose_ = {};
    pose_.inliers = usable;
    record.outcome = Outcome::tracked;
    make_keyframe(frame, record);
  }

  // After some time of being lost the map is left alone, and a new one begins. Its poses have nothing to do with those
  // before until the camera sees the old map again.
  bool begin_world(Frame& frame, FrameRecord& record) {
    if (usable_points(frame) < options_.min_initial_points) return false;
    std::fill(frame.map_point.begin(), frame.map_point.end(), no_point);
    world_ = map_.begin_world();
    frames_since_join_ = 0;
    T_other_world_.reset();
    trial_ = Trial{lost_s_, poses_.size()};
    initialize(frame, record);
    record.outcome = Outcome::relocalised;
    note(record, "new map");
    return true;
  }

  // Looks for the other maps now and then. Two finds in a row that agree join the younger of the two maps to the older
  // one, or do without it, if it is on trial.
  void join_worlds(Frame& frame, FrameRecord& record) {
    constexpr int interval = 5;  // frames
    const auto is_other = [&](int k) { return map_.keyframe(k).world != world_; };
    if (probation_ > 0 || ++frames_since_join_ % interval != 0 ||
        std::none_of(map_.alive_keyframes.begin(), map_.alive_keyframes.end(), is_other))
      return;
    Frame probe = frame;
    from_last_.match.swap(no_match_);
    from_last_.match.assign(frame.size(), cfp::no_match);
    std::optional<cfp::SE3<double>> T_other_world;
    if (relocalize_.from_keyframes(probe, map_, 3, world_, probability_, view_.camera)) {
      LocalMap around(options_.features);
      relocalised_ = true;  // the step to this pose is none of the camera's
      (void)from_local_map(probe, around, frame.static_probability, true);
      const RefinedPose pose = from_local_map(probe, around, frame.static_probability, false);
      relocalised_ = false;
      if (pose.health.ok()) T_other_world = probe.T_cam_world.inverse() * frame.T_cam_world;
      if (T_other_world && T_other_world_ && agree(*T_other_world, *T_other_world_, frame))
        join_world(map_.keyframe(around.reference()).world, *T_other_world, probe, pose, around.reference(), frame,
                   record);
    }
    T_other_world_ = T_other_world;
    from_last_.match.swap(no_match_);
  }
  // `probe` is the frame as the other world sees it, by its keyframe `reference`.
  void join_world(int other, const cfp::SE3<double>& T_other_world, const Frame& probe, const RefinedPose& pose,
                  int reference, Frame& frame, FrameRecord& record) {
    take_bundle(true);
    const bool is_older = other < world_;
    if (is_older) {
      last_.T_cam_world = last_.T_cam_world * T_other_world.inverse();
      frame = probe;
      pose_ = pose;
      local_map_.set_reference(reference);
    }
    if (trial_) {
      end_trial(record);
      relocalised_ = true;
      probation_ = options_.probation;
      first_on_probation_ = poses_.size();
    } else {
      const int newer = std::max(world_, other);
      std::vector<int> joined;
      std::copy_if(map_.alive_keyframes.begin(), map_.alive_keyframes.end(), std::back_inserter(joined),
                   [&](int k) { return map_.keyframe(k).world == newer; });
      is_older ? map_.join(world_, other, T_other_world) : map_.join(other, world_, T_other_world.inverse());
      note(record, "joined to the old map");
      take_back_what_has_gone(joined, frame, record);
    }
    world_ = std::min(world_, other);
  }
  // What filled the view while a map was on its own may have moved since: the poses by it were none in the room.
  void take_back_what_has_gone(const std::vector<int>& keyframes, const Frame& frame, FrameRecord& record) {
    std::vector<int> gone;
    std::copy_if(keyframes.begin(), keyframes.end(), std::back_inserter(gone),
                 [&](int k) { return has_gone(map_, k, frame, grid_, view_); });
    if (gone.empty()) return;
    const auto is_by_it = [&](const RelativePose& p) {
      return std::find(gone.begin(), gone.end(), map_.ancestor(p.reference)) != gone.end();
    };
    poses_.erase(std::remove_if(poses_.begin(), poses_.end(), is_by_it), poses_.end());
    for (const int k : gone) map_.erase_keyframe(k);
    note(record, "poses by what has gone since are taken back");
  }
  // Where the camera of a frame is by two transformations.
  static bool agree(const cfp::SE3<double>& a, const cfp::SE3<double>& b, const Frame& frame) {
    const cfp::SE3<double> difference = (a * frame.T_cam_world.inverse()).inverse() * (b * frame.T_cam_world.inverse());
    return difference.translation.norm() < 0.05 && cfp::so3_log(difference.rotation).norm() < 0.03;
  }

  void extend_map(Frame& frame, FrameRecord& record) {
    const bool on_probation = relocalised_ || probation_ > 0;
    const bool apart = world_ != map_.keyframe(map_.alive_keyframes.front()).world;
    record.outcome = on_probation || apart ? Outcome::relocalised : Outcome::tracked;
    update_points(map_, frame, probability_, !on_probation, detector_ok_);
    ++frames_since_keyframe_;
    if (!on_probation &&
        mapping_.wants_keyframe(map_, frame, local_map_.reference(), pose_.in_map, frames_since_keyframe_))
      make_keyframe(frame, record);
  }

  void make_keyframe(Frame& frame, FrameRecord& record) {
    take_bundle(true);
    const int keyframe = mapping_.insert(map_, frame, world_, view_);
    local_map_.set_reference(keyframe);
    mapping_.cull(map_);
    frame.map_point = map_.keyframe(keyframe).frame.map_point;
    frame.map_point_probability = map_.keyframe(keyframe).frame.map_point_probability;
    map_.recycle();
    record.keyframe = true;
    frames_since_keyframe_ = 0;
    if (map_.keyframes.size() > 1) bundle_.start(map_, keyframe, view_, options_.bundle, options_.threads, observer_);
  }

  // The result of the bundle adjustment under way, `min_gap` frames after its start or now. The last frame moves with
  // its reference.
  void take_bundle(bool now) {
    if (!bundle_.is_due(now, options_.mapping.min_gap)) return;
    const cfp::SE3<double> T_cam_reference = last_.T_cam_world * reference_pose().inverse();
    bundle_.finish(map_);
    if (last_.has_pose) last_.T_cam_world = T_cam_reference * reference_pose();
  }

  [[nodiscard]] const cfp::SE3<double>& reference_pose() const {
    return map_.keyframe(local_map_.reference()).frame.T_cam_world;
  }

  Options options_;
  View view_;
  Observer& observer_;
  cfp::StaticProbability<Camera> probability_;
  MotionModel motion_;
  KeypointGrid grid_;
  LastFrameMatching match_last_;
  PoseSolver refine_pose_;
  Relocalization relocalize_;
  LocalMap local_map_;
  Mapping mapping_;
  BundleThread bundle_;

  Map map_;
  Frame last_;
  MotionModel::Prediction predicted_;
  LastFrameMatches from_last_;
  bool relocalised_ = false;     // in this frame
  RefinedPose pose_;             // of this frame
  cfp::FrameInterval interval_;  // the motion model is not asked over a gap
  cfp::DetectorHealth<float> detector_;
  cfp::DetectorLag<float> lag_;
  bool detector_ok_ = true;
  cfp_examples::Detections detections_;
  std::optional<BelievedPose> believed_;           // the last of all frames
  int world_ = 0;                                  // of the keyframes to come
  double lost_s_ = 0;                              // since then
  std::optional<cfp::SE3<double>> T_other_world_;  // of the last look for other maps
  int frames_since_join_ = 0;
  std::optional<Trial> trial_;
  std::vector<std::int32_t> no_match_;
  int probation_ = 0;                   // frames left
  std::size_t first_on_probation_ = 0;  // of poses_
  int frames_since_keyframe_ = 0;
  std::vector<RelativePose> poses_;
  std::vector<float> weights_;
};

}  // namespace cfp_slam
