/// @file box_tracker.hpp
/// Missed-detection compensation (paper IV-A): the boxes of the last frame are predicted, associated with the
/// detections of this one, and what finds no detection is output as a *compensated* box; every output box says whether
/// its object had a box in frame k-1. Departures: the paper filters twice per frame (to compensate, then to associate
/// adjacent frames). Here one track carries both answers, since a compensated box belongs to its track by construction;
/// and how long a box may be compensated, which the paper leaves open, is an option.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <tuple>
#include <vector>

#include "cfp/core/assert.hpp"
#include "cfp/detection/box_association.hpp"
#include "cfp/detection/box_tracker_types.hpp"

namespace cfp {

/// Not thread-safe; one tracker per camera. After warm-up (as many tracks and detections as before) a frame allocates
/// nothing. Equal calls give equal bits; the order of a frame's detections changes nothing but their indices. Ties
/// between overlaps that are equal to the last bit apart.
template <typename Scalar = double>
class BoxTracker {
 public:
  /// Options outside their ranges are the caller's error: see `validate`.
  explicit BoxTracker(const BoxTrackerOptions& options = {}) : options_(options) {
    CFP_ASSERT(!invalid_field(options));
  }

  /// The next frame, dt_s seconds after the one before (0 for the first). Every detection that counts is output, from
  /// its first frame on; a track with at least confirm_hits detections is compensated for up to max_coast frames; one
  /// with fewer ends with the first miss. image_motion, when given, maps pixels of the frame before to this one (see
  /// `warp`) and is applied to the predictions: hand it over when the camera turns fast.
  BoxTrackerResult<Scalar> update(span<const Detection<Scalar>> detections, Scalar dt_s,
                                  const Eigen::Matrix<Scalar, 3, 3>* image_motion = nullptr) {
    BoxTrackerResult<Scalar> result = advance(dt_s, image_motion);
    select(detections, result);
    partner_.resize(tracks_.size());
    associate_boxes<Scalar>(predicted_, candidates_, options_.min_iou, partner_, workspace_);
    extend_tracks();
    start_tracks(result);
    finish(result, false);
    return result;
  }

  /// A frame on which the detector did not run: nothing was missed, so tracks of one detection live on, but confirmed
  /// tracks are output as compensated and age towards max_coast all the same. For a detector that runs on every n-th
  /// frame only.
  BoxTrackerResult<Scalar> skip(Scalar dt_s, const Eigen::Matrix<Scalar, 3, 3>* image_motion = nullptr) {
    BoxTrackerResult<Scalar> result = advance(dt_s, image_motion);
    for (Track& track : tracks_) track.detection = -1;
    finish(result, true);
    return result;
  }

  /// Forgets all tracks; ids start again at 1.
  void reset() noexcept {
    tracks_.clear();
    next_id_ = 1;
  }
  [[nodiscard]] const BoxTrackerOptions& options() const noexcept { return options_; }

 private:
  struct Track {
    BoxFilter<Scalar> filter;
    Box<Scalar> box;  // of the last detection
    std::int64_t id;
    Scalar score;
    int class_id, hits, age, missed, detection;
    bool shown;  // in the output of the frame before
  };

  BoxTrackerResult<Scalar> advance(Scalar dt_s, const Eigen::Matrix<Scalar, 3, 3>* image_motion) {
    BoxTrackerResult<Scalar> result;
    if (!(dt_s >= Scalar(0)) || !is_finite(dt_s)) {
      result.status = Status::invalid_input;
      dt_s = Scalar(0);
    }
    if (static_cast<double>(dt_s) > options_.max_gap_s) tracks_.clear();
    predicted_.clear();
    for (Track& track : tracks_) {
      predict(track.filter, dt_s, options_.motion);
      if (image_motion != nullptr && !warp(track.filter, *image_motion)) ++result.unwarped;
      track.age = next(track.age);
      predicted_.push_back({track.filter.box(), track.class_id});
    }
    return result;
  }

