/// @file box_tracker.hpp
/// Missed-detection compensation (paper IV-A): the boxes of the last frame are predicted, associated with the
/// detections of this one, and what finds no detection is output as a *compensated* box; every output box says whether
/// its object had a box in frame k-1. Departures: the paper filters twice per frame (to compensate, then to associate
/// adjacent frames). Here one track carries both answers, since a compensated box belongs to its track by construction;
/// and how long a box may be compensated, which the paper leaves open, is an option.
#pragma once

#include <algorithm>
#include <tuple>
#include <vector>

#include "cfp/detection/assignment.hpp"
#include "cfp/detection/box_motion.hpp"
#include "cfp/detection/box_tracker_types.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// Not thread-safe; one tracker per camera. After warm-up (as many tracks and detections as before) a frame allocates
/// nothing. Equal calls give equal bits. The order of a frame's detections changes nothing but their indices.
template <typename Scalar = double>
class BoxTracker {
 public:
  /// Options outside their ranges are the caller's error: see `validate`.
  explicit BoxTracker(const BoxTrackerOptions& options = {}) : options_(options) {
    CFP_ASSERT(!invalid_field(options));
  }

  /// The next frame, dt_s seconds after the one before (0 for the first). Every detection that counts is output, from
  /// its first frame on; a track with at least confirm_hits detections is compensated for up to max_coast such frames
  /// in a row, not counting frames on which the detector did not run; one with fewer ends with the first miss. An
  /// unassociated detection within restart_gate of a track without a detection restarts that track, with its id.
  /// image_motion, when given, maps pixels of the frame before to this one (see `warp_box`) and is applied to the
  /// predictions: hand it over when the camera turns fast.
  BoxTrackerResult<Scalar> track(span<const Detection<Scalar>> detections, Scalar dt_s,
                                 const Matrix3<Scalar>* image_motion = nullptr) {
    BoxTrackerResult<Scalar> result = advance(dt_s, image_motion);
    select(detections, result);
    const auto distance = [](const Track& a, const Candidate& b) { return 1 - static_cast<double>(iou(a.box, b.box)); };
    const std::size_t pairs = associate(1 - options_.min_iou, distance, [this](Track& track, const Candidate& seen) {
      correct_box(track.filter, seen.box, options_.motion);
    });
    if (pairs < (std::min)(tracks_.size(), candidates_.size())) restart_tracks();
    start_tracks(result);
    output(result, true);
    return result;
  }

  /// A frame on which the detector did not run: nothing was missed, so all tracks continue, even those of one
  /// detection, and are output as compensated up to max_idle (or max_coast) frames after their last one. For a detector
  /// that runs on every n-th frame only.
  BoxTrackerResult<Scalar> coast(Scalar dt_s, const Matrix3<Scalar>* image_motion = nullptr) {
    BoxTrackerResult<Scalar> result = advance(dt_s, image_motion);
    output(result, false);
    return result;
  }

  /// Forgets all tracks; ids start again at 1.
  void reset() noexcept {
    tracks_.clear();
    next_id_ = 1;
  }

 private:
  // The box is the predicted one, until a detection replaces it.
  struct Track : TrackedBox<Scalar> {
    BoxFilter<Scalar> filter;
    int hits = 0, misses = 0;  // misses: in a row, of frames on which the detector ran
    bool shown = false;        // in the output of the frame before
  };
  struct Candidate : Detection<Scalar> {
    int index = -1;
    bool may_start = false;
    bool free = true;
  };

  BoxTrackerResult<Scalar> advance(Scalar dt_s, const Matrix3<Scalar>* image_motion) {
    BoxTrackerResult<Scalar> result;
    if (!(dt_s >= Scalar(0)) || !is_finite(dt_s)) {
      result.status = Status::invalid_input;
      dt_s = Scalar(0);
    }
    result.after_gap = static_cast<double>(dt_s) > options_.max_gap_s;
    if (result.after_gap) tracks_.clear();
    for (Track& track : tracks_) {
      predict_box(track.filter, dt_s, options_.motion);
      if (image_motion != nullptr && !warp_box(track.filter, *image_motion)) ++result.unwarped;
      track.box = track.filter.box();
      track.age = next_count(track.age);
      track.missed = next_count(track.missed);
      track.detection = -1;
    }
    return result;
  }

