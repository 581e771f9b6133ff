// The map: points with a static probability, keyframes that see them, and who shares how many points with whom.
#pragma once

#include <algorithm>
#include <iterator>
#include <map>
#include <unordered_map>
#include <utility>
#include <vector>

#include "frame.hpp"

namespace cfp_slam {

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
  int world = 0;                 // after a loss a new one begins; what is in two of them has no common frame
  std::vector<int> neighbours;   // keyframes that share points when this one was made, most first
  int parent = -1;               // of one that has gone: where it was is told by another keyframe, if there was one,
  cfp::SE3<double> T_of_parent;  // from whose camera to its own this goes
};

class Map {
 public:
  std::vector<MapPoint> points;
  std::vector<Keyframe> keyframes;   // all that ever were; of those that have gone, where they were
  std::vector<int> alive_keyframes;  // the others, the oldest first

  [[nodiscard]] bool is_alive(int point) const {
    return point != no_point && points[static_cast<std::size_t>(point)].alive;
  }
  // Whether keyframes agree about it, as soon as there are some in its world.
  [[nodiscard]] bool is_proven(const MapPoint& point) const {
    return keyframes.size() < first_of_world_.back() + 3 || point.observations.size() >= 2;
  }
  // Returns its index. Its points do not know of it yet.
  int add_keyframe(const Frame& frame, int world) {
    keyframes.push_back({frame, world, {}, -1, {}});
    alive_keyframes.push_back(static_cast<int>(keyframes.size()) - 1);
    return alive_keyframes.back();
  }
  // The keyframes to come are in a world of their own.
  int begin_world() {
    first_of_world_.push_back(keyframes.size());
    return newest_world();
  }
  [[nodiscard]] int newest_world() const { return static_cast<int>(first_of_world_.size()) - 1; }
  // As if the newest world had never been. Precondition: it is not the first one, and not part of another.
  void drop_world() {
    const std::size_t first = first_of_world_.back();
    first_of_world_.pop_back();
    for (std::size_t k = first; k < keyframes.size(); ++k) erase_observations(static_cast<int>(k));
    keyframes.erase(keyframes.begin() + static_cast<std::ptrdiff_t>(first), keyframes.end());
    while (!alive_keyframes.empty() && alive_keyframes.back() >= static_cast<int>(first)) alive_keyframes.pop_back();
  }
  // Moves a world onto another, of which it is a part from now on. Returns the keyframes that it has.
  std::vector<int> join(int world, int other, const cfp::SE3<double>& T_other_world) {
    std::vector<int> joined;
    std::copy_if(alive_keyframes.begin(), alive_keyframes.end(), std::back_inserter(joined),
                 [&](int k) { return keyframe(k).world == world; });
    for (MapPoint& p : points) {
      if (!p.alive || keyframe(p.created_by).world != world) continue;
      p.position = T_other_world * p.position;
      p.normal = T_other_world.rotation * p.normal;
    }
    for (Keyframe& k : keyframes) {
      if (k.world != world) continue;
      k.frame.T_cam_world = k.frame.T_cam_world * T_other_world.inverse();
      k.world = other;
    }
    return joined;
  }
  // Forgets until at most so many keyframes are left: the smallest of the worlds that are no larger than this one, then
  // the oldest of all.
  void forget(std::size_t most, int world) {
    while (alive_keyframes.size() > most) {
      std::map<int, int> count;
      for (const int k : alive_keyframes) ++count[keyframe(k).world];
      const auto smaller = [&](const auto& a, const auto& b) {
        return std::pair(a.second, a.first == world) < std::pair(b.second, b.first == world);
      };
      const int smallest = std::min_element(count.begin(), count.end(), smaller)->first;
      const int oldest = alive_keyframes.front();
      for (const int k : std::vector<int>(alive_keyframes)) {
        if (smallest == world ? k == oldest : keyframe(k).world == smallest) erase_keyframe(k);
      }
    }
  }
  // The point, if it is one and has not gone.
  [[nodiscard]] const MapPoint* find(int index) const { return is_alive(index) ? &point(index) : nullptr; }
  [[nodiscard]] MapPoint* find(int index) { return is_alive(index) ? &point(index) : nullptr; }
  [[nodiscard]] MapPoint& point(int index) { return points[static_cast<std::size_t>(index)]; }
  [[nodiscard]] const MapPoint& point(int index) const { return points[static_cast<std::size_t>(index)]; }
  [[nodiscard]] Keyframe& keyframe(int index) { return keyframes[static_cast<std::size_t>(index)]; }
  [[nodiscard]] const Keyframe& keyframe(int index) const { return keyframes[static_cast<std::size_t>(index)]; }
  [[nodiscard]] std::size_t alive_points() const { return points.size() - free_.size() - dead_.size(); }
  // The keyframe that tells where it is: itself, if it has not gone.
  [[nodiscard]] int ancestor(int index) const {
    while (keyframe(index).parent >= 0) index = keyframe(index).parent;
    return index;
  }
  // Of a keyframe that may have gone.
  [[nodiscard]] cfp::SE3<double> pose(int index) const {
    cfp::SE3<double> T_cam_ancestor;
    while (keyframe(index).parent >= 0) {
      T_cam_ancestor = T_cam_ancestor * keyframe(index).T_of_parent;
      index = keyframe(index).parent;
    }
    return T_cam_ancestor * keyframe(index).frame.T_cam_world;
  }

