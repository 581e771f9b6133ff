// The tracking thread: one frame in, its pose out. The order is the paper's; the probabilities come from
// cfp::StaticProbabilityPipeline, which asks this class for a pose twice per frame.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>

#include "../record.hpp"
#include "cfp/frame/static_probability_pipeline.hpp"
#include "cfp/geometry/radial_tangential_camera.hpp"
#include "cfp/interop/opencv.hpp"
#include "cfp/optimization/pose/pose_refinement.hpp"
#include "local_bundle.hpp"
#include "mapping.hpp"
#include "matching.hpp"
#include "options.hpp"
#include "relocalization.hpp"
#include "stopwatch.hpp"

namespace cfp_slam {

// What the front end made of a frame.
struct FrameFeatures {
  double time_s = 0;
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
  std::vector<std::array<float, 2>> pixels;  // without distortion
  std::vector<float> depths_m;
  std::vector<cv::Point2f> flow_from, flow_to;
  std::vector<cfp::Detection<float>> detections;
};

class Tracking {
 public:
  Tracking(const cfp::RadialTangentialCamera<float>& camera, int width, int height, const TrackingOptions& options)
      : options_(options),
        camera_(camera),
        pinhole_(camera.pinhole()),
        solver_camera_{camera.fx, camera.fy, camera.cx, camera.cy},
        width_(width),
        height_(height),
        pipeline_(options.pipeline),
        mapping_(options.mapping, options.features, pinhole_),
        relocalization_(options.seed) {}

  // The outcome goes into the record, which will be the record_index-th of the run. observe(PipelineStep, FrameResult,
  // Frame): for recordings.
  template <typename Observer>
  void track(FrameFeatures&& features, FrameRecord& record, std::size_t record_index, Observer&& observe) {
    Stopwatch watch(record.milliseconds);
    record_index_ = record_index;
    finish_bundle(false);
    record.milliseconds[static_cast<std::size_t>(Module::bundle_adjustment)] = bundle_milliseconds_;
    Frame frame = begin_frame(features);
    grid_.build(frame, width_, height_);
    predict(frame.time_s);
    match_last_frame(frame);
    watch.lap(Module::matching);

    cfp::FrameInput<float> input;
    input.timestamp_s = frame.time_s;
    input.keypoints = cfp::view(frame.keypoints);
    input.depths_m = frame.depths_m;
    input.detections = features.detections;
    input.flow_previous = cfp::view(features.flow_from);
    input.flow_current = cfp::view(features.flow_to);
    if (last_.has_pose) input.match = match_;
    input.map_point_probability = frame.map_point_probability;
    if (has_image_motion_) input.image_motion = &image_motion_;
    relocalised_ = false;
    searched_ = false;
    const auto solve = [&](cfp::Stage stage, cfp::span<const float> weight) {
      return stage == cfp::Stage::first ? solve_first(frame, weight) : solve_second(frame, weight, watch);
    };
    const cfp::FrameResult<float> result =
        pipeline_.process(input, camera_, solve, [&](cfp::PipelineStep step, const cfp::FrameResult<float>& known) {
          watch.lap(module_of(step));
          observe(step, known, frame);
        });
    frame.static_probability.assign(result.static_probability.begin(), result.static_probability.end());
    if (frame.has_pose && !searched_)
      solve_second(frame, result.weight, watch);  // no second stage: the last frame has no pose, or nothing matched
    watch.lap(Module::pose);
    finish_frame(frame, record, result);
    watch.lap(Module::mapping);
  }

  // Puts the last bundle adjustment's result into the map and gives every record its final pose: relative to its
  // reference keyframe, as ORB-SLAM2 writes trajectories.
  void finish(std::vector<FrameRecord>& records) {
    finish_bundle(true);
    for (const auto& [index, pose] : poses_)
      records[index].T_world_cam = (pose.T_cam_reference * map_.keyframe(pose.reference).frame.T_cam_world).inverse();
  }
  [[nodiscard]] const Map& map() const { return map_; }
  [[nodiscard]] const Frame& last_frame() const { return last_; }

 private:
  struct RelativePose {
    int reference = 0;
    cfp::SE3<double> T_cam_reference;
  };