  // Keeps what can be used of the detections, with where it came from, in an order of its own: that of the detections
  // must not matter.
  void select(span<const Detection<Scalar>> detections, BoxTrackerResult<Scalar>& result) {
    candidates_.clear();
    for (std::size_t i = 0; i < detections.size(); ++i) {
      const Detection<Scalar>& d = detections[i];
      const auto score = static_cast<double>(d.score);
      if (!is_trackable(d)) {
        ++result.skipped;
      } else if (!(score >= options_.min_score)) {
        ++result.ignored;
      } else {
        candidates_.push_back({d, static_cast<int>(i), score >= options_.birth_threshold});
      }
    }
    const auto key = [](const Candidate& c) {
      return std::make_tuple(c.box.x1, c.box.y1, c.box.x2, c.box.y2, c.class_id, -c.score);
    };
    std::sort(candidates_.begin(), candidates_.end(),
              [&](const Candidate& a, const Candidate& b) { return key(a) < key(b); });
  }

  static void show(const Candidate& candidate, Track& track) noexcept {
    track.box = candidate.box;
    track.score = candidate.score;
    track.detection = candidate.index;
    track.missed = track.misses = 0;
    track.hits = next_count(track.hits);
  }

  // Finds the best pairs of one class; each track takes its candidate and shows it. Returns how many do.
  template <typename Cost, typename Take>
  std::size_t associate(double max_cost, const Cost& cost, const Take& take) {
    costs_.clear();
    for (const Track& track : tracks_) {
      for (const Candidate& candidate : candidates_)
        costs_.push_back(track.class_id == candidate.class_id ? cost(track, candidate) : detail::infinity);
    }
    partner_.resize(tracks_.size());
    const CostMatrix costs(costs_, tracks_.size(), candidates_.size());
    const std::size_t pairs = solve_assignment(costs, max_cost, assignment_, partner_).pairs;
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
      if (partner_[i] == unassigned) continue;
      Candidate& candidate = candidates_[static_cast<std::size_t>(partner_[i])];
      take(tracks_[i], candidate);
      show(candidate, tracks_[i]);
      candidate.free = false;
    }
    return pairs;
  }

  // Who turned is not where he is predicted: to go on with the prediction would put a box beside him. The object is the
  // same; its motion is not, and has to be seen again before it is compensated.
  void restart_tracks() {
    const auto distance_sq = [this](const Track& track, const Candidate& candidate) {
      const bool open = track.compensated() && candidate.free && candidate.may_start;
      return open ? static_cast<double>(box_distance_sq(track.filter, candidate.box, options_.motion))
                  : detail::infinity;
    };
    associate(options_.restart_gate * options_.restart_gate, distance_sq, [this](Track& track, const Candidate& seen) {
      track.filter = make_box_filter(seen.box, options_.motion);
      track.hits = track.age = 0;
    });
  }

  void start_tracks(BoxTrackerResult<Scalar>& result) {
    for (const Candidate& candidate : candidates_) {
      result.ignored += candidate.free && !candidate.may_start ? 1U : 0U;
      if (!candidate.free || !candidate.may_start) continue;
      Track track;
      track.filter = make_box_filter(candidate.box, options_.motion);
      track.class_id = candidate.class_id;
      track.id = next_id_++;
      show(candidate, track);
      tracks_.push_back(track);
    }
  }

  // Outputs what is seen or compensated, and drops the tracks that ended.
  void output(BoxTrackerResult<Scalar>& result, bool detector_ran) {
    output_.clear();
    std::size_t kept = 0;
    const int longest = (std::max)(options_.max_coast, options_.max_idle);
    for (Track& track : tracks_) {
      if (detector_ran && track.compensated()) track.misses = next_count(track.misses);
      const bool shown = track.missed <= longest;
      const bool trusted = shown && track.hits >= options_.confirm_hits && track.misses <= options_.max_coast &&
                           track.misses <= options_.coast_per_hit * track.hits;
      if (track.compensated() && ((detector_ran && !trusted) || !clip_to_image(track.box))) continue;
      if (shown) {
        track.associated = track.shown;
        track.rate_x = track.filter.u.rate;
        track.rate_y = track.filter.v.rate;
        output_.push_back(track);
        result.compensated += track.compensated() ? 1U : 0U;
      }
      track.shown = shown;
      tracks_[kept++] = track;
    }
    tracks_.resize(kept);
    result.boxes = output_;
  }

  // False when too little of the box is left.
  [[nodiscard]] bool clip_to_image(Box<Scalar>& box) const noexcept {
    if (!(options_.image_width > 0 && options_.image_height > 0)) return true;
    const Box<Scalar> visible = clip(box, Scalar(options_.image_width), Scalar(options_.image_height));
    if (!(area(visible) > Scalar(0) && area(visible) >= Scalar(options_.min_visible) * area(box))) return false;
    box = visible;
    return true;
  }

  BoxTrackerOptions options_;
  std::int64_t next_id_ = 1;
  std::vector<Track> tracks_;
  std::vector<TrackedBox<Scalar>> output_;
  std::vector<Candidate> candidates_;
  std::vector<double> costs_;
  std::vector<int> partner_;
  AssignmentWorkspace assignment_;
};

}  // namespace CFP_ISA
}  // namespace cfp
