/// @file health.hpp
/// Whether the weights of a frame can support a pose, and a fallback if they cannot: the probabilities must not make a
/// static scene worse.
#pragma once

#include "cfp/core/options.hpp"
#include "cfp/core/span.hpp"
#include "cfp/frame/frame.hpp"

namespace cfp {

struct HealthOptions {
  /// least effective observations for a pose; with fewer the fallback acts (ORB-SLAM2's 10), >= 0; 0: no fallback
  double min_effective_points = 10;
  /// observations of at most this weight do not support a pose, however many: they do not count as inliers, in [0, 1)
  double min_inlier_weight = 0.1;
};

enum class WeightFallback : std::uint8_t {
  none,        ///< the weights are the model's
  background,  ///< background keypoints inside boxes count as static
  all          ///< even so too few: every valid keypoint counts as static, as without this library
};

struct FrameHealth {
  std::size_t observations = 0;  ///< keypoints with a map point
  double weight = 0;             ///< sum of their weights
  double effective_points = 0;   ///< (sum w)^2 / sum w^2 over those that support a pose: the number of equal weights
  double box_share = 0;          ///< share of the weight that lies inside boxes, in [0, 1]
  WeightFallback fallback = WeightFallback::none;
};

inline namespace CFP_ISA {

[[nodiscard]] inline OptionPath invalid_field(const HealthOptions& o) noexcept {
  if (!detail::non_negative(o.min_effective_points)) return "min_effective_points";
  if (!(o.min_inlier_weight >= 0 && o.min_inlier_weight < 1)) return "min_inlier_weight";
  return {};
}

/// Whether an observation of this weight supports a pose.
[[nodiscard]] constexpr bool carries_pose(double weight, const HealthOptions& options) noexcept {
  return weight > options.min_inlier_weight;
}

/// The figures of one frame. Observations are the keypoints with M >= 0 (a map point); weights outside [0, 1] are
/// clamped.
template <typename Scalar>
[[nodiscard]] FrameHealth frame_health(span<const KeypointLabel> label, span<const Scalar> map_point_probability,
                                       span<const Scalar> weight, const HealthOptions& options) noexcept {
  CFP_ASSERT(label.size() == weight.size() && map_point_probability.size() == weight.size());
  FrameHealth health;
  double carried = 0, squares = 0, in_boxes = 0;
  for (std::size_t i = 0; i < weight.size(); ++i) {
    if (!(map_point_probability[i] >= Scalar(0))) continue;
    const double w = static_cast<double>(clamp_probability(weight[i]));
    ++health.observations;
    health.weight += w;
    if (carries_pose(w, options)) carried += w, squares += w * w;
    in_boxes += label[i] == KeypointLabel::outside ? 0.0 : w;
  }
  if (squares > 0) health.effective_points = carried * carried / squares;  // their squares may underflow
  if (health.weight > 0) health.box_share = clamp_probability(in_boxes / health.weight);
  return health;
}

/// Whether a fallback raises the weight of a keypoint with this label to 1.
[[nodiscard]] constexpr bool is_raised(KeypointLabel label, WeightFallback fallback) noexcept {
  return fallback == WeightFallback::all ? label != KeypointLabel::invalid
                                         : fallback == WeightFallback::background && label == KeypointLabel::background;
}

/// frame_health, and the fallback: while the effective observations are fewer than min_effective_points, the weights of
/// the background keypoints are raised to 1, then those of all keypoints with a map point; without any there is nothing
/// to raise, and no fallback. The figures are those of the model's own weights; `fallback` says what was done.
/// Allocates nothing.
template <typename Scalar>
FrameHealth apply_fallback(span<const KeypointLabel> label, span<const Scalar> map_point_probability,
                           span<Scalar> weight, const HealthOptions& options) noexcept {
  FrameHealth health = frame_health(label, map_point_probability, span<const Scalar>(weight), options);
  double effective_points = health.effective_points;
  for (const WeightFallback fallback : {WeightFallback::background, WeightFallback::all}) {
    if (health.observations == 0 || effective_points >= options.min_effective_points) break;
    health.fallback = fallback;
    for (std::size_t i = 0; i < weight.size(); ++i) {
      if (map_point_probability[i] >= Scalar(0) && is_raised(label[i], fallback)) weight[i] = Scalar(1);
    }
    effective_points = frame_health(label, map_point_probability, span<const Scalar>(weight), options).effective_points;
  }
  return health;
}

}  // namespace CFP_ISA
}  // namespace cfp
