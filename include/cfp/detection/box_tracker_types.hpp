/// @file box_tracker_types.hpp
/// Input, options and output of the box tracker (paper IV-A).
#pragma once

#include "cfp/core/options.hpp"
#include "cfp/core/span.hpp"
#include "cfp/core/status.hpp"
#include "cfp/detection/box_motion.hpp"
#include "cfp/geometry/box.hpp"

namespace cfp {

/// One box of a detector.
template <typename Scalar>
struct Detection {
  Box<Scalar> box;           ///< px; improper ones are skipped and counted
  int class_id = 0;          ///< boxes of different classes are never associated
  Scalar score = Scalar(1);  ///< on any scale, higher is more confident; NaN: the detection is skipped
};

/// One box of the tracker's output.
template <typename Scalar>
struct TrackedBox {
  Box<Scalar> box;            ///< as detected, or as predicted and clipped to the image when compensated
  Scalar rate_x{}, rate_y{};  ///< of its centre, px/s, without the image motion
  int class_id = 0;
  Scalar score{};       ///< of the last detection
  std::int64_t id = 0;  ///< 1, 2, 3, ...; never used twice between resets
  int detection = -1;   ///< index among this frame's detections; -1: compensated, the detector missed it
  int age = 0;          ///< frames since the first detection, or the one that started the track anew
  int missed = 0;       ///< frames since the last detection; 0 when detected
  /// this object had an output box in frame k-1; false: its foreground gets K = 0 (paper IV-D)
  bool associated = false;

  [[nodiscard]] bool compensated() const noexcept { return detection < 0; }
};

/// Defaults from benchmarks/studies/tracker_study.cpp (TUD-Stadtmitte and simulated walkers; the table is printed by
/// it).
struct BoxTrackerOptions {
  BoxMotionOptions motion;
  double min_iou = 0.3;  ///< gate of the association: a pair needs more than this IoU, in [0, 1)
  /// gate of a restart: an unassociated detection restarts a track without detection if they are closer than this by
  /// `box_distance_sq`, in standard deviations, >= 0 (0: it always starts a new track)
  double restart_gate = 4;
  double min_score = -1e300;  ///< detections below are ignored
  /// detections below extend a track but start none (and are not output when they extend none)
  double birth_threshold = -1e300;
  int confirm_hits = 2;  ///< detections before a missed one may be compensated, >= 1
  int max_coast = 6;     ///< misses in a row that are compensated, >= 0 (the paper's figure shows six)
  /// the same while the detector does not run, also for tracks of one detection; used if larger than max_coast, >= 0.
  /// After it a track continues without a box until the detector runs (cfp_posterior_study)
  int max_idle = 30;
  /// while the detector runs: misses compensated per detection so far, > 0 (1: no longer than it was seen)
  double coast_per_hit = 1.0;
  double min_visible = 0.25;  ///< a compensated box with a smaller share of its area in the image is dropped, in [0, 1]
  double max_gap_s = 2.0;     ///< after a longer dt the frames are not adjacent: all tracks are dropped, s, > 0
  double image_width = 0;     ///< px; 0: unknown, nothing is clipped
  double image_height = 0;    ///< px
};

inline namespace CFP_ISA {

/// Whether a detection can be tracked: a proper box, no edge beyond 1e6 px, and a score.
template <typename Scalar>
[[nodiscard]] bool is_trackable(const Detection<Scalar>& d) noexcept {
  const Scalar far = Scalar(detail::box_farthest_px);
  return is_proper(d.box) && d.box.x1 >= -far && d.box.y1 >= -far && d.box.x2 <= far && d.box.y2 <= far &&
         d.score == d.score;
}

[[nodiscard]] inline OptionPath invalid_field(const BoxTrackerOptions& o) noexcept {
  if (const OptionPath field = nested("motion", invalid_field(o.motion))) return field;
  if (!(o.min_iou >= 0 && o.min_iou < 1)) return "min_iou";
  if (!(o.restart_gate >= 0 && o.restart_gate <= 1e6)) return "restart_gate";
  if (!is_finite(o.min_score)) return "min_score";
  if (!is_finite(o.birth_threshold)) return "birth_threshold";
  if (!(o.confirm_hits >= 1)) return "confirm_hits";
  if (!(o.max_idle >= 0)) return "max_idle";
  if (!(o.max_coast >= 0)) return "max_coast";
  if (!detail::positive(o.coast_per_hit)) return "coast_per_hit";
  if (!(o.min_visible >= 0 && o.min_visible <= 1)) return "min_visible";
  if (!(o.max_gap_s > 0 && o.max_gap_s <= 1e6)) return "max_gap_s";
  if (!(o.image_width >= 0 && o.image_width <= 1e6)) return "image_width";
  if (!(o.image_height >= 0 && o.image_height <= 1e6)) return "image_height";
  return {};
}

}  // namespace CFP_ISA

/// One frame's result. `boxes` views the tracker's memory and holds until its next call.
template <typename Scalar>
struct BoxTrackerResult {
  Status status = Status::ok;            ///< invalid_input: dt was negative or not finite, and counted as 0
  bool after_gap = false;                ///< dt was above max_gap_s: all tracks ended
  span<const TrackedBox<Scalar>> boxes;  ///< oldest track first
  std::size_t skipped = 0;               ///< detections that were improper, too large (1e6 px) or without a score
  std::size_t ignored = 0;               ///< detections below min_score, or below birth_threshold without a track
  std::size_t compensated = 0;           ///< boxes among the output that the detector missed
  std::size_t unwarped = 0;              ///< predictions that the image motion could not be applied to
};

}  // namespace cfp
