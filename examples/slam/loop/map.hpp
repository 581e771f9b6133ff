// The map: points with a static probability, keyframes that see them, and who shares how many points with whom.
#pragma once

#include <algorithm>
#include <bitset>
#include <cstddef>
#include <functional>
#include <utility>
#include <vector>

#include "frame.hpp"

namespace cfp_slam {

[[nodiscard]] inline int hamming(const Descriptor& a, const Descriptor& b) {
  int distance = 0;
  for (std::size_t i = 0; i < a.size(); ++i) distance += static_cast<int>(std::bitset<64>(a[i] ^ b[i]).count());
  return distance;
}

struct Observation {
  int keyframe = 0;
  int keypoint = 0;
};

struct MapPoint {
  cfp::Vector3<double> position;  // world, m
  cfp::Vector3<double> normal;    // mean viewing direction, from cameras to the point
  Descriptor descriptor{};        // of the last keyframe that saw it
  float max_distance =
      0;  // at which level 0 would see what the creating keypoint saw: gives the level at other distances
  float static_probability = 1;  // M
  int created_by = 0;            // keyframe
  int in_view = 1, found = 1;    // frames that should have seen it, and did
  std::vector<Observation> observations;
  bool alive = true;
};

struct Keyframe {
  Frame frame;
  int world = 0;                // after a loss a new one begins; what is in two of them has no common frame
  std::vector<int> neighbours;  // keyframes that share points when this one was made, most first
};

class Map {
 public:
  std::vector<MapPoint> points;
  std::vector<Keyframe> keyframes;

  [[nodiscard]] bool is_alive(int point) const {
    return point != no_point && points[static_cast<std::size_t>(point)].alive;
  }
  // Whether keyframes agree about it, as soon as there are some in its world.
  [[nodiscard]] bool is_proven(int index) const {
    return keyframes.size() < first_of_world_ + 3 || point(index).observations.size() >= 2;
  }
  // The keyframes to come are in a world of their own.
  int begin_world() {
    first_of_world_ = keyframes.size();
    return ++newest_world_;
  }
  [[nodiscard]] int newest_world() const { return newest_world_; }
  // Moves the newest world onto another, of which it is a part from now on.
  void join(int other, const cfp::SE3<double>& T_other_newest) {
    for (MapPoint& p : points) {
      if (!p.alive || keyframe(p.created_by).world != newest_world_) continue;
      p.position = T_other_newest * p.position;
      p.normal = T_other_newest.rotation * p.normal;
    }
    for (Keyframe& k : keyframes) {
      if (k.world != newest_world_) continue;
      k.frame.T_cam_world = k.frame.T_cam_world * T_other_newest.inverse();
      k.world = other;
    }
  }
  [[nodiscard]] MapPoint& point(int index) { return points[static_cast<std::size_t>(index)]; }
  [[nodiscard]] const MapPoint& point(int index) const { return points[static_cast<std::size_t>(index)]; }
  [[nodiscard]] Keyframe& keyframe(int index) { return keyframes[static_cast<std::size_t>(index)]; }
  [[nodiscard]] const Keyframe& keyframe(int index) const { return keyframes[static_cast<std::size_t>(index)]; }
  [[nodiscard]] std::size_t alive_points() const {
    return static_cast<std::size_t>(
        std::count_if(points.begin(), points.end(), [](const MapPoint& p) { return p.alive; }));
  }

  void erase_point(int index) {
    MapPoint& p = point(index);
    for (const Observation& o : p.observations)
      keyframe(o.keyframe).frame.map_point[static_cast<std::size_t>(o.keypoint)] = no_point;
    p.observations = {};
    p.alive = false;
  }

  // A point without observations is nobody's: it goes, too.
  void erase_observation(int index, int keyframe_index) {
    MapPoint& p = point(index);
    const auto o = std::find_if(p.observations.begin(), p.observations.end(),
                                [&](const Observation& seen) { return seen.keyframe == keyframe_index; });
    if (o == p.observations.end()) return;
    keyframe(keyframe_index).frame.map_point[static_cast<std::size_t>(o->keypoint)] = no_point;
    p.observations.erase(o);
    if (p.observations.empty()) erase_point(index);
  }

  // Keyframes that share at least `min_shared` of the given points, most first (ties: the newer first).
  [[nodiscard]] std::vector<int> covisible(const std::vector<int>& map_points, int min_shared) const {
    std::vector<std::pair<int, int>> shared(keyframes.size());
    for (std::size_t k = 0; k < shared.size(); ++k) shared[k] = {0, static_cast<int>(k)};
    for (const int index : map_points) {
      if (!is_alive(index)) continue;
      for (const Observation& o : point(index).observations) ++shared[static_cast<std::size_t>(o.keyframe)].first;
    }
    std::sort(shared.begin(), shared.end(), std::greater<>());
    std::vector<int> result;
    for (const auto& [count, keyframe_index] : shared) {
      if (count < std::max(min_shared, 1)) break;
      result.push_back(keyframe_index);
    }
    return result;
  }

 private:
  int newest_world_ = 0;
  std::size_t first_of_world_ = 0;
};

}  // namespace cfp_slam
