// The frame's pose: weighted refinement over everything that it sees.
#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include "cfp/core/span.hpp"
#include "cfp/frame/pose_health.hpp"
#include "cfp/frame/weigh_keypoints.hpp"
#include "cfp/optimization/pose/pose_refinement.hpp"
#include "matching.hpp"
#include "options.hpp"

namespace cfp_slam {

struct BelievedPose {
  double time_s = 0;
  cfp::SE3<double> T_cam_world;

  [[nodiscard]] cfp::PoseStep<double> step_to(const Frame& frame) const {
    return {frame.T_cam_world * T_cam_world.inverse(), frame.time_s - time_s};
  }
};

struct RefinedPose {
  std::size_t inliers = 0;  // that count
  std::size_t in_map = 0;   // of them; the others are known from the last frame alone
  cfp::PoseAssessment health;
  bool from_map = false;  // alone: nothing of the last frame led to it
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
    Seen seen = all_seen(frame, last, map, weight, view);
    const bool decided = let_proven_decide(expected, seen);
    cfp::PoseObservations<double> observations;
    observations.points = seen.points;
    observations.pixels = seen.pixels;
    observations.weights = seen.weights;
    observations.sigmas = seen.sigmas;
    observations.depths = seen.depths;
    observations.baseline_fx = view.baseline_fx;
    std::vector<char> inlier(seen.keypoints.size());
    const auto solve = [&](const cfp::PoseOptions& options) {
      const auto result = cfp::refine_pose(observations, view.exact, frame.T_cam_world, options, workspace_, inlier);
      if (cfp::is_solved(result.status)) frame.T_cam_world = result.T_cam_world;
      return result;
    };
    const cfp::PoseResult result = solve(options_.pose);
    std::optional<cfp::PoseStep<double>> step;
    if (believed) step = believed->step_to(frame);
    RefinedPose out{0, 0, cfp::assess_pose(result, observations.pixels, seen.weights, inlier, step, health), false};
    if (!cfp::is_solved(result.status)) return out;
    if (decided) {  // what agrees with that, proven or not, makes it more exact
      for (std::size_t o = 0; o < inlier.size(); ++o)
        seen.weights[o] = inlier[o] != 0 ? static_cast<double>(weight[seen.keypoints[o]]) : 0.0;
      cfp::PoseOptions narrow = options_.pose;
      narrow.rounds[0] = narrow.rounds[narrow.round_count - 1];
      narrow.round_count = 1;
      solve(narrow);
    }
    std::size_t proven = 0;
    for (std::size_t o = 0; o < inlier.size(); ++o) {
      int& map_point = frame.map_point[seen.keypoints[o]];
      if (inlier[o] != 0) {
        const bool counts = cfp::counts_as_inlier(weight[seen.keypoints[o]], options_.probability);
        out.inliers += counts ? 1U : 0U;
        out.in_map += counts && map.is_alive(map_point) ? 1U : 0U;
        proven += seen.proven[o] ? 1U : 0U;
      } else if (prune) {
        map_point = no_point;
      }
    }
    if (out.health.ok() && double(expected) >= enough_expected &&
        double(proven) < options_.min_known_share * double(std::min(expected, frame.size())))
      out.health.status = cfp::PoseHealth::few_agree;
    return out;
  }

 private:
  static constexpr double enough_expected = 50;  // proven points in view: what the map knows of this view decides

  struct Seen {  // observation by observation
    std::vector<std::size_t> keypoints;
    std::vector<cfp::Vector3<double>> points;
    std::vector<std::array<double, 2>> pixels;
    std::vector<double> depths, sigmas, weights;
    std::vector<bool> proven;
  };

  static Seen all_seen(const Frame& frame, const LastFrameMatches& last, const Map& map, cfp::span<const float> weight,
                       const View& view) {
    Seen seen;
    for (std::size_t i = 0; i < frame.size(); ++i) {
      const MapPoint* const point = map.find(frame.map_point[i]);
      if (point == nullptr && !last.matched(i)) continue;
      seen.keypoints.push_back(i);
      seen.points.push_back(point != nullptr ? point->position
                                             : last.positions[static_cast<std::size_t>(last.match[i])]);
      seen.pixels.push_back({static_cast<double>(frame.pixels[i][0]), static_cast<double>(frame.pixels[i][1])});
      seen.depths.push_back(static_cast<double>(frame.depths_m[i]));
      seen.sigmas.push_back(static_cast<double>(view.sigma(frame.keypoints[i])));
      seen.weights.push_back(static_cast<double>(weight[i]));
      seen.proven.push_back(point != nullptr && map.is_proven(*point));
    }
    return seen;
  }

  // What enters the view and moves, and no detector knows, must not outvote what keyframes agree about: where enough of
  // that is to be expected in view, all else weighs a small share of it, and only helps where that leaves the pose
  // open. Where the camera looks at something new, all counts. Returns whether the proven ones decided.
  bool let_proven_decide(std::size_t expected, Seen& seen) const {
    constexpr double few = 20;
    double proven = 0, others = 0;
    for (std::size_t o = 0; o < seen.weights.size(); ++o) (seen.proven[o] ? proven : others) += seen.weights[o];
    const double share = std::min(1.0, options_.unproven_share * proven / std::max(others, 1e-9));
    const double known = std::clamp((static_cast<double>(expected) - few) / (enough_expected - few), 0.0, 1.0);
    for (std::size_t o = 0; o < seen.weights.size(); ++o)
      seen.weights[o] *= seen.proven[o] ? 1 : 1 + (share - 1) * known;
    return share < 1 && known > 0;
  }

  Options options_;
  cfp::PoseWorkspace<double> workspace_;
};

}  // namespace cfp_slam
