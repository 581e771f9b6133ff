// Local bundle adjustment beside the tracking: the newest keyframe, its covisible neighbours and their points are
// copied out, adjusted on any thread, and put back.
#pragma once

#include <algorithm>
#include <array>
#include <unordered_map>
#include <vector>

#include "cfp/optimization/bundle/bundle_adjustment.hpp"
#include "map.hpp"

namespace cfp_slam {

class LocalBundle {
 public:
  // Copies the problem around keyframe `newest` out of the map.
  LocalBundle(const Map& map, int newest, const View& view) : view_(view) {
    options_.levenberg_marquardt.max_iterations = 10;
    choose_keyframes(map, newest);
    for (std::size_t k = 0; k < keyframes_.size(); ++k) {
      const Frame& frame = map.keyframe(keyframes_[k]).frame;
      poses_.push_back(frame.T_cam_world);
      for (std::size_t i = 0; i < frame.size(); ++i) {
        const auto known = point_slot_.find(frame.map_point[i]);
        if (known != point_slot_.end()) add_observation(map, frame, i, static_cast<int>(k), known->second);
      }
    }
  }

  void solve() {
    cfp::BundleProblem<cfp::PinholeCamera<double>, float> problem;
    problem.poses = poses_;
    problem.points = positions_;
    problem.cameras = {&view_.exact, 1};
    problem.observations.pose = pose_index_;
    problem.observations.point = point_index_;
    problem.observations.pixels = pixels_;
    problem.observations.depths = depths_;
    problem.observations.sigmas = sigma_;
    problem.observations.weights = weight_;
    problem.fixed_poses = fixed_;
    problem.baseline_fx = view_.baseline_fx;
    squared_errors_.resize(pose_index_.size());
    cfp::BundleWorkspace workspace;
    (void)cfp::adjust_bundle(problem, options_, workspace, squared_errors_);
  }

  // Writes poses and points back and forgets the observations that do not fit. What has gone from the map meanwhile
  // stays away. Where few points tie the newest keyframe to the others, the result may be far off: then it is left.
  void apply(Map& map) const {
    constexpr double max_shift_m = 0.075;  // farther, and it contradicts the pose that was believed
    const cfp::SE3<double>& before = map.keyframe(keyframes_.front()).frame.T_cam_world;
    if (!((poses_.front().inverse().translation - before.inverse().translation).norm() <= max_shift_m)) return;
    for (std::size_t k = 0; k < keyframes_.size(); ++k) {
      if (fixed_[k] == 0) map.keyframe(keyframes_[k]).frame.T_cam_world = poses_[k];
    }
    for (std::size_t p = 0; p < points_.size(); ++p) {
      if (MapPoint* const point = map.find(points_[p])) point->position = positions_[p];
    }
    for (std::size_t o = 0; o < squared_errors_.size(); ++o) {
      const double limit = depths_[o] > 0 ? options_.chi2_stereo : options_.chi2_mono;
      const int point = points_[static_cast<std::size_t>(point_index_[o])];
      if (map.is_alive(point) && !(squared_errors_[o] >= 0 && squared_errors_[o] <= limit))
        map.erase_observation(point, keyframes_[static_cast<std::size_t>(pose_index_[o])]);
    }
  }

 private:
  // Free: the newest keyframe and its neighbours, but never the first of all, which is the world's origin. Fixed:
  // others that see their points, which hold the gauge.
  void choose_keyframes(const Map& map, int newest) {
    constexpr std::size_t most_free = 10, most_fixed = 10;
    keyframes_ = {newest};
    for (const int k : map.keyframe(newest).neighbours) {
      if (keyframes_.size() < most_free) keyframes_.push_back(k);
    }
    const std::size_t free = keyframes_.size();
    for (const int k : keyframes_) {
      for (const int point : map.keyframe(k).frame.map_point) {
        if (!map.is_alive(point) || !point_slot_.try_emplace(point, static_cast<int>(points_.size())).second) continue;
        points_.push_back(point);
        positions_.push_back(map.point(point).position);
      }
      fixed_.push_back(k == 0 ? char(1) : char(0));
    }
    for (const int k : map.covisible(points_, 10)) {
      if (keyframes_.size() >= free + most_fixed) break;
      if (std::find(keyframes_.begin(), keyframes_.end(), k) == keyframes_.end()) keyframes_.push_back(k);
    }
    fixed_.resize(keyframes_.size(), char(1));
  }

  void add_observation(const Map& map, const Frame& frame, std::size_t i, int pose, int point) {
    pose_index_.push_back(pose);
    point_index_.push_back(point);
    pixels_.push_back(frame.pixels[i]);
    depths_.push_back(frame.depths_m[i]);
    sigma_.push_back(view_.sigma(frame.keypoints[i]));
    weight_.push_back(frame.static_probability[i] * map.point(frame.map_point[i]).static_probability);
  }

  View view_;
  cfp::BundleOptions options_;
  std::vector<int> keyframes_, points_;  // indices into the map; the newest keyframe first
  std::vector<char> fixed_;
  std::unordered_map<int, int> point_slot_;
  std::vector<cfp::SE3<double>> poses_;
  std::vector<cfp::Vector3<double>> positions_;
  std::vector<int> pose_index_, point_index_;
  std::vector<std::array<float, 2>> pixels_;
  std::vector<float> depths_, sigma_, weight_;
  std::vector<double> squared_errors_;
};

}  // namespace cfp_slam
