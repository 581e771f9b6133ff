/// @file distance_sigmoid.hpp
/// Static probability of a matched keypoint from a geometric distance: of its projection from the previous frame (d^T)
/// or from its epipolar line (d^F); the same adaptive sigmoid serves both (paper section IV-D). Distances are in
/// pixels, a negative one means "no distance"; probabilities are P(static) in [0, 1].
#pragma once

#include <algorithm>
#include <cstddef>

#include <Eigen/Core>

#include "cfp/core/numeric.hpp"
#include "cfp/core/options.hpp"
#include "cfp/core/span.hpp"
#include "cfp/core/status.hpp"
#include "cfp/geometry/distance.hpp"
#include "cfp/math/logistic.hpp"
#include "cfp/math/order_statistic.hpp"
#include "cfp/simd/chunk.hpp"

namespace cfp {

struct ConstraintOptions {
  double quantile = 0.8;  ///< position of D_Th among the ascending distances outside the boxes, in (0, 1]
  double steepness = 5;   ///< numerator of the sigmoid's slope, > 0: K is 0.5 at D_Th and logistic(5) = 0.9933 at d_min
  std::size_t min_samples =
      10;  ///< fewer distances outside the boxes than this, and the constraint has nothing to say, >= 1
};

[[nodiscard]] inline OptionPath invalid_field(const ConstraintOptions& o) noexcept {
  if (!(o.quantile > 0 && o.quantile <= 1)) return "quantile";
  if (!detail::positive(o.steepness)) return "steepness";
  if (o.min_samples < 1) return "min_samples";
  return {};
}

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

/// C_c = 1 - sum(d) / (n D_Th) over the n distances with 0 <= d < D_Th (paper eq. C_C). In [0, 1]; no such distance: 0.
/// Compares with D_Th by that sum alone, so distances above the threshold (moving or mismatched) do not lower it.
template <typename Scalar>
[[nodiscard]] Scalar calculation_confidence(span<const Scalar> distances_px, Scalar threshold_px) noexcept {
  using Chunk = detail::Chunk<Scalar>;
  double sum = 0;
  std::size_t n = 0;
  detail::for_each_chunk(distances_px.size(), [&](std::size_t first, std::size_t count) {
    using P = Packet<Scalar>;
    Chunk d, below, one;
    detail::load_chunk(distances_px, first, count, d);
    for (std::size_t i = count; i < detail::chunk_size; ++i) d.data()[i] = Scalar(-1);
    const P zero(Scalar(0)), threshold(threshold_px);
    detail::map_chunk(
        below, [&](const P& v) { return select(both(v >= zero, v < threshold), v, zero); }, d);
    detail::map_chunk(
        one, [&](const P& v) { return select(both(v >= zero, v < threshold), P(Scalar(1)), zero); }, d);
    sum += static_cast<double>(below.sum());
    n += static_cast<std::size_t>(one.sum());
  });
  if (n == 0 || !is_finite(threshold_px)) return Scalar(0);
  return Scalar(clamp_probability(1.0 - sum / static_cast<double>(n) / static_cast<double>(threshold_px)));
}

/// Fits the sigmoid to the distances of the matched keypoints outside the boxes: D_Th is the ascending order statistic
/// at the 1-based position ceil(quantile n), d_min the smallest. Negative and non-finite distances are left out.
/// `scratch` needs room for all distances and is overwritten. Status: not_enough_data below min_samples (the model then
/// gives no probability), degenerate when D_Th - d_min is below rounding. O(n), allocates nothing.
template <typename Scalar>
[[nodiscard]] ConstraintModel<Scalar> fit_constraint(span<const Scalar> outside_distances_px, span<Scalar> scratch,
                                                     const ConstraintOptions& options) noexcept {
  CFP_ASSERT(scratch.size() >= outside_distances_px.size());
  ConstraintModel<Scalar> model;
  const std::size_t n = copy_distances(outside_distances_px, scratch);
  model.samples = n;
  if (n < (std::max)(options.min_samples, std::size_t(1))) return model;
  const span<Scalar> samples = scratch.subspan(0, n);
  const detail::ValueRange<Scalar> range = detail::value_range(samples.data(), n);
  model.minimum_px = range.smallest;
  model.threshold_px = detail::select_one(samples.data(), n, quantile_rank(options.quantile, n) - 1, range);
  model.calculation_confidence = calculation_confidence(outside_distances_px, model.threshold_px);
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
[[nodiscard]] Scalar static_probability(const ConstraintModel<Scalar>& model, Scalar distance_px) noexcept {
  if (model.status == Status::not_enough_data || !(distance_px >= Scalar(0))) return Scalar(0);
  if (model.status == Status::degenerate) {
    if (distance_px < model.threshold_px) return Scalar(1);
    return distance_px > model.threshold_px ? Scalar(0) : Scalar(0.5);
  }
  return logistic((model.threshold_px - distance_px) * model.slope_per_px);
}

/// static_probability of every distance: the same rule, without a branch per keypoint. `out` may be the same memory.
template <typename Scalar>
void static_probabilities(const ConstraintModel<Scalar>& model, span<const Scalar> distances_px,
                          span<Scalar> out) noexcept {
  CFP_ASSERT(out.size() == distances_px.size());
  const std::size_t n = distances_px.size();
  if (model.status != Status::ok) {
    for (std::size_t i = 0; i < n; ++i) out[i] = static_probability(model, distances_px[i]);
    return;
  }
  using Chunk = detail::Chunk<Scalar>;
  detail::for_each_chunk(n, [&](std::size_t first, std::size_t count) {
    using P = Packet<Scalar>;
    Chunk d, k;
    detail::load_chunk(distances_px, first, count, d);
    detail::map_chunk(
        k, [&](const P& v) { return (P(model.threshold_px) - v) * P(model.slope_per_px); }, d);
    k = detail::logistic_of_chunk(k);
    detail::map_chunk(
        k, [](const P& v, const P& p) { return select(v >= P(Scalar(0)), p, P(Scalar(0))); }, d, k);
    detail::store_chunk(k, first, count, out);
  });
}

}  // namespace cfp