  static Module module_of(cfp::PipelineStep step) {
    switch (step) {
      case cfp::PipelineStep::boxes:
        return Module::boxes;
      case cfp::PipelineStep::objects:
        return Module::objects;
      case cfp::PipelineStep::first_keypoints:
        return Module::keypoints_first;
      case cfp::PipelineStep::second_keypoints:
        return Module::keypoints_second;
      case cfp::PipelineStep::first_pose:
      case cfp::PipelineStep::second_pose:
        break;
    }
    return Module::pose;
  }

  Frame begin_frame(FrameFeatures& features) const {
    Frame frame;
    const std::size_t n = features.keypoints.size();
    frame.time_s = features.time_s;
    frame.keypoints = std::move(features.keypoints);
    frame.pixels = std::move(features.pixels);
    frame.depths_m = std::move(features.depths_m);
    frame.descriptors.resize(n);
    for (std::size_t i = 0; i < n; ++i) frame.descriptors[i] = descriptor_row(features.descriptors, i);
    frame.static_probability.assign(n, 1.0F);
    frame.map_point_probability.assign(n, -1.0F);
    frame.map_point.assign(n, no_point);
    return frame;
  }

  // Constant velocity. The rotation also moves the boxes of the tracker, whose own motion model knows nothing of the
  // camera.
  void predict(double time_s) {
    predicted_ = last_.T_cam_world;
    has_image_motion_ = false;
    if (!last_.has_pose || !has_velocity_ || !(time_s > last_.time_s)) return;
    const cfp::SE3<double> motion = cfp::se3_exp<double>(velocity_ * std::min(time_s - last_.time_s, 0.2));
    predicted_ = motion * last_.T_cam_world;
    cfp::Matrix3<float> K = cfp::Matrix3<float>::Identity();
    K(0, 0) = pinhole_.fx;
    K(1, 1) = pinhole_.fy;
    K(0, 2) = pinhole_.cx;
    K(1, 2) = pinhole_.cy;
    image_motion_ = K * motion.rotation.cast<float>() * K.inverse();
    has_image_motion_ = true;
  }

  // Points of the last frame, in the map or known from its depth alone, found in this one.
  void match_last_frame(Frame& frame) {
    match_.assign(frame.size(), cfp::no_match);
    if (!last_.has_pose) return;
    expected_.clear();
    last_points_.assign(last_.size(), cfp::Vector3<double>::Zero());
    const cfp::SE3<double> T_world_last = last_.T_cam_world.inverse();
    for (std::size_t j = 0; j < last_.size(); ++j) {
      const bool mapped = map_.is_alive(last_.map_point[j]);
      if (!mapped && !(last_.depths_m[j] > 0)) continue;
      last_points_[j] =
          mapped ? map_.point(last_.map_point[j]).position : T_world_last * last_.back_project(j, pinhole_);
      cfp::Vector2<double> pixel;
      if (!solver_camera_.project(predicted_ * last_points_[j], pixel) || !in_image(pixel)) continue;
      const int level = last_.keypoints[j].octave;
      expected_.push_back({float(pixel.x()), float(pixel.y()), level, options_.search_radius * sigma(level),
                           &last_.descriptors[j], last_.keypoints[j].angle, static_cast<int>(j)});
    }
    const auto all = [](std::size_t) { return true; };
    match_expected(frame, grid_, expected_, far_descriptor, 1.0F, all, matches_);
    if (matches_.size() < 2 * options_.min_inliers) {
      for (Expected& e : expected_) e.radius *= 2;
      match_expected(frame, grid_, expected_, far_descriptor, 1.0F, all, matches_);
    }
    keep_common_turn(matches_);
    for (const Match& m : matches_) {
      const auto j = static_cast<std::size_t>(m.index);
      match_[m.keypoint] = m.index;
      const bool mapped = map_.is_alive(last_.map_point[j]);
      if (mapped) frame.map_point[m.keypoint] = last_.map_point[j];
      frame.map_point_probability[m.keypoint] =
          mapped ? map_.point(last_.map_point[j]).static_probability : last_.map_point_probability[j];
    }
  }

  cfp::PoseEstimate solve_first(Frame& frame, cfp::span<const float> weight) {
    if (map_.keyframes.empty()) return {};
    frame.T_cam_world = predicted_;
    const std::size_t inliers = last_.has_pose ? refine(frame, weight, false) : 0;
    frame.has_pose = inliers >= options_.min_first_inliers;
    if (!frame.has_pose) {
      relocalised_ = frame.has_pose = relocalization_(frame, map_, local_points_, weight, pinhole_);
      if (frame.has_pose) frame.has_pose = refine(frame, weight, false) >= options_.min_first_inliers;
    }
    return {frame.T_cam_world * last_.T_cam_world.inverse(), inliers, frame.has_pose && last_.has_pose};
  }

