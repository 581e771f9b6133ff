// Everything that can be chosen about a run.
#pragma once

#include "../../support/orb_features.hpp"
#include "cfp/frame/detector_health.hpp"
#include "cfp/frame/detector_lag.hpp"
#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/pose_health.hpp"
#include "cfp/interop/opencv_flow.hpp"
#include "cfp/optimization/pose/pose_problem.hpp"

namespace cfp_slam {

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
  double keypoint_sigma_px = 1;  // of one coordinate, at level 0 of the pyramid
  double baseline_fx = 320;      // of the stereo camera whose disparity errs by a pixel where a depth errs
  // What a pose must have: inliers, their share, spread, metres and radians of uncertainty. One of the coarse weights
  // is from few points, so not exact yet, but from points that agree. For one from the map alone nothing but the image
  // speaks: 2.5 standard deviations are the 5 cm of a right pose.
  cfp::PoseHealthOptions first_health{10, 0.3, 0, 0.1, 0.05}, health, relocalised_health{30, 0.4, 0.1, 0.02, 0.02};
  cfp::DetectorHealthOptions detector_health;
  cfp::DetectorLagOptions detector_lag;
  double new_map_after_s = 1;     // of being lost
  double unproven_share = 0.01;   // in the pose: weight of what fewer than two keyframes saw, relative to all else
  double min_known_share = 0.05;  // of the proven points that should be in view: fewer found, and it is not there
  std::size_t min_initial_points = 100;
  std::size_t max_keyframes = 500;  // over all maps, see Map::forget
};

}  // namespace cfp_slam
