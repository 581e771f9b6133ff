// One run of cfp_slam as the report sees it: what the loop wrote, and beside it the truth of its recording.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "../slam/loop/record.hpp"
#include "cfp/evaluation/trajectory_error.hpp"
#include "cfp/frame/health.hpp"
#include "cfp/geometry/box.hpp"
#include "decisions.hpp"

namespace cfp_slam {

// A keypoint inside a box; negative probabilities: none.
struct BoxKeypoint {
  float x = 0, y = 0, size = 0;
  bool foreground = false;
  float coarse = -1, fine = -1, map_point = -1;  // K of the two stages, M
  float weight = -1;                             // in the frame's pose
  [[nodiscard]] float static_probability() const { return fine >= 0 ? fine : coarse; }
};

struct BoxRecord {
  std::int64_t id = 0;
  cfp::Box<float> box;
  bool compensated = false;
  double object_probability = 0;
  bool object_known = false;  // false: O is the value for "unknown"
  std::size_t flow_pairs = 0;
};

struct RunFrame : FrameRecord {
  cfp::FrameHealth health;
  std::vector<BoxRecord> boxes;
  cfp::SE3<double> T_world_cam;  // for tracked and relocalised frames
  bool fallback = false;         // the weights were given up
  std::vector<BoxKeypoint> box_keypoints;
  std::array<double, module_count> milliseconds{};
};

// Probabilities with the truth beside them, where the recording has per-pixel labels.
struct LabelledSamples {
  std::vector<float> probability;
  std::vector<char> is_static;
};

// A picture for the report: boxes, keypoints coloured by K.
struct AnnotatedFrame {
  double time_s = 0;
  std::string caption;
  std::vector<unsigned char> jpeg;
};

// A picture whose keypoints tell why they have their weights.
struct ExplainedFrame {
  std::size_t frame = 0;
  int width = 0, height = 0;
  std::vector<unsigned char> jpeg;
  std::vector<Decision> decisions;
};

struct RunRecord {
  std::string recording;  // its folder
  std::string sequence, variant, detector, options;
  std::uint64_t seed = 0;
  int features = 0;
  std::vector<RunFrame> frames;
  std::size_t keyframes = 0, map_points = 0;
  std::vector<AnnotatedFrame> pictures;
  std::vector<ExplainedFrame> explained;
  std::vector<std::string> notes;                                        // what of the recording could not be read
  LabelledSamples first_stage, second_stage, map_point, weight, object;  // in-box keypoints, their map points; boxes
  std::vector<cfp::StampedPose<double>> truth;                           // empty: none known
  cfp::AbsoluteErrorResult absolute;                                     // rigid alignment
  cfp::RelativeErrorResult relative;  // fixed delta of 1 s, as the paper evidently has it

  // Poses of the tracked and relocalised frames, in the order of time.
  [[nodiscard]] std::vector<cfp::StampedPose<double>> trajectory() const {
    std::vector<cfp::StampedPose<double>> poses;
    for (const RunFrame& frame : frames) {
      if (frame.outcome <= Outcome::relocalised) poses.push_back({frame.time_s, frame.T_world_cam});
    }
    return poses;
  }
};

// Errors against the truth, where there is one.
inline void evaluate(RunRecord& run) {
  if (run.truth.empty()) return;
  const std::vector<cfp::StampedPose<double>> estimate = run.trajectory();
  run.absolute = cfp::absolute_trajectory_error(run.truth, estimate);
  run.relative = cfp::relative_pose_error(run.truth, estimate);
}

}  // namespace cfp_slam
