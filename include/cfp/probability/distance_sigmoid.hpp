/// @file distance_sigmoid.hpp
/// Static probability of a matched keypoint from a geometric distance: of its projection from the previous frame (d^T)
/// or from its epipolar line (d^F); the same adaptive sigmoid serves both (paper section IV-D). Distances are in
/// pixels, a negative one means "no distance"; probabilities are P(static) in [0, 1].
#pragma once

#include <algorithm>

#include "cfp/core/options.hpp"
#include "cfp/core/span.hpp"
#include "cfp/core/status.hpp"
#include "cfp/geometry/distance.hpp"
#include "cfp/math/logistic.hpp"
#include "cfp/math/order_statistic.hpp"

namespace cfp {

struct ConstraintOptions {
  double quantile = 0.8;  ///< position of D_Th among the ascending distances outside the boxes, in (0, 1]
  double steepness = 5;   ///< numerator of the sigmoid's slope, > 0: K is 0.5 at D_Th and logistic(5) = 0.9933 at d_min
  /// with fewer distances outside the boxes than this the constraint is not fitted, >= 1
  std::size_t min_samples = 10;
};

/// The sigmoid of one frame, fitted to the keypoints outside all boxes of potentially moving objects.
template <typename Scalar>
struct ConstraintModel {
  Scalar threshold_px = Scalar(0);            ///< D_Th
  Scalar minimum_px = Scalar(0);              ///< d_min
  Scalar slope_per_px = Scalar(0);            ///< steepness / (D_Th - d_min); 0 when degenerate
  Scalar calculation_confidence = Scalar(0);  ///< C_c, see calculation_confidence()
  std::size_t samples = 0;                    ///< usable distances: finite and not negative
  Status status = Status::not_enough_data;    ///< degenerate: D_Th = d_min (or nearly), the sigmoid is a step
};

inline namespace CFP_ISA {

[[nodiscard]] inline OptionPath invalid_field(const ConstraintOptions& o) noexcept {
  if (!(o.quantile > 0 && o.quantile <= 1)) return "quantile";
  if (!detail::positive(o.steepness)) return "steepness";
  if (o.min_samples < 1) return "min_samples";
  return {};
}

/// C_c = 1 - sum(d) / (n D_Th) over the n distances with 0 <= d < D_Th (paper eq. C_C). In [0, 1]; no such distance: 0.
/// Compares with D_Th by that sum alone, so distances above the threshold (moving or mismatched) do not lower it.
template <typename Range, typename Scalar = range_value_t<Range>>
[[nodiscard]] Scalar calculation_confidence(const Range& distances_px, non_deduced<Scalar> threshold_px) noexcept {
  double sum = 0;
  std::size_t n = 0;
  for (const Scalar d : span<const Scalar>(distances_px)) {
    const bool below = d >= Scalar(0) && d < threshold_px;
    sum += below ? static_cast<double>(d) : 0.0;
    n += below ? 1U : 0U;
  }
  if (n == 0 || !is_finite(threshold_px)) return Scalar(0);
  return Scalar(clamp_probability(1.0 - sum / static_cast<double>(n) / static_cast<double>(threshold_px)));
}

/// C_s = 1 / (1 + exp(-N_BA + 0.5 Th_BA)) (paper eq. C_S): N_BA inliers of the last pose solution, Th_BA the least
/// number that a pose solution may rest on. In [0, 1], non-decreasing in N_BA, overflow-free; a step about ten inliers
/// wide around Th_BA / 2.
template <typename Scalar>
[[nodiscard]] Scalar statistical_confidence(std::size_t inliers, Scalar min_inliers) noexcept {
  return logistic(Scalar(inliers) - Scalar(0.5) * min_inliers);
}

/// Fits the sigmoid to the distances of the matched keypoints outside the boxes: D_Th is the ascending order statistic
/// at the 1-based position ceil(quantile n), d_min the smallest. Negative and non-finite distances are left out.
/// `workspace` needs room for all distances and is overwritten. Status: not_enough_data below min_samples (the model
/// then gives no probability), degenerate when D_Th - d_min is below rounding. O(n), allocates nothing.
template <typename Range, typename Scalar = range_value_t<Range>>
[[nodiscard]] ConstraintModel<Scalar> fit_constraint(const Range& outside_distances_px,
                                                     const ConstraintOptions& options,
                                                     span<non_deduced<Scalar>> workspace) noexcept {
  ConstraintModel<Scalar> model;
  const std::size_t n = copy_distances(span<const Scalar>(outside_distances_px), workspace);
  model.samples = n;
  if (n < (std::max)(options.min_samples, std::size_t(1))) return model;
  const span<Scalar> samples = workspace.subspan(0, n);
  const std::size_t rank = quantile_rank(options.quantile, n);
  model.threshold_px = order_statistic(samples, rank - 1);
  const span<Scalar> nearest = samples.subspan(0, rank);  // all that are below D_Th
  model.minimum_px = *std::min_element(nearest.begin(), nearest.end());
  model.calculation_confidence = calculation_confidence(nearest, model.threshold_px);
  const Scalar spread = model.threshold_px - model.minimum_px;
  const Scalar slope = Scalar(options.steepness) / spread;
  const bool steep = !(spread > Scalar(Tolerance<Scalar>::degenerate) * model.threshold_px) || !is_finite(slope);
  model.slope_per_px = steep ? Scalar(0) : slope;
  model.status = steep ? Status::degenerate : Status::ok;
  return model;
}

/// K = 1 / (1 + exp((d - D_Th) * 5 / (D_Th - d_min))) (paper eq. K^T). In [0, 1], non-increasing in d, 0.5 at D_Th;
/// never overflows. Degenerate model: the step 1, 0.5, 0 below, at, above D_Th. A negative or NaN distance, or a model
/// without enough data, gives 0; ask the model's status first.
template <typename Scalar>
[[nodiscard]] Scalar static_probability(const ConstraintModel<Scalar>& model,
                                        non_deduced<Scalar> distance_px) noexcept {
  if (model.status == Status::not_enough_data || !(distance_px >= Scalar(0))) return Scalar(0);
  if (model.status == Status::degenerate) {
    if (distance_px < model.threshold_px) return Scalar(1);
    return distance_px > model.threshold_px ? Scalar(0) : Scalar(0.5);
  }
  return logistic((model.threshold_px - distance_px) * model.slope_per_px);
}

}  // namespace CFP_ISA
}  // namespace cfp