  // Returns its index, which may have been another point's before the last recycle().
  int add(MapPoint&& added) {
    if (free_.empty()) {
      points.push_back(std::move(added));
      return static_cast<int>(points.size()) - 1;
    }
    const int index = free_.back();
    free_.pop_back();
    point(index) = std::move(added);
    return index;
  }
  // Nobody outside knows the points any more that have gone.
  void recycle() {
    free_.insert(free_.end(), dead_.begin(), dead_.end());
    dead_.clear();
  }

  void erase_point(int index) {
    MapPoint& p = point(index);
    for (const Observation& o : p.observations)
      keyframe(o.keyframe).frame.map_point[static_cast<std::size_t>(o.keypoint)] = no_point;
    p.observations = {};
    p.alive = false;
    dead_.push_back(index);
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

  // What nobody else sees goes with it. Where it was is told by the one of its world that shares most with it, so that
  // it moves along, or stays as it is.
  void erase_keyframe(int index) {
    Keyframe& gone = keyframe(index);
    for (const int other : covisible(gone.frame.map_point, 1)) {
      if (other == index || keyframe(other).world != gone.world) continue;
      gone.parent = other;
      gone.T_of_parent = gone.frame.T_cam_world * keyframe(other).frame.T_cam_world.inverse();
      break;
    }
    erase_observations(index);
    const cfp::SE3<double> T_cam_world = gone.frame.T_cam_world;
    gone.frame = {};
    gone.frame.T_cam_world = T_cam_world;
    gone.neighbours = {};
    const auto is_it = [index](int k) { return k == index; };
    remove_where(alive_keyframes, is_it);
    for (const int k : alive_keyframes) remove_where(keyframe(k).neighbours, is_it);
  }

  // Keyframes that share at least `min_shared` of the given points, most first (ties: the newer first).
  [[nodiscard]] std::vector<int> covisible(const std::vector<int>& map_points, int min_shared) const {
    std::unordered_map<int, int> count;  // costs nothing for all that have gone
    for (const int index : map_points) {
      if (!is_alive(index)) continue;
      for (const Observation& o : point(index).observations) ++count[o.keyframe];
    }
    std::vector<int> result;
    for (const auto& [keyframe, shared] : count) {
      if (shared >= min_shared) result.push_back(keyframe);
    }
    std::sort(result.begin(), result.end(),
              [&](int a, int b) { return std::pair(count.at(a), a) > std::pair(count.at(b), b); });
    return result;
  }

 private:
  void erase_observations(int keyframe_index) {
    for (const int p : std::vector<int>(keyframe(keyframe_index).frame.map_point)) {
      if (is_alive(p)) erase_observation(p, keyframe_index);
    }
  }

  std::vector<int> dead_, free_;  // points that have gone: since the last recycle(), and before
  std::vector<std::size_t> first_of_world_{0};
};

}  // namespace cfp_slam
