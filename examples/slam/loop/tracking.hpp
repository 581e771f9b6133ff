// The tracking thread: one frame in, its pose out. The order is the paper's; the probabilities come from
// cfp::StaticProbability in two calls, each of which weighs the observations of the pose after it.
#pragma once

#include <algorithm>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cfp/frame/frame_interval.hpp"
#include "cfp/frame/static_probability.hpp"
#include "cfp/geometry/epipolar.hpp"
#include "cfp/interop/opencv.hpp"
#include "detector_watch.hpp"
#include "front_end.hpp"
#include "local_bundle.hpp"
#include "local_map.hpp"
#include "localization.hpp"
#include "mapping.hpp"
#include "pose_history.hpp"

namespace cfp_slam {

class Tracking {
 public:
  // The observer must stay.
  Tracking(const Camera& camera, const View& view, const Options& options, Observer& observer)
      : options_(options),
        view_(view),
        observer_(observer),
        probability_(camera, options.probability),
        detector_(options),
        localization_(options, view, map_, probability_, observer),
        mapping_(options) {}
  Tracking(const Tracking&) = delete;
  Tracking& operator=(const Tracking&) = delete;

  // `record` comes with time and image; the rest is filled in.
  void track(FrontEndResult&& input, FrameRecord& record) {
    take_bundle(false);
    Frame& frame = input.frame;
    pose_ = {};
    const double step_s = frame.time_s - last_.time_s;
    if (step_s > 0 && cfp::is_finite(step_s)) {  // a clock that was set back says nothing
      lost_s_ += step_s;
      if (trial_) trial_->left -= step_s;
    }
    if (interval_.is_gap(frame.time_s)) {  // the last frame says nothing of where its points are now
      record.add_note("gap before this frame: " + std::to_string(frame.time_s - last_.time_s) + " s");
      input.flow = {};
      last_.has_pose = false;
    }
    estimate(input, record);
    const Part part(observer_, Module::mapping);
    record.keypoints = frame.size();
    const auto& match = localization_.match();
    record.matches = match.size() - std::size_t(std::count(match.begin(), match.end(), cfp::no_match));
    if (map_.keyframes.empty()) {
      if (!begin_map(frame, record))
        record.add_note("waiting for " + std::to_string(options_.min_initial_points) + " static points with depth");
    } else {
      follow_trial(frame, record);
      follow_probation(frame, record);
      if (frame.has_pose) {
        join_worlds(frame, record);
        extend_map(frame, record);
      } else if (lost_s_ < options_.new_map_after_s || !begin_map(frame, record)) {
        record.add_note(std::string("lost, ") + cfp::to_string(pose_.health.status));
      }
    }
    record.inliers = pose_.inliers;
    record.pose = pose_.health;
    if (frame.has_pose) {
      poses_.add(frame, local_map_.reference, map_);
      believed_ = BelievedPose{frame.time_s, frame.T_cam_world};
      lost_s_ = 0;
    }
    localization_.learn(last_, frame);
    last_ = std::move(frame);
  }

  // Boxes, objects, labels and all else of the last frame.
  [[nodiscard]] const cfp::FrameState<float>& state() const { return probability_.state(); }

  // Puts the last bundle adjustment's result into the map.
  RunResult finish() {
    take_bundle(true);
    return poses_.result(map_);
  }

 private:
  struct Trial {  // of what may turn out to be wrong: then the poses from the first one on are taken back
    std::size_t first_pose = 0;  // of poses_
    double left = 0;             // seconds of a new map, frames of a relocalisation
  };

  // Matches, probabilities, weights and the pose, each twice.
  void estimate(FrontEndResult& input, FrameRecord& record) {
    Frame& frame = input.frame;
    localization_.begin(frame, last_);
    cfp::StageResult<float> stage = coarse(input, record);
    observer_.weighted(stage, probability_.state(), frame);
    if (!map_.keyframes.empty()) pose_ = localization_.first_pose(frame, last_, local_map_, stage.weight, believed_);
    if (frame.has_pose && last_.has_pose) {
      {
        const Part part(observer_, Module::fine);
        stage = probability_.fine({frame.T_cam_world * last_.T_cam_world.inverse(), pose_.inliers},
                                  localization_.match(), frame.map_point_probability);
      }
      observer_.weighted(stage, probability_.state(), frame);
    }
    for (std::size_t i = 0; i < frame.size(); ++i)
      frame.static_probability[i] = probability_.static_probability(i, frame.map_point_probability[i]);
    if (frame.has_pose) pose_ = localization_.second_pose(frame, local_map_, stage.weight, pose_.from_map, believed_);
    observer_.decided(probability_, frame, map_);
  }