  cfp::PoseEstimate solve_second(Frame& frame, cfp::span<const float> weight, Stopwatch& watch) {
    searched_ = true;
    search_local_map(frame);
    watch.lap(Module::matching);
    inliers_ = refine(frame, weight, true);
    frame.has_pose = inliers_ >= options_.min_inliers;
    return {frame.T_cam_world * last_.T_cam_world.inverse(), inliers_, frame.has_pose};
  }

  // Weighted pose refinement over everything the frame sees. Outliers lose their map point when `prune`. Returns the
  // number of inliers that count (weight above a tenth); the pose is left alone when there is none.
  std::size_t refine(Frame& frame, cfp::span<const float> weight, bool prune) {
    points_.clear();
    pixels_.clear();
    depths_.clear();
    sigmas_.clear();
    weights_.clear();
    keypoint_.clear();
    for (std::size_t i = 0; i < frame.size(); ++i) {
      const bool mapped = map_.is_alive(frame.map_point[i]);
      if (!mapped && match_[i] == cfp::no_match) continue;
      const cfp::Vector3<double>& X =
          mapped ? map_.point(frame.map_point[i]).position : last_points_[static_cast<std::size_t>(match_[i])];
      points_.push_back({X.x(), X.y(), X.z()});
      pixels_.push_back({static_cast<double>(frame.pixels[i][0]), static_cast<double>(frame.pixels[i][1])});
      depths_.push_back(static_cast<double>(frame.depths_m[i]));
      sigmas_.push_back(static_cast<double>(sigma(frame.keypoints[i].octave)));
      // Points found in the local map have no M in the pipeline's weight yet.
      const float m = mapped && match_[i] == cfp::no_match ? map_.point(frame.map_point[i]).static_probability : 1.0F;
      weights_.push_back(static_cast<double>(weight[i] * m));
      keypoint_.push_back(i);
    }
    cfp::PoseObservations<double> observations;
    observations.points = points_;
    observations.pixels = pixels_;
    observations.weights = weights_;
    observations.sigmas = sigmas_;
    observations.depths = depths_;
    observations.baseline_fx = options_.baseline_fx;
    inlier_.resize(keypoint_.size());
    const cfp::PoseResult result = cfp::refine_pose(observations, solver_camera_, frame.T_cam_world, options_.pose,
                                                    pose_workspace_, cfp::span<char>(inlier_));
    if (!cfp::is_solved(result.status)) return 0;
    frame.T_cam_world = result.T_cam_world;
    std::size_t count = 0;
    for (std::size_t o = 0; o < keypoint_.size(); ++o) {
      if (inlier_[o] != 0) {
        count += weights_[o] > 0.1 ? 1U : 0U;
      } else if (prune) {
        frame.map_point[keypoint_[o]] = no_point;
      }
    }
    return count;
  }

  // The points of the keyframes around, projected into the frame; those not matched yet are searched for.
  void search_local_map(Frame& frame) {
    collect_local_points(frame);
    seen_.assign(map_.points.size(), 0);
    for (const int p : frame.map_point) {
      if (map_.is_alive(p)) seen_[static_cast<std::size_t>(p)] = 1;
    }
    const cfp::Vector3<double> centre = frame.T_cam_world.inverse().translation;
    const double log_scale = std::log(static_cast<double>(options_.features.scale_factor));
    expected_.clear();
    for (const int p : local_points_) {
      MapPoint& point = map_.point(p);
      if (seen_[static_cast<std::size_t>(p)] != 0) {
        ++point.in_view;
        continue;
      }
      cfp::Vector2<double> pixel;
      if (!solver_camera_.project(frame.T_cam_world * point.position, pixel) || !in_image(pixel)) continue;
      const cfp::Vector3<double> ray = point.position - centre;
      const double distance = ray.norm(), cosine = ray.dot(point.normal) / distance;
      const int level =
          static_cast<int>(std::ceil(std::log(static_cast<double>(point.max_distance) / distance) / log_scale - 0.5));
      if (cosine < 0.5 || level < -1 || level > options_.features.levels) continue;
      ++point.in_view;
      const int clamped = std::clamp(level, 0, options_.features.levels - 1);
      const float radius = (cosine > 0.998 ? 2.5F : 4.0F) * (relocalised_ ? 5.0F : 3.0F) * sigma(clamped);
      expected_.push_back({float(pixel.x()), float(pixel.y()), clamped, radius, &point.descriptor, -1, p});
    }
    match_expected(
        frame, grid_, expected_, far_descriptor, 0.8F,
        [&](std::size_t i) { return !map_.is_alive(frame.map_point[i]); }, matches_);
    for (const Match& m : matches_) frame.map_point[m.keypoint] = m.index;
  }