  /// Keeps what can be used of the detections, with where it came from.
  void select(span<const Detection<Scalar>> detections, BoxTrackerResult<Scalar>& result) {
    const Scalar far = Scalar(1e6);
    candidates_.clear();
    sources_.clear();
    for (std::size_t i = 0; i < detections.size(); ++i) {
      const Detection<Scalar>& d = detections[i];
      const bool usable = is_proper(d.box) && d.score == d.score && d.box.x1 >= -far && d.box.y1 >= -far &&
                          d.box.x2 <= far && d.box.y2 <= far;
      if (!usable) {
        ++result.skipped;
      } else if (!(static_cast<double>(d.score) >= options_.min_score)) {
        ++result.ignored;
      } else {
        candidates_.push_back({d.box, d.class_id});
        sources_.push_back({d.score, static_cast<int>(i), true});
      }
    }
  }

  void extend_tracks() {
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
      Track& track = tracks_[i];
      track.detection = -1;
      if (partner_[i] == unassigned) continue;
      const std::size_t j = static_cast<std::size_t>(partner_[i]);
      cfp::update(track.filter, candidates_[j].box, options_.motion);
      track.box = candidates_[j].box;
      track.score = sources_[j].score;
      track.detection = sources_[j].index;
      track.hits = next(track.hits);
      sources_[j].free = false;
    }
  }

  void start_tracks(BoxTrackerResult<Scalar>& result) {
    births_.clear();
    for (std::size_t j = 0; j < candidates_.size(); ++j) {
      if (!sources_[j].free) continue;
      if (static_cast<double>(sources_[j].score) >= options_.birth_score) {
        births_.push_back(j);
      } else {
        ++result.ignored;
      }
    }
    // Newcomers get their ids in an order of their own, so that the order of the detections does not matter.
    std::sort(births_.begin(), births_.end(), [this](std::size_t a, std::size_t b) { return key(a) < key(b); });
    for (const std::size_t j : births_) {
      const ClassBox<Scalar>& c = candidates_[j];
      tracks_.push_back({make_box_filter(c.box, options_.motion), c.box, next_id_++, sources_[j].score, c.class_id, 1,
                         0, 0, sources_[j].index, false});
    }
  }

  /// Outputs what is seen or compensated, and drops the tracks that ended.
  void finish(BoxTrackerResult<Scalar>& result, bool detector_skipped) {
    output_.clear();
    std::size_t kept = 0;
    for (Track& track : tracks_) {
      const bool seen = track.detection >= 0;
      const bool confirmed = track.hits >= options_.confirm_hits;
      track.missed = seen ? 0 : next(track.missed);
      Box<Scalar> box = track.box;
      if (!seen) {
        if (track.missed > options_.max_coast) continue;
        if (!detector_skipped && !(confirmed && track.missed <= options_.coast_per_hit * track.hits)) continue;
        box = track.filter.box();
        if (!clip_to_image(box)) continue;
      }
      if (seen || confirmed) {
        output_.push_back(
            {box, track.class_id, track.score, track.id, track.detection, track.age, track.missed, track.shown});
        result.compensated += seen ? 0 : 1;
      }
      track.shown = seen || confirmed;
      tracks_[kept++] = track;
    }
    tracks_.erase(tracks_.begin() + static_cast<std::ptrdiff_t>(kept), tracks_.end());
    result.boxes = output_;
  }

  /// False when too little of the box is left.
  [[nodiscard]] bool clip_to_image(Box<Scalar>& box) const noexcept {
    if (!(options_.image_width > 0 && options_.image_height > 0)) return true;
    const Box<Scalar> visible = clip(box, Scalar(options_.image_width), Scalar(options_.image_height));
    if (!(area(visible) > Scalar(0) && area(visible) >= Scalar(options_.min_visible) * area(box))) return false;
    box = visible;
    return true;
  }

  [[nodiscard]] auto key(std::size_t j) const noexcept {
    const ClassBox<Scalar>& c = candidates_[j];
    return std::make_tuple(c.box.x1, c.box.y1, c.box.x2, c.box.y2, c.class_id, -sources_[j].score);
  }
  [[nodiscard]] static int next(int count) noexcept { return count < 1000000000 ? count + 1 : count; }

  struct Source {
    Scalar score;
    int index;
    bool free;
  };

  BoxTrackerOptions options_;
  std::int64_t next_id_ = 1;
  std::vector<Track> tracks_;
  std::vector<TrackedBox<Scalar>> output_;
  std::vector<ClassBox<Scalar>> predicted_, candidates_;
  std::vector<Source> sources_;
  std::vector<int> partner_;
  std::vector<std::size_t> births_;
  BoxAssociationWorkspace workspace_;
};

}  // namespace cfp
