// The steps of a frame on a synthetic scene, with the state and the map points that a host would hold.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "cfp/frame/static_probability.hpp"
#include "support/dynamic_scene.hpp"
#include "support/engines.hpp"

namespace cfp_test {

/// The first stage's evidence comes from the objects alone, not from the flow at each keypoint.
inline cfp::FrameOptions by_objects_alone() {
  cfp::FrameOptions options;
  options.coarse.flow_radius_px = 0;
  return options;
}

/// Flow without depths has none, whatever the keypoints have.
inline cfp::FrameOptions by_flow_alone() {
  cfp::FrameOptions options;
  options.coarse.flow_depth_radius_px = 0;
  return options;
}

template <typename Scalar>
struct FrameRun {
  explicit FrameRun(DynamicScene<Scalar> s) : scene(std::move(s)), m(scene.keypoints.size(), Scalar(1)) {
    pose = {scene.T_cur_prev, 300};
  }

  cfp::Frame<Scalar> previous_frame() const {
    cfp::Frame<Scalar> frame;
    frame.keypoints = scene.previous_keypoints;
    frame.depths = scene.previous_depths;
    return frame;
  }
  cfp::Frame<Scalar> frame() const {
    cfp::Frame<Scalar> frame;
    frame.timestamp_s = 1.0 / 30;
    frame.keypoints = scene.keypoints;
    frame.depths = scene.depths;
    frame.flow = {scene.previous_keypoints, scene.keypoints};
    return frame;
  }

  // Stage 1, the scene's boxes being those of people who had one in the frame before. Returns the report.
  const cfp::FrameReport& coarse(const cfp::FrameOptions& options = {}) {
    return coarse(options, frame(), scene.camera);
  }
  template <typename Camera>
  const cfp::FrameReport& coarse(const cfp::FrameOptions& options, const cfp::Frame<Scalar>& current,
                                 const Camera& camera) {
    cfp::begin_frame(previous_frame(), state);
    state.current.object_depths = previous_object_depths;
    cfp::begin_frame(current, state);
    for (std::size_t b = 0; b < scene.boxes.size(); ++b) {
      cfp::TrackedBox<Scalar> box;
      box.id = static_cast<std::int64_t>(b);
      box.box = scene.boxes[b];
      box.detection = static_cast<int>(b);
      box.associated = true;
      state.boxes.push_back(box);
    }
    cfp::estimate_objects(current, camera, options, state);
    cfp::label_keypoints(current, options, state);
    return state.report;
  }

  // Stage 2 on the scene as it is now, which a test may have spoilt since stage 1.
  const cfp::FrameReport& fine(const cfp::FrameOptions& options = {}) { return fine(options, scene.camera); }
  template <typename Camera>
  const cfp::FrameReport& fine(const cfp::FrameOptions& options, const Camera& camera) {
    state.previous.keypoints = scene.previous_keypoints;
    state.previous.depths = scene.previous_depths;
    state.current.keypoints = scene.keypoints;
    cfp::match_in_boxes(pose.T_cur_prev, scene.match, camera, options, state);
    cfp::constrain_keypoints(pose, m, camera, options, state);
    cfp::weigh_keypoints(m, options, state);
    cfp::update_map_points(options, state, m);
    return state.report;
  }

  // K and label of keypoint i.
  Scalar k(std::size_t i) const { return state.static_probability[i]; }
  cfp::KeypointLabel label(std::size_t i) const { return state.label[i]; }

  DynamicScene<Scalar> scene;
  std::vector<Scalar> m;
  std::vector<cfp::OfTrack<Scalar>> previous_object_depths;  // of the boxes in the frame before
  cfp::PoseEstimate pose;
  cfp::FrameState<Scalar> state;
};

/// Both stages of a scene.
template <typename Scalar>
FrameRun<Scalar> run_stages(const DynamicScene<Scalar>& scene, const cfp::FrameOptions& options = {}) {
  FrameRun<Scalar> run(scene);
  run.coarse(options);
  run.fine(options);
  return run;
}

}  // namespace cfp_test