  void collect_local_points(const Frame& frame) {
    std::vector<int> keyframes = map_.covisible(frame.map_point, 1);
    if (!keyframes.empty()) reference_ = keyframes.front();
    constexpr std::size_t nearest = 20, most = 30;
    if (keyframes.size() > nearest) keyframes.resize(nearest);
    for (std::size_t k = 0, direct = keyframes.size(); k < direct && keyframes.size() < most; ++k) {
      for (const int neighbour : map_.keyframe(keyframes[k]).neighbours) {
        if (std::find(keyframes.begin(), keyframes.end(), neighbour) != keyframes.end()) continue;
        keyframes.push_back(neighbour);
        break;
      }
    }
    local_points_.clear();
    seen_.assign(map_.points.size(), 0);
    for (const int k : keyframes) {
      for (const int p : map_.keyframe(k).frame.map_point) {
        if (!map_.is_alive(p) || seen_[static_cast<std::size_t>(p)] != 0) continue;
        seen_[static_cast<std::size_t>(p)] = 1;
        local_points_.push_back(p);
      }
    }
  }

  // The map learns from the frame, a keyframe is made when one is needed, and the frame becomes the last one.
  void finish_frame(Frame& frame, FrameRecord& record, const cfp::FrameResult<float>& result) {
    if (map_.keyframes.empty()) {
      initialize(frame, record);
    } else if (frame.has_pose) {
      record.outcome = relocalised_ ? Outcome::relocalised : Outcome::tracked;
      update_points(frame);
      ++frames_since_keyframe_;
      if (mapping_.wants_keyframe(map_, frame, reference_, inliers_, frames_since_keyframe_))
        make_keyframe(frame, record);
    } else {
      record.outcome = Outcome::lost;
      record.note = inliers_ > 0 ? "too few inliers" : "no pose agrees with the map";
    }
    if (frame.has_pose) {
      poses_.push_back(
          {record_index_, {reference_, frame.T_cam_world * map_.keyframe(reference_).frame.T_cam_world.inverse()}});
      record.T_world_cam = frame.T_cam_world.inverse();
    }
    record.keypoints = frame.size();
    record.matches = static_cast<std::size_t>(
        std::count_if(match_.begin(), match_.end(), [](std::int32_t j) { return j != cfp::no_match; }));
    record.inliers = inliers_;
    record.health = result.health;
    has_velocity_ = frame.has_pose && last_.has_pose && frame.time_s > last_.time_s;
    if (has_velocity_)
      velocity_ = cfp::se3_log<double>(frame.T_cam_world * last_.T_cam_world.inverse()) / (frame.time_s - last_.time_s);
    inliers_ = 0;
    last_ = std::move(frame);
  }

  // The first frame is the world. It needs enough points that may be static.
  void initialize(Frame& frame, FrameRecord& record) {
    std::size_t usable = 0;
    for (std::size_t i = 0; i < frame.size(); ++i)
      usable +=
          frame.depths_m[i] > 0 && frame.static_probability[i] >= options_.mapping.min_static_probability ? 1U : 0U;
    if (usable < options_.min_initial_points) {
      record.outcome = Outcome::lost;
      record.note = "waiting for " + std::to_string(options_.min_initial_points) +
                    " static points with depth, this frame has " + std::to_string(usable);
      return;
    }
    frame.T_cam_world = {};
    frame.has_pose = true;
    inliers_ = usable;
    record.outcome = Outcome::tracked;
    make_keyframe(frame, record);
  }

