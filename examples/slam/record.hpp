// What a run of the SLAM example leaves behind: one record per frame and the figures of the whole. The loop fills it,
// the report and the tables read it; neither knows the other.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "cfp/evaluation/error_statistics.hpp"
#include "cfp/evaluation/trajectory.hpp"
#include "cfp/evaluation/trajectory_error.hpp"
#include "cfp/frame/health.hpp"
#include "cfp/geometry/box.hpp"

namespace cfp_slam {

// Where a frame's time goes, in the order of the loop. `detection` runs beside `features` and `flow`; `reading` is not
// part of the tracking thread, nor is `bundle_adjustment` while it runs beside the next frames.
enum class Module : std::uint8_t {
  reading,            // decoding the two images
  detection,          // object detector, its own thread
  features,           // ORB keypoints and descriptors
  flow,               // optical flow for the object stage
  boxes,              // missed-detection compensation        (the paper's "box filter")
  objects,            // F and O                               (with flow: the paper's "static probability of objects")
  keypoints_first,    // depth DBSCAN and K of the first stage (the paper's "DBSCAN")
  keypoints_second,   // K of the second stage, M, weights     (the paper's "static probability of keypoints")
  matching,           // search for the last frame's and the local map's points
  pose,               // weighted pose refinements, relocalisation
  mapping,            // keyframes, new points, culling
  bundle_adjustment,  // local BA
  tracking,           // the whole tracking thread, `detection` only as far as it was waited for
  count
};
inline constexpr std::size_t module_count = static_cast<std::size_t>(Module::count);

constexpr const char* to_string(Module module) {
  constexpr const char* names[] = {"reading",          "detection",
                                   "features",         "flow",
                                   "box filter",       "object probability",
                                   "depth clustering", "keypoint probability",
                                   "matching",         "pose",
                                   "mapping",          "bundle adjustment",
                                   "tracking thread"};
  return names[static_cast<std::size_t>(module)];
}

enum class Outcome : std::uint8_t {
  tracked,
  relocalised,  // a pose from the map alone, after a loss
  lost,         // no pose; none is invented
  skipped       // the images could not be used; `note` says why
};
constexpr const char* to_string(Outcome outcome) {
  constexpr const char* names[] = {"tracked", "relocalised", "lost", "skipped"};
  return names[static_cast<std::size_t>(outcome)];
}

struct BoxRecord {
  std::int64_t id = 0;
  cfp::Box<float> box;
  bool compensated = false;
  double object_probability = 0;
  bool object_known = false;  // false: O is the value for "unknown"
  std::size_t flow_pairs = 0;
};

struct FrameRecord {
  double time_s = 0;
  std::string image;  // file of the colour image, relative to the sequence
  Outcome outcome = Outcome::lost;
  std::string note;              // why a frame was skipped or lost
  cfp::SE3<double> T_world_cam;  // for tracked and relocalised frames
  bool keyframe = false;
  std::size_t keypoints = 0, matches = 0, inliers = 0;
  cfp::FrameHealth health;
  std::vector<BoxRecord> boxes;
  std::array<std::size_t, 10> keypoint_histogram{};  // K of the keypoints inside boxes, ten bins over [0, 1]
  std::array<double, module_count> milliseconds{};
};

// Probabilities with the truth beside them, where the sequence has per-pixel labels.
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

struct RunRecord {
  std::string sequence, variant, detector;
  std::uint64_t seed = 0;
  std::vector<FrameRecord> frames;
  std::size_t keyframes = 0, map_points = 0;
  std::vector<AnnotatedFrame> pictures;
  LabelledSamples first_stage, second_stage, map_point, object;  // in-box keypoints; their map points; boxes
  std::vector<cfp::StampedPose<double>> truth;                   // empty: none known
  cfp::AbsoluteErrorResult absolute;                             // rigid alignment
  cfp::RelativeErrorResult relative;                             // fixed delta of 1 s, as the paper evidently has it

  // Poses of the tracked and relocalised frames, in the order of time.
  [[nodiscard]] std::vector<cfp::StampedPose<double>> trajectory() const {
    std::vector<cfp::StampedPose<double>> poses;
    for (const FrameRecord& frame : frames) {
      if (frame.outcome <= Outcome::relocalised) poses.push_back({frame.time_s, frame.T_world_cam});
    }
    return poses;
  }
};

}  // namespace cfp_slam
