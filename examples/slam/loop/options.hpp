// Everything that can be chosen about a run.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../../support/orb_features.hpp"
#include "cfp/frame/detector_health.hpp"
#include "cfp/frame/detector_lag.hpp"
#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/pose_health.hpp"
#include "cfp/interop/opencv_flow.hpp"
#include "cfp/optimization/pose/pose_problem.hpp"

namespace cfp_slam {

struct MappingOptions {
  int min_gap = 3;                // frames between keyframes, at least; the bundle adjustment is handed over within it
  int max_gap = 30;               // and at most
  double reference_share = 0.75;  // fewer inliers than this share of the reference keyframe's points: take one
  float close_m = 3.2F;           // points whose depth says much about the position (ORB-SLAM2: 40 baselines)
  std::size_t min_close = 100, new_close = 70;  // fewer close ones tracked, and more to be had: take one
  double min_found_share = 0.25;                // points seen in a smaller share of the frames that should see them go
  std::size_t min_observations = 2;  // as do points in fewer keyframes than this, three keyframes after their own
  double superfluous_share = 0.9;    // keyframes of whose points three others see this share go
  std::size_t max_keyframes = 500;   // over all worlds: beyond, the smallest other world goes, unless it is
                                     // larger than the camera's, then the oldest of all
};

struct LocalBundleOptions {
  std::size_t free_keyframes = 10;   // adjusted, the newest among them
  std::size_t fixed_keyframes = 10;  // see the same points and hold the gauge
  int max_iterations = 10;
  double max_shift_m = 0.075;  // of the newest keyframe: farther, and it contradicts the pose that was believed
};

struct Options {
  cfp::Variant variant = cfp::Variant::cfp;
  std::uint64_t seed = 1;
  bool threads = true;            // false: everything on one thread; the trajectory is the same, bit for bit
  std::size_t max_frames = 0;     // 0: all
  bool give_depths = true;        // false: cfp gets none, as from a host with one camera; the loop keeps its own
  cfp::FrameOptions probability;  // before the variant switches parts of it off
  cfp_examples::FeatureOptions features;
  cfp::OpticalFlowOptions flow;
  double flow_edge_px = 0;  // so near to the edge of a surface, the depth of a flow pair is not believed; 0: it is
  cfp::PoseOptions pose;
  MappingOptions mapping;
  LocalBundleOptions bundle;
  double keypoint_sigma_px = 1;                               // of one coordinate, at level 0 of the pyramid
  double baseline_fx = 80;                                    // of depth as a stereo camera's; ORB-SLAM2 has 40
  cfp::PoseHealthOptions first_health = first_pose_health();  // what a pose of the coarse weights must have
  cfp::PoseHealthOptions health;                              // what a tracked frame's pose must have
  cfp::PoseHealthOptions relocalised_health = relocalised_pose_health();  // what one from the map alone must have
  cfp::DetectorHealthOptions detector_health;
  cfp::DetectorLagOptions detector_lag;
  int max_idle = 30;                // frames over which boxes are carried on while the detector is not believed
  double new_map_after_s = 1;       // of being lost
  double unproven_share = 0.01;     // in the pose: weight of what fewer than two keyframes saw, relative to all else
  double min_known_share = 0.05;    // of the proven points that should be in view: fewer found, and it is not there
  int probation = 5;                // frames after a relocalisation in which the map learns nothing
  std::size_t enough_matches = 40;  // with the last frame; with fewer the search is widened
  std::size_t min_initial_points = 100;
  float search_radius = 15;  // pixels at level 0, around a point of the last frame

  // From few points, so not exact yet, but from points that agree.
  static cfp::PoseHealthOptions first_pose_health() {
    cfp::PoseHealthOptions health;
    health.min_inliers = 10;
    health.min_spread = 0;
    health.max_position_sigma_m = 0.1;
    health.max_rotation_sigma_rad = 0.05;
    return health;
  }
  // Nothing but the image speaks for it: 2.5 standard deviations are the 5 cm of a right pose.
  static cfp::PoseHealthOptions relocalised_pose_health() {
    cfp::PoseHealthOptions health;
    health.min_inliers = 30;
    health.min_inlier_share = 0.4;
    health.max_position_sigma_m = 0.02;
    return health;
  }

  [[nodiscard]] bool use_detector() const { return probability.use_boxes; }
  [[nodiscard]] bool use_flow() const { return use_detector() && probability.coarse.use_object_probability; }
};

}  // namespace cfp_slam