  // M of what the frame sees, from the pipeline for what the last frame saw, too, from K alone for what the local map
  // added.
  void update_points(Frame& frame) {
    const cfp::MapPointOptions& policy = options_.pipeline.second.map_point;
    for (std::size_t i = 0; i < frame.size(); ++i) {
      const bool mapped = map_.is_alive(frame.map_point[i]);
      float& m = frame.map_point_probability[i];
      if (mapped) {
        MapPoint& point = map_.point(frame.map_point[i]);
        ++point.found;
        point.static_probability =
            match_[i] != cfp::no_match && m >= 0
                ? m
                : cfp::updated_map_point(frame.static_probability[i], point.static_probability, policy);
        m = point.static_probability;
        if (cfp::is_deletable(m, policy)) {
          map_.erase_point(frame.map_point[i]);
          frame.map_point[i] = no_point;
        }
      } else {
        frame.map_point[i] = no_point;
        if (!(m >= 0)) m = frame.static_probability[i];
      }
    }
  }

  void make_keyframe(Frame& frame, FrameRecord& record) {
    finish_bundle(true);
    reference_ = mapping_.insert(map_, frame);
    frame.map_point = map_.keyframe(reference_).frame.map_point;
    frame.map_point_probability = map_.keyframe(reference_).frame.map_point_probability;
    mapping_.cull(map_);
    record.keyframe = true;
    frames_since_keyframe_ = 0;
    if (map_.keyframes.size() > 1) start_bundle();
  }

  void start_bundle() {
    bundle_ = std::make_unique<LocalBundle>(map_, reference_, pinhole_, mapping_.sigmas(), options_.baseline_fx,
                                            options_.bundle);
    frames_since_bundle_ = 0;
    if (options_.threads) {
      bundle_thread_ = std::async(std::launch::async, [bundle = bundle_.get()] { bundle->solve(); });
    } else {
      bundle_->solve();
    }
  }

  // Hands the result over `min_gap` frames after the start, whenever it was ready. The last frame moves with its
  // reference.
  void finish_bundle(bool now) {
    bundle_milliseconds_ = 0;
    if (bundle_ == nullptr || (!now && ++frames_since_bundle_ < options_.mapping.min_gap)) return;
    if (bundle_thread_.valid()) bundle_thread_.get();
    const cfp::SE3<double> T_cam_reference = last_.T_cam_world * map_.keyframe(reference_).frame.T_cam_world.inverse();
    bundle_->apply(map_);
    if (last_.has_pose) last_.T_cam_world = T_cam_reference * map_.keyframe(reference_).frame.T_cam_world;
    bundle_milliseconds_ = bundle_->milliseconds();
    bundle_.reset();
  }

  [[nodiscard]] float sigma(int level) const { return mapping_.sigmas()[static_cast<std::size_t>(level)]; }
  [[nodiscard]] bool in_image(const cfp::Vector2<double>& pixel) const {
    return pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < width_ && pixel.y() < height_;
  }

  TrackingOptions options_;
  cfp::RadialTangentialCamera<float> camera_;
  cfp::PinholeCamera<float> pinhole_;
  cfp::PinholeCamera<double> solver_camera_;
  int width_, height_;
  cfp::StaticProbabilityPipeline<float> pipeline_;
  Mapping mapping_;
  Relocalization relocalization_;
  Map map_;
  std::unique_ptr<LocalBundle> bundle_;
  std::future<void> bundle_thread_;
  int frames_since_bundle_ = 0, frames_since_keyframe_ = 0;
  double bundle_milliseconds_ = 0;

  Frame last_;
  std::vector<cfp::Vector3<double>> last_points_;  // world, of the last frame's keypoints
  cfp::Vector6<double> velocity_;
  bool has_velocity_ = false, has_image_motion_ = false, relocalised_ = false, searched_ = false;
  cfp::SE3<double> predicted_;
  cfp::Matrix3<float> image_motion_;
  int reference_ = 0;
  std::size_t inliers_ = 0, record_index_ = 0;
  std::vector<std::pair<std::size_t, RelativePose>> poses_;

  KeypointGrid grid_;
  std::vector<std::int32_t> match_;
  std::vector<Expected> expected_;
  std::vector<Match> matches_;
  std::vector<int> local_points_;
  std::vector<char> seen_, inlier_;
  std::vector<std::array<double, 3>> points_;
  std::vector<std::array<double, 2>> pixels_;
  std::vector<double> depths_, sigmas_, weights_;
  std::vector<std::size_t> keypoint_;
  cfp::PoseWorkspace<double> pose_workspace_;
};

}  // namespace cfp_slam
