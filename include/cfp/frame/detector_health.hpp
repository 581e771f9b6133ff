/// @file detector_health.hpp
/// Whether an object detector can be believed on a frame: silent, stuck or absurd detections look like a scene without
/// objects, or with others, and nothing else in a system would notice.
#pragma once

#include <algorithm>
#include <optional>
#include <vector>

#include "cfp/core/options.hpp"
#include "cfp/core/span.hpp"
#include "cfp/detection/box_tracker_types.hpp"
#include "cfp/geometry/box.hpp"

namespace cfp {

struct DetectorHealthOptions {
  int silent_after = 3;         ///< frames in a row without a box, after boxes that did not leave the view; >= 1
  int believed_after = 90;      ///< frames of silence after which the scene counts as empty, >= silent_after
  int stuck_after = 3;          ///< repetitions of the same boxes and scores to the last bit, >= 1
  int confirmed_after = 10;     ///< frames with a box before its absence counts as silence; false boxes last less; >= 1
  double border_share = 0.03;   ///< of the width: a box so near to the left or right border, and
  double leaving_share = 0.15;  ///< narrower than this share of it, is of somebody who leaves; both in [0, 0.5]
  double max_box_share = 0.9;   ///< of the image: a larger box is absurd, > 0
  double image_width = 0;       ///< px, >= 0; 0: unknown, boxes neither leave nor are too large
  double image_height = 0;      ///< px, >= 0
};

enum class DetectorStatus : std::uint8_t {
  ok,
  idle,    ///< it did not run on this frame
  silent,  ///< no boxes any more though the objects cannot have left the view: treat as not run
  stuck,   ///< it repeats its boxes: treat as not run
  absurd   ///< improper boxes, or boxes as large as the image: leave those out (is_absurd)
};

inline namespace CFP_ISA {

[[nodiscard]] constexpr const char* to_string(DetectorStatus status) noexcept {
  constexpr const char* names[] = {"ok", "idle", "silent", "stuck", "absurd"};
  return status <= DetectorStatus::absurd ? names[static_cast<int>(status)] : "unknown";
}

[[nodiscard]] inline OptionPath invalid_field(const DetectorHealthOptions& o) noexcept {
  if (!(o.silent_after >= 1)) return "silent_after";
  if (!(o.believed_after >= o.silent_after)) return "believed_after";
  if (!(o.stuck_after >= 1)) return "stuck_after";
  if (!(o.confirmed_after >= 1)) return "confirmed_after";
  if (!(o.border_share >= 0 && o.border_share <= 0.5)) return "border_share";
  if (!(o.leaving_share >= 0 && o.leaving_share <= 0.5)) return "leaving_share";
  if (!detail::positive(o.max_box_share)) return "max_box_share";
  if (!detail::non_negative(o.image_width)) return "image_width";
  if (!detail::non_negative(o.image_height)) return "image_height";
  return {};
}

/// Whether the box of a detection is improper or covers most of the image, or its score is NaN.
template <typename Scalar>
[[nodiscard]] bool is_absurd(const Detection<Scalar>& detection, const DetectorHealthOptions& options) noexcept {
  if (!is_proper(detection.box) || !(detection.score == detection.score)) return true;
  const double image = options.image_width * options.image_height;
  if (!(image > 0)) return false;
  const auto inside =
      clip(detection.box, static_cast<Scalar>(options.image_width), static_cast<Scalar>(options.image_height));
  return is_proper(inside) && static_cast<double>(area(inside)) > options.max_box_share * image;
}

/// One per detector. Allocates when a frame has more boxes than any before.
template <typename Scalar>
class DetectorHealth {
 public:
  explicit DetectorHealth(const DetectorHealthOptions& options = {}) : options_(options) {
    CFP_ASSERT(!invalid_field(options));
  }

  /// Once per frame, with what the detector gave; not set: it did not run. The first of absurd, stuck, silent holds.
  DetectorStatus update(const std::optional<span<const Detection<Scalar>>>& detections) {
    if (!detections) return DetectorStatus::idle;
    const bool repeated = repeats(*detections);
    repetitions_ = repeated ? next_count(repetitions_) : 0;
    last_.assign(detections->begin(), detections->end());
    bool absurd = false, seen = false, staying = false;
    for (const Detection<Scalar>& d : *detections) {
      const bool credible = !is_absurd(d, options_);
      absurd = absurd || !credible;
      seen = seen || credible;
      staying = staying || (credible && !leaves(d.box));
    }
    if (seen) {
      // Single misses do not interrupt.
      with_box_ = missing_ < options_.silent_after ? next_count(with_box_) : 1;
      expected_ = staying && with_box_ >= options_.confirmed_after;
      missing_ = 0;
    } else {
      missing_ = next_count(missing_);
    }
    if (absurd) return DetectorStatus::absurd;
    if (repetitions_ >= options_.stuck_after) return DetectorStatus::stuck;
    const bool silent = expected_ && missing_ >= options_.silent_after && missing_ < options_.believed_after;
    return silent ? DetectorStatus::silent : DetectorStatus::ok;
  }

  void reset() noexcept {
    last_.clear();
    repetitions_ = missing_ = with_box_ = 0;
    expected_ = false;
  }

 private:
  [[nodiscard]] bool repeats(span<const Detection<Scalar>> now) const noexcept {
    const auto same = [](const Detection<Scalar>& a, const Detection<Scalar>& b) {
      return a.box.x1 == b.box.x1 && a.box.y1 == b.box.y1 && a.box.x2 == b.box.x2 && a.box.y2 == b.box.y2 &&
             a.score == b.score;
    };
    return !now.empty() && std::equal(now.begin(), now.end(), last_.begin(), last_.end(), same);
  }
  [[nodiscard]] bool leaves(const Box<Scalar>& box) const noexcept {
    const double width = options_.image_width, margin = options_.border_share * width;
    return width > 0 && static_cast<double>(box.width()) < options_.leaving_share * width &&
           (static_cast<double>(box.x1) <= margin || static_cast<double>(box.x2) >= width - margin);
  }

  DetectorHealthOptions options_;
  std::vector<Detection<Scalar>> last_;
  int repetitions_ = 0, missing_ = 0, with_box_ = 0;
  bool expected_ = false;
};

}  // namespace CFP_ISA
}  // namespace cfp
