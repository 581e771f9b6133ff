// The points of the keyframes around: those that the frame should see and does not yet are searched for.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "matching.hpp"
#include "options.hpp"

namespace cfp_slam {

class LocalMap {
 public:
  explicit LocalMap(const cfp_examples::FeatureOptions& features) : features_(features) {}

  // The frame needs a pose. `wide`: it is new, and may be less exact.
  void search(Frame& frame, const KeypointGrid& grid, Map& map, const View& view, bool wide) {
    collect(frame, map);
    expect(frame, map, view, wide ? 5.0F : 3.0F);
    match_expected(
        frame, grid, expected_, far_descriptor, 0.8F, [&](std::size_t i) { return !map.is_alive(frame.map_point[i]); },
        matches_);
    for (const Match& m : matches_) frame.map_point[m.keypoint] = m.index;
  }

  // The keyframe that shares most points with the last frame searched, or a newer one.
  [[nodiscard]] int reference() const { return reference_; }
  void set_reference(int keyframe) { reference_ = keyframe; }
  [[nodiscard]] const std::vector<int>& points() const { return points_; }
  // Proven ones that the last frame searched should have seen.
  [[nodiscard]] std::size_t expected_proven() const { return expected_proven_; }

 private:
  // Points of the keyframes that share some with the frame, and of one neighbour of each.
  void collect(const Frame& frame, const Map& map) {
    constexpr std::size_t nearest = 20, most = 30;
    std::vector<int> keyframes = map.covisible(frame.map_point, 1);
    if (!keyframes.empty()) reference_ = keyframes.front();
    if (keyframes.size() > nearest) keyframes.resize(nearest);
    for (std::size_t k = 0, direct = keyframes.size(); k < direct && keyframes.size() < most; ++k) {
      for (const int neighbour : map.keyframe(keyframes[k]).neighbours) {
        if (std::find(keyframes.begin(), keyframes.end(), neighbour) != keyframes.end()) continue;
        keyframes.push_back(neighbour);
        break;
      }
    }
    points_.clear();
    seen_.assign(map.points.size(), 0);
    for (const int k : keyframes) {
      for (const int p : map.keyframe(k).frame.map_point) {
        if (!map.is_alive(p) || seen_[static_cast<std::size_t>(p)] != 0) continue;
        seen_[static_cast<std::size_t>(p)] = 1;
        points_.push_back(p);
      }
    }
  }

  // The points in view; how near they are tells the level of the pyramid.
  void expect(const Frame& frame, Map& map, const View& view, float widening) {
    seen_.assign(map.points.size(), 0);
    for (const int p : frame.map_point) {
      if (map.is_alive(p)) seen_[static_cast<std::size_t>(p)] = 1;
    }
    const cfp::Vector3<double> centre = frame.T_cam_world.inverse().translation;
    const double log_scale = std::log(static_cast<double>(features_.scale_factor));
    expected_.clear();
    expected_proven_ = 0;
    for (const int p : points_) {
      MapPoint& point = map.point(p);
      if (seen_[static_cast<std::size_t>(p)] != 0) {
        ++point.in_view;
        expected_proven_ += map.is_proven(p) ? 1U : 0U;
        continue;
      }
      cfp::Vector2<double> pixel;
      if (!view.sees(frame.T_cam_world * point.position, pixel)) continue;
      const cfp::Vector3<double> ray = point.position - centre;
      const double distance = ray.norm(), cosine = ray.dot(point.normal) / distance;
      const int level =
          static_cast<int>(std::ceil(std::log(static_cast<double>(point.max_distance) / distance) / log_scale - 0.5));
      if (cosine < 0.5 || level < -1 || level > features_.levels) continue;
      ++point.in_view;
      expected_proven_ += map.is_proven(p) ? 1U : 0U;
      const int clamped = std::clamp(level, 0, features_.levels - 1);
      const float radius = (cosine > 0.998 ? 2.5F : 4.0F) * widening * view.scales[static_cast<std::size_t>(clamped)];
      expected_.push_back({float(pixel.x()), float(pixel.y()), clamped, radius, &point.descriptor, -1, p});
    }
  }

  cfp_examples::FeatureOptions features_;
  int reference_ = 0;
  std::size_t expected_proven_ = 0;
  std::vector<int> points_;
  std::vector<char> seen_;
  std::vector<Expected> expected_;
  std::vector<Match> matches_;
};

}  // namespace cfp_slam
