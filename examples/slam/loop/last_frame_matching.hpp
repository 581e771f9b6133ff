// Points of the last frame, in the map or known from its depth alone, found again in this one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "cfp/frame/frame.hpp"
#include "matching.hpp"

namespace cfp_slam {

struct LastFrameMatches {
  std::vector<std::int32_t> match;              // per keypoint of this frame: keypoint of the last one, or no_match
  std::size_t expected_proven = 0;              // proven map points that should be in view
  std::vector<cfp::Vector3<double>> positions;  // per keypoint of the last frame: its point in the world

  [[nodiscard]] bool matched(std::size_t keypoint) const { return match[keypoint] != cfp::no_match; }
};

class LastFrameMatching {
 public:
  // Searches within `radius` pixels (at level 0) of where the points fall from the predicted pose, within twice of it
  // when that finds fewer than `enough`. The frame takes over map points and their M.
  void operator()(Frame& frame, const KeypointGrid& grid, const Frame& last, const Map& map,
                  const cfp::SE3<double>& T_cam_world, const View& view, float radius, std::size_t enough,
                  LastFrameMatches& found) {
    found.match.assign(frame.size(), cfp::no_match);
    found.expected_proven = 0;
    if (!last.has_pose) return;
    expect(last, map, T_cam_world, view, radius, found);
    const auto all = [](std::size_t) { return true; };
    match_expected(frame, grid, expected_, far_descriptor, 1.0F, all, matches_);
    if (matches_.size() < enough) {
      for (Expected& e : expected_) e.radius *= 2;
      match_expected(frame, grid, expected_, far_descriptor, 1.0F, all, matches_);
    }
    keep_common_turn(matches_);
    for (const Match& m : matches_) {
      const auto j = static_cast<std::size_t>(m.index);
      const bool mapped = map.is_alive(last.map_point[j]);
      found.match[m.keypoint] = m.index;
      if (mapped) frame.map_point[m.keypoint] = last.map_point[j];
      frame.map_point_probability[m.keypoint] =
          mapped ? map.point(last.map_point[j]).static_probability : last.map_point_probability[j];
    }
  }

 private:
  void expect(const Frame& last, const Map& map, const cfp::SE3<double>& T_cam_world, const View& view, float radius,
              LastFrameMatches& found) {
    expected_.clear();
    std::vector<cfp::Vector3<double>>& positions = found.positions;
    positions.assign(last.size(), cfp::Vector3<double>::Zero());
    const cfp::SE3<double> T_world_last = last.T_cam_world.inverse();
    for (std::size_t j = 0; j < last.size(); ++j) {
      const bool mapped = map.is_alive(last.map_point[j]);
      if (!mapped && !(last.depths_m[j] > 0)) continue;
      positions[j] = mapped ? map.point(last.map_point[j]).position : T_world_last * last.back_project(j, view.camera);
      cfp::Vector2<double> pixel;
      if (!view.sees(T_cam_world * positions[j], pixel)) continue;
      if (mapped && map.is_proven(last.map_point[j])) ++found.expected_proven;
      const cv::KeyPoint& seen = last.keypoints[j];
      expected_.push_back({float(pixel.x()), float(pixel.y()), seen.octave, radius * view.scale(seen),
                           &last.descriptors[j], seen.angle, static_cast<int>(j)});
    }
  }

  std::vector<Expected> expected_;
  std::vector<Match> matches_;
};

}  // namespace cfp_slam
