// Local bundle adjustment beside the tracking: the newest keyframe, its covisible neighbours and their points are
// copied out, adjusted on another thread, and put back a fixed number of frames later. Since the frame of the hand-over
// does not depend on how long the solver takes, the same images give the same poses however many threads there are.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <future>
#include <memory>
#include <unordered_map>
#include <vector>

#include "cfp/optimization/bundle/bundle_adjustment.hpp"
#include "map.hpp"
#include "observer.hpp"
#include "options.hpp"

extern template cfp::BundleResult cfp::adjust_bundle(const BundleProblem<PinholeCamera<double>, float>&,
                                                     const BundleOptions&, BundleWorkspace&, span<double>);

namespace cfp_slam {

class LocalBundle {
 public:
  // Copies the problem around keyframe `newest` out of the map.
  LocalBundle(const Map& map, int newest, const View& view, const LocalBundleOptions& options)
      : options_(options), baseline_fx_(view.baseline_fx), camera_(view.exact) {
    choose_keyframes(map, newest);
    for (std::size_t k = 0; k < keyframes_.size(); ++k) {
      const Frame& frame = map.keyframe(keyframes_[k]).frame;
      poses_.push_back(frame.T_cam_world);
      for (std::size_t i = 0; i < frame.size(); ++i) {
        const auto known = point_slot_.find(frame.map_point[i]);
        if (known != point_slot_.end()) add_observation(map, frame, i, static_cast<int>(k), known->second, view);
      }
    }
  }

  void solve() {
    cfp::BundleProblem<cfp::PinholeCamera<double>, float> problem;
    problem.poses = poses_;
    problem.points = positions_;
    problem.cameras = {&camera_, 1};
    problem.observations = {pose_index_, point_index_, pixels_, u_right_, sigma_, weight_};
    problem.fixed_poses = fixed_;
    problem.baseline_fx = baseline_fx_;
    cfp::BundleOptions options;
    options.levenberg_marquardt.max_iterations = options_.max_iterations;
    squared_errors_.resize(pose_index_.size());
    cfp::BundleWorkspace workspace;
    (void)cfp::adjust_bundle(problem, options, workspace, squared_errors_);
  }

  // Writes poses and points back and forgets the observations that do not fit. What has gone from the map meanwhile
  // stays away. Where few points tie the newest keyframe to the others, the result may be far off: then it is left.
  void apply(Map& map) const {
    const cfp::SE3<double>& before = map.keyframe(keyframes_.front()).frame.T_cam_world;
    if (!((poses_.front().inverse().translation - before.inverse().translation).norm() <= options_.max_shift_m)) return;
    for (std::size_t k = 0; k < keyframes_.size(); ++k) {
      if (fixed_[k] == 0) map.keyframe(keyframes_[k]).frame.T_cam_world = poses_[k];
    }
    for (std::size_t p = 0; p < points_.size(); ++p) {
      if (map.is_alive(points_[p])) map.point(points_[p]).position = positions_[p];
    }
    for (std::size_t o = 0; o < squared_errors_.size(); ++o) {
      const double limit = u_right_[o] > 0 ? 7.815 : 5.991;
      const int point = points_[static_cast<std::size_t>(point_index_[o])];
      if (map.is_alive(point) && !(squared_errors_[o] >= 0 && squared_errors_[o] <= limit))
        map.erase_observation(point, keyframes_[static_cast<std::size_t>(pose_index_[o])]);
    }
  }

 private:
  // Free: the newest keyframe and its neighbours, but never the first of all, which is the world's origin. Fixed:
  // others that see their points.
  void choose_keyframes(const Map& map, int newest) {
    keyframes_ = {newest};
    for (const int k : map.keyframe(newest).neighbours) {
      if (keyframes_.size() < options_.free_keyframes && k != newest) keyframes_.push_back(k);
    }
    const std::size_t free = keyframes_.size();
    for (std::size_t k = 0; k < free; ++k) {
      for (const int point : map.keyframe(keyframes_[k]).frame.map_point) {
        if (!map.is_alive(point) || !point_slot_.try_emplace(point, static_cast<int>(points_.size())).second) continue;
        points_.push_back(point);
        positions_.push_back(map.point(point).position);
      }
    }
    for (const int k : map.covisible(points_, 10)) {
      if (keyframes_.size() >= free + options_.fixed_keyframes) break;
      if (std::find(keyframes_.begin(), keyframes_.end(), k) == keyframes_.end()) keyframes_.push_back(k);
    }
    fixed_.assign(keyframes_.size(), char(1));
    for (std::size_t k = 0; k < free; ++k) fixed_[k] = keyframes_[k] == 0 ? char(1) : char(0);
  }

  void add_observation(const Map& map, const Frame& frame, std::size_t i, int pose, int point, const View& view) {
    pose_index_.push_back(pose);
    point_index_.push_back(point);
    pixels_.push_back(frame.pixels[i]);
    const float z = frame.depths_m[i];
    u_right_.push_back(z > 0 ? frame.pixels[i][0] - static_cast<float>(baseline_fx_) / z : -1.0F);
    sigma_.push_back(view.sigma(frame.keypoints[i]));
    weight_.push_back(frame.static_probability[i] * map.point(frame.map_point[i]).static_probability);
  }

  LocalBundleOptions options_;
  double baseline_fx_;
  cfp::PinholeCamera<double> camera_;
  std::vector<int> keyframes_, points_;  // indices into the map
  std::vector<char> fixed_;
  std::unordered_map<int, int> point_slot_;
  std::vector<cfp::SE3<double>> poses_;
  std::vector<cfp::Vector3<double>> positions_;
  std::vector<int> pose_index_, point_index_;
  std::vector<std::array<float, 2>> pixels_;
  std::vector<float> u_right_, sigma_, weight_;
  std::vector<double> squared_errors_;
};

// One bundle adjustment at a time, beside the tracking or at once.
class BundleThread {
 public:
  void start(const Map& map, int newest, const View& view, const LocalBundleOptions& options, bool beside,
             Observer& observer) {
    bundle_ = std::make_unique<LocalBundle>(map, newest, view, options);
    frames_since_ = 0;
    solved_ = std::async(beside ? std::launch::async : std::launch::deferred, [bundle = bundle_.get(), &observer] {
      const Part part(observer, Module::bundle_adjustment);
      bundle->solve();
    });
    if (!beside) solved_.wait();
  }

  // Once per frame: whether a result is to be taken, `delay` frames after the start or `now`, whenever it was ready.
  [[nodiscard]] bool is_due(bool now, int delay) { return bundle_ != nullptr && (now || ++frames_since_ >= delay); }

  // Precondition: is_due.
  void finish(Map& map) {
    solved_.get();
    bundle_->apply(map);
    bundle_.reset();
  }

 private:
  std::unique_ptr<LocalBundle> bundle_;
  std::future<void> solved_;  // destroyed first: it waits for the thread
  int frames_since_ = 0;
};

}  // namespace cfp_slam
