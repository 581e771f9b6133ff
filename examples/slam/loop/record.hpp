// What the loop knows of a frame when it is done, and the names of its parts.
#pragma once

#include <string>

#include "cfp/frame/pose_health.hpp"

namespace cfp_slam {

// Where a frame's time goes, in the order of the loop. `detection` and `flow` run beside `features`; `reading` is not
// part of the tracking thread, nor is `bundle_adjustment` while it runs beside the next frames.
enum class Module : std::uint8_t {
  reading,            // decoding the two images
  detection,          // object detector, its own thread
  features,           // ORB keypoints and descriptors
  flow,               // optical flow for the object stage
  coarse,             // missed detections, objects, depth (the paper's "box filter", with flow its "static probability
                      // of objects", and "DBSCAN")
  fine,               // both constraints, M, weights (the paper's "static probability of keypoints")
  matching,           // search for the last frame's and the local map's points
  pose,               // weighted pose refinements, relocalisation
  mapping,            // what the map learns, keyframes, new points, culling
  bundle_adjustment,  // local BA
  tracking,           // the whole tracking thread, `detection` only as far as it was waited for
  count
};
inline constexpr std::size_t module_count = static_cast<std::size_t>(Module::count);

constexpr const char* to_string(Module module) {
  constexpr const char* names[] = {"reading",      "detection",         "features",       "flow",
                                   "coarse stage", "fine stage",        "matching",       "pose",
                                   "mapping",      "bundle adjustment", "tracking thread"};
  return names[static_cast<std::size_t>(module)];
}

enum class Outcome : std::uint8_t {
  tracked,
  relocalised,  // a pose from the map alone, after a loss or a gap, on probation after one, or in a map of its own
  lost,         // no pose; none is invented
  skipped       // the images could not be used; `note` says why
};
constexpr const char* to_string(Outcome outcome) {
  constexpr const char* names[] = {"tracked", "relocalised", "lost", "skipped"};
  return names[static_cast<std::size_t>(outcome)];
}

struct FrameRecord {
  double time_s = 0;
  std::string image;  // file of the colour image, relative to the recording
  Outcome outcome = Outcome::lost;
  std::string note;  // why a frame was skipped or lost, and whatever else a user must hear of
  bool keyframe = false;
  std::size_t keypoints = 0, matches = 0, inliers = 0;
  cfp::PoseAssessment pose;

  void add_note(const std::string& what) { note += (note.empty() ? "" : "; ") + what; }
};

}  // namespace cfp_slam
