// The points of the keyframes around: those that the frame should see and does not yet are searched for.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "matching.hpp"

namespace cfp_slam {

struct LocalMap {
  int reference = 0;                // the keyframe that shares most points with the last frame searched, or a newer one
  std::vector<int> points;          // around it
  std::size_t expected_proven = 0;  // of them: proven ones that it should have seen

  // The frame needs a pose. `wide`: it is new, and may be less exact.
  void search(Frame& frame, const KeypointGrid& grid, Map& map, const View& view, bool wide) {
    collect(frame, map);
    const auto is_free = [&](std::size_t i) { return !map.is_alive(frame.map_point[i]); };
    for (const Match& m : match_expected(frame, grid, expect(frame, map, view, wide ? 5.0F : 3.0F), 0.8F, is_free))
      frame.map_point[m.keypoint] = m.index;
  }

 private:
  // Points of the keyframes that share some with the frame, and of one neighbour of each.
  void collect(const Frame& frame, const Map& map) {
    constexpr std::size_t nearest = 20, most = 30;
    std::vector<int> keyframes = map.covisible(frame.map_point, 1);
    if (!keyframes.empty()) reference = keyframes.front();
    if (keyframes.size() > nearest) keyframes.resize(nearest);
    for (std::size_t k = 0, direct = keyframes.size(); k < direct && keyframes.size() < most; ++k) {
      const std::vector<int>& neighbours = map.keyframe(keyframes[k]).neighbours;
      const auto added = std::find_if(neighbours.begin(), neighbours.end(), [&](int neighbour) {
        return std::find(keyframes.begin(), keyframes.end(), neighbour) == keyframes.end();
      });
      if (added != neighbours.end()) keyframes.push_back(*added);
    }
    points.clear();
    std::vector<bool> known(map.points.size());
    for (const int k : keyframes) {
      for (const int p : map.keyframe(k).frame.map_point) {
        if (!map.is_alive(p) || known[static_cast<std::size_t>(p)]) continue;
        known[static_cast<std::size_t>(p)] = true;
        points.push_back(p);
      }
    }
  }

  // The points in view; how near they are tells the level of the pyramid.
  std::vector<Expected> expect(const Frame& frame, Map& map, const View& view, float widening) {
    std::vector<bool> seen(map.points.size());
    for (const int p : frame.map_point) {
      if (map.is_alive(p)) seen[static_cast<std::size_t>(p)] = true;
    }
    const cfp::Vector3<double> centre = frame.T_cam_world.inverse().translation;
    const int levels = static_cast<int>(view.scales.size());
    const double log_scale = std::log(static_cast<double>(view.scale_factor));
    std::vector<Expected> expected;
    expected_proven = 0;
    for (const int p : points) {
      MapPoint& point = map.point(p);
      if (!seen[static_cast<std::size_t>(p)]) {
        cfp::Vector2<double> pixel;
        if (!view.sees(frame.T_cam_world * point.position, pixel)) continue;
        const cfp::Vector3<double> ray = point.position - centre;
        const double distance = ray.norm(), cosine = ray.dot(point.normal) / distance;
        const int level =
            static_cast<int>(std::ceil(std::log(static_cast<double>(point.max_distance) / distance) / log_scale - 0.5));
        if (cosine < 0.5 || level < -1 || level > levels) continue;
        const int clamped = std::clamp(level, 0, levels - 1);
        const float radius = (cosine > 0.998 ? 2.5F : 4.0F) * widening * view.scales[static_cast<std::size_t>(clamped)];
        expected.push_back({float(pixel.x()), float(pixel.y()), clamped, radius, &point.descriptor, -1, p});
      }
      ++point.in_view;
      expected_proven += map.is_proven(point) ? 1U : 0U;
    }
    return expected;
  }
};

}  // namespace cfp_slam