  cfp::StageResult<float> coarse(FrontEndResult& input, FrameRecord& record) {
    cfp::Frame<float> frame;
    frame.timestamp_s = input.frame.time_s;
    frame.keypoints = cfp::view(input.frame.keypoints);
    if (input.detections) frame.detections = detector_.believed(*input.detections, probability_.state(), record);
    frame.flow = {cfp::view(input.flow.from), cfp::view(input.flow.to)};
    if (options_.give_depths) {
      frame.depths = input.frame.depths_m;
      frame.flow.previous_depths = input.flow.depths_m;
    }
    frame.map_point_probability = input.frame.map_point_probability;
    if (const auto& motion = localization_.motion_since_last())
      frame.image_motion = cfp::rotation_homography(view_.camera, motion->rotation.cast<float>());
    const Part part(observer_, Module::coarse);
    const auto stage = probability_.coarse(frame);
    detector_.look_for_lag(frame, probability_.state(), record);
    return stage;
  }

  void fail(std::optional<Trial>& trial, const char* why, FrameRecord& record) {
    poses_.take_back_after(trial->first_pose);
    trial.reset();
    believed_.reset();
    record.add_note(why);
  }

  // What took the view may take it for as long again as it has: so long a new map is on trial. Is it lost within that,
  // or an older one found, it goes, with its poses.
  void follow_trial(const Frame& frame, FrameRecord& record) {
    if (!trial_) return;
    if (!frame.has_pose || reference().world != map_.newest_world()) {
      end_trial(record);
      if (!frame.has_pose) local_map_.reference = 0;
      lost_s_ = 0;
    } else if (trial_->left <= 0) {
      trial_.reset();
    }
  }
  void end_trial(FrameRecord& record) {
    take_bundle(true);
    fail(trial_, "the new map is given up, its poses are taken back", record);
    map_.drop_world();
    probation_.reset();
  }

  // A pose from the map alone is on probation until some frames have been tracked from it. When it turns out to have
  // been wrong, the poses given since are taken back.
  void follow_probation(const Frame& frame, FrameRecord& record) {
    const bool jumps = pose_.from_map && believed_ && cfp::is_jump(believed_->step_to(frame), options_.health);
    if (probation_ && (!frame.has_pose || jumps))
      fail(probation_, "a relocalisation was wrong, its poses are taken back", record);
    if (frame.has_pose && pose_.from_map)
      begin_probation();
    else if (probation_ && --probation_->left <= 0)
      probation_.reset();
  }
  void begin_probation() {
    constexpr double frames = 5;
    probation_ = Trial{probation_ ? probation_->first_pose : poses_.size(), frames};
  }

  // The first frame is the world; it needs enough points that may be static. After some time of being lost the map is
  // left alone, and a new one begins: its poses have nothing to do with those before until the camera sees the old one
  // again.
  bool begin_map(Frame& frame, FrameRecord& record) {
    std::size_t usable = 0;
    for (std::size_t i = 0; i < frame.size(); ++i) usable += mapping_.may_create(frame, i) ? 1U : 0U;
    if (usable < options_.min_initial_points) return false;
    record.outcome = Outcome::tracked;
    if (!map_.keyframes.empty()) {
      std::fill(frame.map_point.begin(), frame.map_point.end(), no_point);
      map_.begin_world();
      frames_since_join_ = 0;
      T_other_world_.reset();
      trial_ = Trial{poses_.size(), lost_s_};
      record.outcome = Outcome::relocalised;
      record.add_note("new map");
    }
    frame.T_cam_world = {};
    frame.has_pose = true;
    pose_ = {};
    pose_.inliers = usable;
    make_keyframe(frame, map_.newest_world(), record);
    return true;
  }

