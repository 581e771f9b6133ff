// Where known points appear in a frame: search around their projection for the keypoint with the nearest descriptor.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

#include "cfp/frame/descriptor_matching.hpp"
#include "cfp/frame/frame.hpp"
#include "cfp/geometry/depth_noise.hpp"
#include "map.hpp"

namespace cfp_slam {

// ORB-SLAM2's limits on the Hamming distance of 256 bits.
inline constexpr int far_descriptor = 100, near_descriptor = 50;

[[nodiscard]] inline int hamming(const Descriptor& a, const Descriptor& b) {
  return cfp::hamming_distance(a.data(), b.data(), a.size());
}

// A point expected at a pixel.
struct Expected {
  float x = 0, y = 0;
  int level = 0;  // of the pyramid
  float radius = 0;
  const Descriptor* descriptor = nullptr;
  float angle = -1;  // of the keypoint it was seen as, degrees; < 0: unknown
  int index = 0;     // the caller's name for it
};

struct Match {
  std::size_t keypoint = 0;
  int index = no_point;  // Expected::index
  int distance = 0;
  float turn = 0;  // degrees between the two keypoints' orientations; only between known ones
};

// The nearest keypoint of each expected point among those for which `free(keypoint)`. One to one: a keypoint goes to
// the point with the smaller distance. `ratio` below 1 asks that the second nearest on the same level be farther by
// that factor.
template <typename Free>
std::vector<Match> match_expected(const Frame& frame, const KeypointGrid& grid, const std::vector<Expected>& expected,
                                  float ratio, const Free& free) {
  std::vector<Match> matches;
  std::vector<int> taken(frame.size(), -1);  // index into matches
  for (const Expected& e : expected) {
    struct Candidate {
      int distance = far_descriptor + 1, level = -1;
      std::size_t keypoint = 0;
    } best, second;
    grid.near(frame.pixels, e.x, e.y, e.radius, [&](std::size_t i) {
      const int level = frame.keypoints[i].octave;
      if (level < e.level - 1 || level > e.level + 1 || !free(i)) return;
      const Candidate candidate{hamming(*e.descriptor, frame.descriptors[i]), level, i};
      if (candidate.distance < best.distance)
        second = std::exchange(best, candidate);
      else if (candidate.distance < second.distance)
        second = candidate;
    });
    if (best.distance > far_descriptor) continue;
    if (best.level == second.level && float(best.distance) > ratio * float(second.distance)) continue;
    const float turn = std::fmod(e.angle - frame.keypoints[best.keypoint].angle + 720.0F, 360.0F);
    const Match match{best.keypoint, e.index, best.distance, e.angle < 0 ? 0 : turn};
    int& index = taken[best.keypoint];
    if (index < 0) {
      index = static_cast<int>(matches.size());
      matches.push_back(match);
    } else if (Match& other = matches[static_cast<std::size_t>(index)]; match.distance < other.distance) {
      other = match;
    }
  }
  return matches;
}

// Keeps the matches whose orientation turned as most did: the three fullest of thirty bins, as ORB-SLAM2 does.
inline void keep_common_turn(std::vector<Match>& matches) {
  constexpr std::size_t bins = 30;
  std::array<int, bins> count{};
  const auto bin = [](const Match& m) {
    return static_cast<std::size_t>(std::lround(m.turn * float(bins) / 360.0F)) % bins;
  };
  for (const Match& m : matches) ++count[bin(m)];
  std::array<int, bins> sorted = count;
  std::sort(sorted.begin(), sorted.end(), std::greater<>());
  const int least = std::max({sorted[2], sorted[0] / 10, 1});
  remove_where(matches, [&](const Match& m) { return count[bin(m)] < least; });
}

// Points of the last frame, in the map or known from its depth alone, found again in this one.
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

// Mutual nearest descriptors with a ratio test, without any idea where the points may be: for relocalisation. Corners
// are in map and frame several times, from several octaves and keyframes: the second nearest must be another place, and
// the point's own nearest keypoint the same one, or one beside it.
inline std::vector<Match> match_descriptors(const Frame& frame, const Map& map, const std::vector<int>& candidates) {
  constexpr double same_place_m = 0.05;
  constexpr float same_place_px = 4, ratio = 0.8F;
  std::vector<std::pair<int, std::size_t>> of_point(candidates.size(), {std::numeric_limits<int>::max(), 0});
  const auto elsewhere = [&](std::size_t a, std::size_t b) {
    return (map.point(candidates[a]).position - map.point(candidates[b]).position).squaredNorm() >
           same_place_m * same_place_m;
  };
  std::vector<Match> matches;
  for (std::size_t i = 0; i < frame.size(); ++i) {
    int best = near_descriptor + 1, second = best;
    std::size_t nearest = 0;
    for (std::size_t c = 0; c < candidates.size(); ++c) {
      const int distance = hamming(map.point(candidates[c]).descriptor, frame.descriptors[i]);
      if (distance < of_point[c].first) of_point[c] = {distance, i};
      if (distance >= second) continue;
      const bool other = best > near_descriptor || elsewhere(c, nearest);
      if (distance < best) {
        if (other) second = best;
        best = distance;
        nearest = c;
      } else if (other) {
        second = distance;
      }
    }
    if (best <= near_descriptor && float(best) <= ratio * float(second))
      matches.push_back({i, static_cast<int>(nearest), best, 0});
  }
  const auto one_sided = [&](const Match& m) {
    const auto &a = frame.pixels[m.keypoint], &b = frame.pixels[of_point[static_cast<std::size_t>(m.index)].second];
    return !(std::hypot(a[0] - b[0], a[1] - b[1]) <= same_place_px);
  };
  remove_where(matches, one_sided);
  for (Match& m : matches) m.index = candidates[static_cast<std::size_t>(m.index)];
  return matches;
}

// Of matches without any idea where they are, those that agree with one of them, the one that most agree with: the
// camera's motion leaves the distance of two points as it is, and depths measure it. Matches without a depth stay.
inline void keep_rigid(const Frame& frame, const Map& map, const cfp::PinholeCamera<float>& camera,
                       std::vector<Match>& matches) {
  constexpr double map_sigma_m = 0.01;
  const cfp::DepthNoise noise;
  const auto agree = [&](const Match& a, const Match& b) {
    const double za = double(frame.depths_m[a.keypoint]), zb = double(frame.depths_m[b.keypoint]);
    if (!(za > 0 && zb > 0)) return !(zb > 0);
    const double seen = (frame.back_project(a.keypoint, camera) - frame.back_project(b.keypoint, camera)).norm();
    const double known = (map.point(a.index).position - map.point(b.index).position).norm();
    return std::abs(seen - known) <= 3 * (noise.sigma_m(za) + noise.sigma_m(zb) + map_sigma_m);
  };
  std::size_t most = 0, centre = 0;
  for (std::size_t c = 0; c < matches.size(); ++c) {
    if (!(frame.depths_m[matches[c].keypoint] > 0)) continue;
    const auto agreeing = static_cast<std::size_t>(
        std::count_if(matches.begin(), matches.end(), [&](const Match& m) { return agree(matches[c], m); }));
    if (agreeing <= most) continue;
    most = agreeing;
    centre = c;
  }
  if (most == 0) return;  // no depths
  const Match kept = matches[centre];
  remove_where(matches, [&](const Match& m) { return !agree(kept, m); });
}

}  // namespace cfp_slam
