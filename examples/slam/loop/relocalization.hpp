// A pose for a frame that the motion model lost: descriptors against the map, then P3P RANSAC whose samples follow the
// static probabilities.
#pragma once

#include <algorithm>
#include <array>
#include <iterator>
#include <vector>

#include "cfp/frame/static_probability.hpp"
#include "cfp/robust/pnp_ransac.hpp"
#include "matching.hpp"

namespace cfp_slam {

class Relocalization {
 public:
  // Map and probability must stay.
  Relocalization(const Map& map, const cfp::StaticProbability<Camera>& probability, std::uint64_t seed,
                 const cfp::PinholeCamera<float>& camera)
      : map_(map), probability_(probability), camera_(camera) {
    options_.seed = seed;
    options_.min_inliers = 15;
    options_.max_iterations = 1000;  // most candidates are hopeless: give up soon
  }

  // On success the pose, and the frame's map points set to the consensus; false: frame untouched.
  bool operator()(Frame& frame, const std::vector<int>& local_points) {
    return try_points(frame, local_points) || from_keyframes(frame, 8, -1);
  }

  // The same from so many keyframes, going on where the last call ended, but none of world `not_of`. What was found
  // with one of these is looked for there again.
  bool from_keyframes(Frame& frame, int most, int not_of) {
    // The newest first, a few in each lost frame, so that a lost frame costs no more than a bounded time.
    int tries = 0;
    const std::vector<int>& keyframes = map_.alive_keyframes;
    for (std::size_t looked = 0; looked < keyframes.size() && tries < most; ++looked) {
      const Keyframe& keyframe = map_.keyframe(keyframes[keyframes.size() - 1 - next_++ % keyframes.size()]);
      if (keyframe.world == not_of) continue;
      ++tries;
      if (try_points(frame, keyframe.frame.map_point)) {
        next_ = not_of < 0 ? 0 : next_ - 1;
        return true;
      }
    }
    return false;
  }

 private:
  bool try_points(Frame& frame, const std::vector<int>& points) {
    std::vector<int> candidates;
    // What one keyframe alone saw may have moved since.
    std::copy_if(points.begin(), points.end(), std::back_inserter(candidates),
                 [&](int p) { return map_.is_alive(p) && map_.is_proven(map_.point(p)); });
    std::vector<Match> matches = match_descriptors(frame, map_, candidates);
    keep_rigid(frame, map_, camera_, matches);
    if (matches.size() < options_.min_inliers) return false;
    std::vector<cfp::Vector3<float>> world;
    std::vector<std::array<float, 2>> pixels;
    std::vector<float> weights;
    for (const Match& m : matches) {
      const MapPoint& point = map_.point(m.index);
      world.push_back(point.position.cast<float>());
      pixels.push_back(frame.pixels[m.keypoint]);
      weights.push_back(probability_.weight(m.keypoint, point.static_probability));
    }
    std::vector<char> inlier(matches.size());
    const auto found = cfp::pnp_ransac(world, pixels, weights, camera_, options_, workspace_, inlier);
    if (!found.found()) return false;
    frame.T_cam_world = found.T_cam_world.cast<double>();
    frame.has_pose = true;
    std::fill(frame.map_point.begin(), frame.map_point.end(), no_point);
    for (std::size_t m = 0; m < matches.size(); ++m) {
      if (inlier[m] == 0) continue;
      frame.map_point[matches[m].keypoint] = matches[m].index;
      frame.map_point_probability[matches[m].keypoint] = map_.point(matches[m].index).static_probability;
    }
    return true;
  }

  const Map& map_;
  const cfp::StaticProbability<Camera>& probability_;
  cfp::PinholeCamera<float> camera_;
  cfp::PnpRansacOptions options_;
  cfp::PnpRansacWorkspace workspace_;
  std::size_t next_ = 0;
};

}  // namespace cfp_slam