  // Looks for the other maps now and then. Two finds in a row that agree join the younger of the two maps to the older
  // one, or do without it, if it is on trial.
  void join_worlds(Frame& frame, FrameRecord& record) {
    constexpr int interval = 5;  // frames
    const auto is_other = [&](int k) { return map_.keyframe(k).world != reference().world; };
    if (probation_ || ++frames_since_join_ % interval != 0 ||
        std::none_of(map_.alive_keyframes.begin(), map_.alive_keyframes.end(), is_other))
      return;
    const auto found = localization_.find_elsewhere(frame, reference().world);
    std::optional<cfp::SE3<double>> T_other_world;
    if (found) T_other_world = found->frame.T_cam_world.inverse() * frame.T_cam_world;
    if (T_other_world && T_other_world_ && agree(*T_other_world, *T_other_world_, frame))
      join_world(*found, *T_other_world, frame, record);
    T_other_world_ = T_other_world;
  }
  void join_world(const Localization::Elsewhere& found, const cfp::SE3<double>& T_other_world, Frame& frame,
                  FrameRecord& record) {
    const auto [older, newer] = std::minmax({reference().world, map_.keyframe(found.reference).world});
    const bool to_older = newer == reference().world;
    take_bundle(true);
    if (to_older) {
      last_.T_cam_world = last_.T_cam_world * T_other_world.inverse();
      frame = found.frame;
      pose_ = found.pose;
      local_map_.reference = found.reference;
    }
    if (trial_) {
      end_trial(record);
      begin_probation();
    } else {
      const auto joined = map_.join(newer, older, to_older ? T_other_world : T_other_world.inverse());
      record.add_note("joined to the old map");
      take_back_what_has_gone(joined, frame, record);
    }
  }
  // What filled the view while a map was on its own may have moved since: the poses by it were none in the room.
  void take_back_what_has_gone(std::vector<int> keyframes, const Frame& frame, FrameRecord& record) {
    remove_where(keyframes, [&](int k) { return !has_gone(map_, k, frame, localization_.grid(), view_); });
    if (keyframes.empty()) return;
    poses_.take_back_of(keyframes, map_);
    for (const int k : keyframes) map_.erase_keyframe(k);
    record.add_note("poses by what has gone since are taken back");
  }
  // Where the camera of a frame is by two transformations.
  static bool agree(const cfp::SE3<double>& a, const cfp::SE3<double>& b, const Frame& frame) {
    const cfp::SE3<double> difference = (a * frame.T_cam_world.inverse()).inverse() * (b * frame.T_cam_world.inverse());
    return difference.translation.norm() < 0.05 && cfp::so3_log(difference.rotation).norm() < 0.03;
  }

  void extend_map(Frame& frame, FrameRecord& record) {
    const bool apart = reference().world != map_.keyframe(map_.alive_keyframes.front()).world;
    record.outcome = probation_ || apart ? Outcome::relocalised : Outcome::tracked;
    update_points(map_, frame, probability_, !probation_, detector_.ok());
    ++frames_since_keyframe_;
    if (!probation_ && mapping_.wants_keyframe(map_, frame, local_map_.reference, pose_.in_map, frames_since_keyframe_))
      make_keyframe(frame, reference().world, record);
  }

  void make_keyframe(Frame& frame, int world, FrameRecord& record) {
    take_bundle(true);
    const int keyframe = mapping_.insert(map_, frame, world, view_);
    local_map_.reference = keyframe;
    mapping_.cull(map_);
    frame.map_point = map_.keyframe(keyframe).frame.map_point;
    frame.map_point_probability = map_.keyframe(keyframe).frame.map_point_probability;
    map_.recycle();
    record.keyframe = true;
    frames_since_keyframe_ = 0;
    if (map_.keyframes.size() < 2) return;
    bundle_ = std::make_unique<LocalBundle>(map_, keyframe, view_);
    frames_since_bundle_ = 0;
    adjusted_ = std::async(options_.threads ? std::launch::async : std::launch::deferred, [this] {
      const Part part(observer_, Module::bundle_adjustment);
      bundle_->solve();
    });
  }

  // The result of the bundle adjustment under way is taken a fixed number of frames after its start, or now, whether it
  // was ready earlier or not: so the same images give the same poses however many threads there are. The last frame
  // moves with its reference.
  void take_bundle(bool now) {
    if (bundle_ == nullptr || (!now && ++frames_since_bundle_ < Mapping::min_gap)) return;
    adjusted_.get();
    const cfp::SE3<double> T_cam_reference = last_.T_cam_world * reference().frame.T_cam_world.inverse();
    bundle_->apply(map_);
    bundle_.reset();
    if (last_.has_pose) last_.T_cam_world = T_cam_reference * reference().frame.T_cam_world;
  }

  // Its world is the camera's, if that has a pose.
  [[nodiscard]] const Keyframe& reference() const { return map_.keyframe(local_map_.reference); }

  Options options_;
  View view_;
  Observer& observer_;
  cfp::StaticProbability<Camera> probability_;
  Map map_;
  DetectorWatch detector_;
  Localization localization_;
  LocalMap local_map_;
  Mapping mapping_;
  PoseHistory poses_;

  Frame last_;
  cfp::FrameInterval interval_;           // the motion model is not asked over a gap
  RefinedPose pose_;                      // of this frame
  std::optional<BelievedPose> believed_;  // the last of all frames
  double lost_s_ = 0;                     // since then
  int frames_since_keyframe_ = 0;

  std::optional<Trial> trial_, probation_;         // of the newest map, of a pose from the map alone
  std::optional<cfp::SE3<double>> T_other_world_;  // of the last look for other maps
  int frames_since_join_ = 0;

  std::unique_ptr<LocalBundle> bundle_;  // under way
  int frames_since_bundle_ = 0;
  std::future<void> adjusted_;  // destroyed first: it waits for the thread
};

}  // namespace cfp_slam
