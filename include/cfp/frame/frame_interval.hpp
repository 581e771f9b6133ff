/// @file frame_interval.hpp
/// The usual time between frames, and whether frames are missing before one.
#pragma once

#include <algorithm>
#include <limits>

#include "cfp/core/numeric.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// Where frames are missing the camera may be anywhere, and a motion model finds nothing but chance matches.
class FrameInterval {
 public:
  /// Once per frame, with its time. True: there is a gap before it, longer than thrice the usual interval, and than
  /// 0.2 s: over less, a velocity may be believed. A time that does not grow is no gap, and is not learnt, but for
  /// the second of two in a row that grow: the one before them was wrong, or the clock was set. The usual interval
  /// follows, by a fifth a frame: within some ten frames of a change by a few times, so that a recording that
  /// becomes slower has no gap after each of its frames. It begins at the first interval, or at 0.2 s if that is
  /// longer: a recording of one frame a second has four gaps, then none.
  bool is_gap(double time_s) noexcept {
    const double dt = time_s - last_s_;
    const bool known = is_finite(last_s_);
    if (!is_finite(time_s)) return false;
    if (known && !(dt > 0)) {
      if (time_s > refused_s_) last_s_ = time_s;
      refused_s_ = time_s;
      return false;
    }
    last_s_ = time_s;
    refused_s_ = std::numeric_limits<double>::infinity();
    if (!known) return false;
    const bool second = !(usual_s_ > 0);
    if (second) usual_s_ = (std::min)(dt, shortest_s);
    const bool gap = dt > factor * usual_s_ && dt > shortest_s;
    if (!second) usual_s_ += 0.2 * ((std::min)(dt, 2 * usual_s_) - usual_s_);
    return gap;
  }

 private:
  static constexpr double factor = 3, shortest_s = 0.2;
  double last_s_ = std::numeric_limits<double>::quiet_NaN(), usual_s_ = 0;
  double refused_s_ = std::numeric_limits<double>::infinity();
};

}  // namespace CFP_ISA
}  // namespace cfp
