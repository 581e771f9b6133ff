// The frame's pose: weighted refinement over everything that it sees.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "cfp/core/span.hpp"
#include "cfp/frame/pose_health.hpp"
#include "cfp/frame/weigh_keypoints.hpp"
#include "cfp/optimization/pose/pose_refinement.hpp"
#include "last_frame_matching.hpp"
#include "options.hpp"

extern template cfp::PoseResult cfp::refine_pose(const PoseObservations<double>&, const PinholeCamera<double>&,
                                                 const SE3<double>&, const PoseOptions&, PoseWorkspace<double>&,
                                                 span<char>);

namespace cfp_slam {

struct BelievedPose {
  double time_s = 0;
  cfp::SE3<double> T_cam_world;

  [[nodiscard]] cfp::PoseStep<double> step_to(const cfp::SE3<double>& T_cam_world_then, double then_s) const {
    return {T_cam_world_then * T_cam_world.inverse(), then_s - time_s};
  }
};

struct RefinedPose {
  std::size_t inliers = 0;  // that count
  std::size_t in_map = 0;   // of them; the others are known from the last frame alone
  cfp::PoseAssessment health;
};

class PoseSolver {
 public:
  explicit PoseSolver(const Options& options) : options_(options) {}

  // Refines the frame's pose and judges it by `health`; it is left alone when the refinement fails. weight: of the
  // keypoints; `expected`: proven points that should be in view; `believed`: the last pose that was, if the step from
  // there is to be judged, too. Outliers lose their map point when `prune`.
  RefinedPose operator()(Frame& frame, const LastFrameMatches& last, const Map& map, cfp::span<const float> weight,
                         const View& view, std::size_t expected, bool prune, const cfp::PoseHealthOptions& health,
                         const std::optional<BelievedPose>& believed) {
    collect(frame, last, map, weight, view);
    const bool decided = let_proven_decide(expected);
    cfp::PoseObservations<double> observations;
    observations.points = points_;
    observations.pixels = pixels_;
    observations.weights = weights_;
    observations.sigmas = sigmas_;
    observations.depths = depths_;
    observations.baseline_fx = view.baseline_fx;
    inlier_.resize(keypoint_.size());
    const auto solve = [&](const cfp::SE3<double>& start, const cfp::PoseOptions& options) {
      return cfp::refine_pose(observations, view.exact, start, options, workspace_, inlier_);
    };
    cfp::PoseResult result = solve(frame.T_cam_world, options_.pose);
    std::optional<cfp::PoseStep<double>> step;
    if (believed) step = believed->step_to(result.T_cam_world, frame.time_s);
    RefinedPose out{0, 0, cfp::assess_pose(result, observations.pixels, weights_, inlier_, step, health)};
    if (!cfp::is_solved(result.status)) return out;
    if (decided) {  // what agrees with that, proven or not, makes it more exact
      for (std::size_t o = 0; o < weights_.size(); ++o)
        weights_[o] = inlier_[o] != 0 ? static_cast<double>(weight[keypoint_[o]]) : 0.0;
      cfp::PoseOptions narrow = options_.pose;
      narrow.rounds[0] = narrow.rounds[narrow.round_count - 1];
      narrow.round_count = 1;
      if (const cfp::PoseResult exact = solve(result.T_cam_world, narrow); cfp::is_solved(exact.status)) result = exact;
    }
    frame.T_cam_world = result.T_cam_world;
    std::size_t proven = 0;
    for (std::size_t o = 0; o < keypoint_.size(); ++o) {
      if (inlier_[o] != 0) {
        const bool counts = cfp::counts_as_inlier(weight[keypoint_[o]], options_.probability);
        out.inliers += counts ? 1U : 0U;
        out.in_map += counts && map.is_alive(frame.map_point[keypoint_[o]]) ? 1U : 0U;
        proven += proven_[o] != 0 ? 1U : 0U;
      } else if (prune) {
        frame.map_point[keypoint_[o]] = no_point;
      }
    }
    if (out.health.ok() && double(expected) >= enough_expected &&
        double(proven) < options_.min_known_share * double(std::min(expected, frame.size())))
      out.health.status = cfp::PoseHealth::few_agree;
    return out;
  }

 private:
  static constexpr double enough_expected = 50;  // proven points in view: what the map knows of this view decides

  void collect(const Frame& frame, const LastFrameMatches& last, const Map& map, cfp::span<const float> weight,
               const View& view) {
    points_.clear();
    pixels_.clear();
    depths_.clear();
    sigmas_.clear();
    weights_.clear();
    keypoint_.clear();
    proven_.clear();
    for (std::size_t i = 0; i < frame.size(); ++i) {
      const bool mapped = map.is_alive(frame.map_point[i]);
      if (!mapped && !last.matched(i)) continue;
      const cfp::Vector3<double>& X =
          mapped ? map.point(frame.map_point[i]).position : last.positions[static_cast<std::size_t>(last.match[i])];
      points_.push_back({X.x(), X.y(), X.z()});
      pixels_.push_back({static_cast<double>(frame.pixels[i][0]), static_cast<double>(frame.pixels[i][1])});
      depths_.push_back(static_cast<double>(frame.depths_m[i]));
      proven_.push_back(mapped && map.is_proven(frame.map_point[i]) ? char(1) : char(0));
      sigmas_.push_back(static_cast<double>(view.sigma(frame.keypoints[i])));
      weights_.push_back(static_cast<double>(weight[i]));
      keypoint_.push_back(i);
    }
  }

  // What enters the view and moves, and no detector knows, must not outvote what keyframes agree about: where enough of
  // that is to be expected in view, all else weighs a small share of it, and only helps where that leaves the pose
  // open. Where the camera looks at something new, all counts. Returns whether the proven ones decided.
  bool let_proven_decide(std::size_t expected) {
    constexpr double few = 20;
    double proven = 0, others = 0;
    for (std::size_t o = 0; o < weights_.size(); ++o) (proven_[o] != 0 ? proven : others) += weights_[o];
    const double share = std::min(1.0, options_.unproven_share * proven / std::max(others, 1e-9));
    const double known = std::clamp((static_cast<double>(expected) - few) / (enough_expected - few), 0.0, 1.0);
    for (std::size_t o = 0; o < weights_.size(); ++o) weights_[o] *= proven_[o] != 0 ? 1 : 1 + (share - 1) * known;
    return share < 1 && known > 0;
  }

  Options options_;
  cfp::PoseWorkspace<double> workspace_;
  std::vector<std::array<double, 3>> points_;
  std::vector<std::array<double, 2>> pixels_;
  std::vector<double> depths_, sigmas_, weights_;
  std::vector<std::size_t> keypoint_;
  std::vector<char> inlier_, proven_;
};

}  // namespace cfp_slam
