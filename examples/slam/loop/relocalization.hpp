// A pose for a frame that the motion model lost: descriptors against the map, then P3P RANSAC whose samples follow the
// static probabilities.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <vector>

#include "cfp/frame/static_probability.hpp"
#include "cfp/robust/pnp_ransac.hpp"
#include "matching.hpp"

extern template cfp::PnpRansacResult<float> cfp::pnp_ransac(PointSpan<float, 3>, PointSpan<float, 2>, span<const float>,
                                                            const PinholeCamera<float>&, const PnpRansacOptions&,
                                                            PnpRansacWorkspace&, span<char>);

namespace cfp_slam {

class Relocalization {
 public:
  explicit Relocalization(std::uint64_t seed) { options_.seed = seed; }

  // On success the pose, and the frame's map points set to the consensus; false: frame untouched.
  bool operator()(Frame& frame, const Map& map, const std::vector<int>& local_points,
                  const cfp::StaticProbability<Camera>& probability, const cfp::PinholeCamera<float>& camera) {
    if (try_points(frame, map, local_points, probability, camera)) return true;
    return from_keyframes(frame, map, 8, -1, probability, camera);
  }

  // The same from so many keyframes, going on where the last call ended, but none of world `not_of`. What was found
  // with one of these is looked for there again.
  bool from_keyframes(Frame& frame, const Map& map, int most, int not_of,
                      const cfp::StaticProbability<Camera>& probability, const cfp::PinholeCamera<float>& camera) {
    // The newest first, a few in each lost frame, so that a lost frame costs no more than a bounded time.
    int tries = 0;
    const std::vector<int>& keyframes = map.alive_keyframes;
    for (std::size_t looked = 0; looked < keyframes.size() && tries < most; ++looked) {
      const Keyframe& keyframe = map.keyframe(keyframes[keyframes.size() - 1 - next_++ % keyframes.size()]);
      if (keyframe.world == not_of) continue;
      ++tries;
      if (try_points(frame, map, keyframe.frame.map_point, probability, camera)) {
        next_ = not_of < 0 ? 0 : next_ - 1;
        return true;
      }
    }
    return false;
  }

 private:
  static constexpr std::size_t min_inliers = 15;

  bool try_points(Frame& frame, const Map& map, const std::vector<int>& points,
                  const cfp::StaticProbability<Camera>& probability, const cfp::PinholeCamera<float>& camera) {
    candidates_.clear();
    // What one keyframe alone saw may have moved since.
    std::copy_if(points.begin(), points.end(), std::back_inserter(candidates_),
                 [&](int p) { return map.is_alive(p) && map.is_proven(p); });
    match_descriptors(frame, map, candidates_, near_descriptor, 0.8F, matches_);
    keep_rigid(frame, map, camera, matches_);
    if (matches_.size() < min_inliers) return false;
    world_.clear();
    pixels_.clear();
    weights_.clear();
    for (const Match& m : matches_) {
      const MapPoint& point = map.point(m.index);
      world_.push_back({static_cast<float>(point.position.x()), static_cast<float>(point.position.y()),
                        static_cast<float>(point.position.z())});
      pixels_.push_back(frame.pixels[m.keypoint]);
      weights_.push_back(probability.weight(m.keypoint, point.static_probability));
    }
    inlier_.resize(matches_.size());
    options_.min_inliers = min_inliers;
    options_.max_iterations = 1000;  // most candidates are hopeless: give up soon
    const auto found = cfp::pnp_ransac(world_, pixels_, weights_, camera, options_, workspace_, inlier_);
    if (!found.found()) return false;
    frame.T_cam_world = found.T_cam_world.cast<double>();
    frame.has_pose = true;
    std::fill(frame.map_point.begin(), frame.map_point.end(), no_point);
    for (std::size_t m = 0; m < matches_.size(); ++m) {
      if (inlier_[m] == 0) continue;
      frame.map_point[matches_[m].keypoint] = matches_[m].index;
      frame.map_point_probability[matches_[m].keypoint] = map.point(matches_[m].index).static_probability;
    }
    return true;
  }

  cfp::PnpRansacOptions options_;
  cfp::PnpRansacWorkspace workspace_;
  std::vector<Match> matches_;
  std::vector<int> candidates_;
  std::vector<std::array<float, 3>> world_;
  std::vector<std::array<float, 2>> pixels_;
  std::vector<float> weights_;
  std::vector<char> inlier_;
  std::size_t next_ = 0;
};

}  // namespace cfp_slam
