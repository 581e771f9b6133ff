// Everything that can be chosen about a run.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../../support/orb_features.hpp"
#include "cfp/frame/frame_options.hpp"
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
};

struct LocalBundleOptions {
  std::size_t free_keyframes = 10;   // adjusted, the newest among them
  std::size_t fixed_keyframes = 10;  // see the same points and hold the gauge
  int max_iterations = 10;
};

struct Options {
  cfp::Variant variant = cfp::Variant::cfp;
  std::uint64_t seed = 1;
  bool threads = true;            // false: everything on one thread; the trajectory is the same, bit for bit
  std::size_t max_frames = 0;     // 0: all
  cfp::FrameOptions probability;  // before the variant switches parts of it off
  cfp_examples::FeatureOptions features;
  cfp::OpticalFlowOptions flow;
  cfp::PoseOptions pose;
  MappingOptions mapping;
  LocalBundleOptions bundle;
  double baseline_fx = 40;             // ORB-SLAM2's Camera.bf for this sensor
  std::size_t min_first_inliers = 10;  // for the pose of the coarse weights
  std::size_t min_inliers = 20;        // for a tracked frame
  std::size_t min_initial_points = 100;
  float search_radius = 15;  // pixels at level 0, around a point of the last frame

  [[nodiscard]] bool use_detector() const { return probability.use_boxes; }
  [[nodiscard]] bool use_flow() const { return use_detector() && probability.coarse.use_object_probability; }
};

}  // namespace cfp_slam
