// Points of the last frame, in the map or known from its depth alone, found again in this one.
#pragma once

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

// Searches around where the points fall from the frame's predicted pose, and farther when that finds few. The frame
// takes over map points and their M.
inline LastFrameMatches match_last_frame(Frame& frame, const KeypointGrid& grid, const Frame& last, const Map& map,
                                         const View& view) {
  constexpr std::size_t enough = 40;
  constexpr float radius_px = 15;  // at level 0
  LastFrameMatches found{std::vector<std::int32_t>(frame.size(), cfp::no_match), 0, {}};
  if (!last.has_pose) return found;
  found.positions.resize(last.size());
  std::vector<Expected> expected;
  const cfp::SE3<double> T_world_last = last.T_cam_world.inverse();
  for (std::size_t j = 0; j < last.size(); ++j) {
    const MapPoint* const point = map.find(last.map_point[j]);
    if (point == nullptr && !(last.depths_m[j] > 0)) continue;
    found.positions[j] = point != nullptr ? point->position : T_world_last * last.back_project(j, view.camera);
    cfp::Vector2<double> pixel;
    if (!view.sees(frame.T_cam_world * found.positions[j], pixel)) continue;
    if (point != nullptr && map.is_proven(*point)) ++found.expected_proven;
    const cv::KeyPoint& seen = last.keypoints[j];
    expected.push_back({float(pixel.x()), float(pixel.y()), seen.octave, radius_px * view.scale(seen),
                        &last.descriptors[j], seen.angle, static_cast<int>(j)});
  }
  const auto all = [](std::size_t) { return true; };
  std::vector<Match> matches = match_expected(frame, grid, expected, 1.0F, all);
  if (matches.size() < enough) {
    for (Expected& e : expected) e.radius *= 2;
    matches = match_expected(frame, grid, expected, 1.0F, all);
  }
  keep_common_turn(matches);
  for (const Match& m : matches) {
    const auto j = static_cast<std::size_t>(m.index);
    const MapPoint* const point = map.find(last.map_point[j]);
    found.match[m.keypoint] = m.index;
    if (point != nullptr) frame.map_point[m.keypoint] = last.map_point[j];
    frame.map_point_probability[m.keypoint] =
        point != nullptr ? point->static_probability : last.map_point_probability[j];
  }
  return found;
}

}  // namespace cfp_slam
