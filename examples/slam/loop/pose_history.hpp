// The poses that the tracked frames were given, each relative to a keyframe, so that it moves along with all bundle
// adjustment after it, as ORB-SLAM2 writes trajectories; and what is taken back of them.
#pragma once

#include <algorithm>
#include <vector>

#include "map.hpp"
#include "run.hpp"

namespace cfp_slam {

class PoseHistory {
 public:
  void add(const Frame& frame, int reference, const Map& map) {
    poses_.push_back(
        {frame.time_s, reference, frame.T_cam_world * map.keyframe(reference).frame.T_cam_world.inverse()});
  }
  [[nodiscard]] std::size_t size() const { return poses_.size(); }

  // All but the first so many.
  void take_back_after(std::size_t first) { poses_.resize(first); }
  // Those told by one of these keyframes.
  void take_back_of(const std::vector<int>& keyframes, const Map& map) {
    const auto is_of_one = [&](const Pose& p) {
      return std::find(keyframes.begin(), keyframes.end(), map.ancestor(p.reference)) != keyframes.end();
    };
    remove_where(poses_, is_of_one);
  }

  [[nodiscard]] RunResult result(const Map& map) const {
    RunResult result;
    for (const Pose& p : poses_) {
      result.trajectory.push_back({p.time_s, (p.T_cam_reference * map.pose(p.reference)).inverse()});
      result.world.push_back(map.keyframe(p.reference).world);
    }
    result.keyframes = map.alive_keyframes.size();
    result.map_points = map.alive_points();
    return result;
  }

 private:
  struct Pose {
    double time_s = 0;
    int reference = 0;
    cfp::SE3<double> T_cam_reference;
  };
  std::vector<Pose> poses_;
};

}  // namespace cfp_slam
