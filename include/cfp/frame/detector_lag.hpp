/// @file detector_lag.hpp
/// Whether the boxes of a detector lag behind the images: results of an older image than the host believes. The boxes
/// alone do not reveal it, since they move as the objects do. The flow does: moving pairs lie ahead of boxes that lag,
/// and static pairs where the object has been. Not in the paper.
#pragma once

#include <algorithm>
#include <array>

#include "cfp/core/numeric.hpp"
#include "cfp/core/options.hpp"
#include "cfp/frame/frame_state.hpp"

namespace cfp {

/// Defaults: examples/slam/RESULTS.md, "A detector that is late".
struct DetectorLagOptions {
  double max_lag_s = 0.6;  ///< the longest lag that is searched for, > 0
  double memory_s = 3;     ///< time constant with which frames are forgotten, s, > 0
  double min_boxes = 30;   ///< moving boxes (decayed count); with fewer the lag is unknown, > 0
  double min_rate = 0.3;   ///< least speed of a moving box in the image, in widths per second, >= 0
  double min_gain = 0.05;  ///< least gain of the mean score, in [-1, 1], over that of lag 0, >= 0
  double image_width = 0;  ///< px, >= 0; 0: unknown. Boxes cut by the left or right border are not used
};

inline namespace CFP_ISA {

[[nodiscard]] inline OptionPath invalid_field(const DetectorLagOptions& o) noexcept {
  if (!detail::positive(o.max_lag_s)) return "max_lag_s";
  if (!detail::positive(o.memory_s)) return "memory_s";
  if (!detail::positive(o.min_boxes)) return "min_boxes";
  if (!detail::non_negative(o.min_rate)) return "min_rate";
  if (!detail::non_negative(o.min_gain)) return "min_gain";
  if (!detail::non_negative(o.image_width)) return "image_width";
  return {};
}

/// One per detector; allocates nothing.
template <typename Scalar>
class DetectorLag {
 public:
  explicit DetectorLag(const DetectorLagOptions& options = {}) : options_(options) {
    CFP_ASSERT(!invalid_field(options));
  }

  /// Once per frame, after its coarse stage; the lag in seconds, 0: none, or not known. Resolution: a ninth of
  /// max_lag_s. The result may be one step too short, as a box is wider than what moves in it, and a lag of one step is
  /// hardly ever detected. Detected boxes that move are shifted to where they should be after each of ten lags; a pair
  /// in them scores 1 if it moves (distance above 6 sigma) and -1 if it rests (below 3). The result is the lag of the
  /// best mean score, if most pairs there move. Frames whose flow has no depths, no camera motion or no measured noise
  /// are ignored. O(boxes that move x pairs).
  double update(const Frame<Scalar>& frame, const FrameState<Scalar>& state) noexcept {
    const double dt = detail::elapsed_s(state);
    const double kept = is_finite(dt) ? kept_share(dt, options_.memory_s) : 1;
    boxes_ *= kept;
    for (double& sum : scores_) sum *= kept;
    const bool judged = state.report.flow_model == FlowModelKind::motion && state.report.flow_sigma_px > 0 &&
                        state.flow_distances.size() == state.flow_depths.size();
    for (std::size_t b = 0; judged && b < state.boxes.size(); ++b) {
      const TrackedBox<Scalar>& box = state.boxes[b];
      const Vector2<Scalar> rate = image_rate(box, state, static_cast<Scalar>(dt));
      const bool moves = rate.norm() > static_cast<Scalar>(options_.min_rate) * box.box.width();
      if (box.compensated() || box.age < settled_age || !moves || is_cut(box.box)) continue;
      for (std::size_t i = 0; i < lags; ++i)
        scores_[i] += score(box.box, rate * static_cast<Scalar>(lag_s(i)), frame, state);
      boxes_ += 1;
    }
    const auto best = static_cast<std::size_t>(std::max_element(scores_.begin(), scores_.end()) - scores_.begin());
    const double highest = scores_[best];
    const bool clear = highest > 0 && boxes_ >= options_.min_boxes && highest - scores_[0] > options_.min_gain * boxes_;
    return clear ? lag_s(best) : 0;
  }

  void reset() noexcept {
    scores_ = {};
    boxes_ = 0;
  }

 private:
  static constexpr std::size_t lags = 10, min_pairs = 5;
  static constexpr int settled_age = 5;  // frames, until the rate of a box is known

  [[nodiscard]] double lag_s(std::size_t i) const noexcept {
    return options_.max_lag_s * static_cast<double>(i) / static_cast<double>(lags - 1);
  }

  // Of the box's centre, px/s: its own and the image's.
  [[nodiscard]] static Vector2<Scalar> image_rate(const TrackedBox<Scalar>& box, const FrameState<Scalar>& state,
                                                  Scalar dt_s) noexcept {
    Vector2<Scalar> own(box.rate_x, box.rate_y);
    if (!state.image_motion || !(dt_s > Scalar(0))) return own;
    const Vector2<Scalar> centre(Scalar(0.5) * (box.box.x1 + box.box.x2), Scalar(0.5) * (box.box.y1 + box.box.y2));
    const Vector3<Scalar> moved = *state.image_motion * Vector3<Scalar>(centre.x(), centre.y(), Scalar(1));
    return own + (moved.template head<2>() / moved.z() - centre) / dt_s;
  }

  [[nodiscard]] bool is_cut(const Box<Scalar>& box) const noexcept {
    const double width = options_.image_width, margin = 0.01 * width;
    return width > 0 && (static_cast<double>(box.x1) <= margin || static_cast<double>(box.x2) >= width - margin);
  }

  // Mean score of the pairs in the box moved by so much; -1 where there are too few.
  [[nodiscard]] static double score(const Box<Scalar>& box, const Vector2<Scalar>& by, const Frame<Scalar>& frame,
                                    const FrameState<Scalar>& state) noexcept {
    const Scalar sigma = static_cast<Scalar>(state.report.flow_sigma_px);
    std::size_t pairs = 0;
    int sum = 0;
    for (std::size_t i = 0; i < state.flow_distances.size(); ++i) {
      const Scalar distance = state.flow_distances[i];
      if (!contains(box, frame.flow.current(i, 0) - by.x(), frame.flow.current(i, 1) - by.y()) ||
          !has_distance(distance) || !is_valid_depth(state.flow_depths[i]))
        continue;
      ++pairs;
      sum += distance > Scalar(6) * sigma ? 1 : distance < Scalar(3) * sigma ? -1 : 0;
    }
    return pairs < min_pairs ? -1 : sum / static_cast<double>(pairs);
  }

  DetectorLagOptions options_;
  std::array<double, lags> scores_{};
  double boxes_ = 0;
};

}  // namespace CFP_ISA
}  // namespace cfp
