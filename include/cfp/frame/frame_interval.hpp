/// @file frame_interval.hpp
/// The usual time between frames, and whether frames are missing before one.
#pragma once

#include <algorithm>
#include <limits>

#include "cfp/core/numeric.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// After missing frames the camera may be anywhere, and a motion model finds only chance matches.
class FrameInterval {
 public:
  /// Once per frame, with its time. True: the interval before it is longer than three times the usual one and longer
  /// than 0.2 s (over less, a constant velocity is a good prediction). A time that does not increase is no gap and is
  /// ignored. But if two such times in a row increase, the second is accepted: the time before them was wrong, or the
  /// clock was set. The usual interval is a running mean that moves by a fifth per frame: it adapts within some ten
  /// frames to a change by a few times, so that a recording that becomes slower does not have a gap at every frame. It
  /// starts at the first interval, but at most at 0.2 s: a recording of one frame a second has four gaps, then none.
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
