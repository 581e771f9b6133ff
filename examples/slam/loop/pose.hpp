// The frame's pose: weighted refinement over everything that it sees.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "cfp/core/span.hpp"
#include "cfp/frame/weigh_keypoints.hpp"
#include "cfp/optimization/pose/pose_refinement.hpp"
#include "last_frame_matching.hpp"
#include "options.hpp"

namespace cfp_slam {

class PoseSolver {
 public:
  explicit PoseSolver(const Options& options) : options_(options) {}

  // Refines the frame's pose. weight: of the keypoints. Returns the number of inliers that count; the pose is left
  // alone when the refinement fails. Outliers lose their map point when `prune`.
  std::size_t operator()(Frame& frame, const LastFrameMatches& last, const Map& map, cfp::span<const float> weight,
                         const View& view, bool prune) {
    collect(frame, last, map, weight, view);
    cfp::PoseObservations<double> observations;
    observations.points = points_;
    observations.pixels = pixels_;
    observations.weights = weights_;
    observations.sigmas = sigmas_;
    observations.depths = depths_;
    observations.baseline_fx = view.baseline_fx;
    inlier_.resize(keypoint_.size());
    const cfp::PoseResult result = cfp::refine_pose(observations, view.exact, frame.T_cam_world, options_.pose,
                                                    workspace_, cfp::span<char>(inlier_));
    if (!cfp::is_solved(result.status)) return 0;
    frame.T_cam_world = result.T_cam_world;
    std::size_t count = 0;
    for (std::size_t o = 0; o < keypoint_.size(); ++o) {
      if (inlier_[o] != 0) {
        count += cfp::counts_as_inlier(weights_[o], options_.probability) ? 1U : 0U;
      } else if (prune) {
        frame.map_point[keypoint_[o]] = no_point;
      }
    }
    return count;
  }

 private:
  void collect(const Frame& frame, const LastFrameMatches& last, const Map& map, cfp::span<const float> weight,
               const View& view) {
    points_.clear();
    pixels_.clear();
    depths_.clear();
    sigmas_.clear();
    weights_.clear();
    keypoint_.clear();
    for (std::size_t i = 0; i < frame.size(); ++i) {
      const bool mapped = map.is_alive(frame.map_point[i]);
      if (!mapped && !last.matched(i)) continue;
      const cfp::Vector3<double>& X =
          mapped ? map.point(frame.map_point[i]).position : last.positions[static_cast<std::size_t>(last.match[i])];
      points_.push_back({X.x(), X.y(), X.z()});
      pixels_.push_back({static_cast<double>(frame.pixels[i][0]), static_cast<double>(frame.pixels[i][1])});
      depths_.push_back(static_cast<double>(frame.depths_m[i]));
      sigmas_.push_back(static_cast<double>(view.sigma(frame.keypoints[i])));
      weights_.push_back(static_cast<double>(weight[i]));
      keypoint_.push_back(i);
    }
  }

  Options options_;
  cfp::PoseWorkspace<double> workspace_;
  std::vector<std::array<double, 3>> points_;
  std::vector<std::array<double, 2>> pixels_;
  std::vector<double> depths_, sigmas_, weights_;
  std::vector<std::size_t> keypoint_;
  std::vector<char> inlier_;
};

}  // namespace cfp_slam
