/// @file shared_error_impl.hpp
/// What neighbouring flow pairs err by together, for flow_model.hpp. Not an interface.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"
#include "cfp/frame/camera_motion.hpp"
#include "cfp/geometry/motion_residual_impl.hpp"
#include "cfp/math/order_statistic.hpp"

namespace cfp::detail {

/// Rolling shutter, a lens or a focal length that is not quite as told, depth that is late or beside its image: no
/// noise, for the mean of many neighbours has all of it.
struct SharedError {
  double error_px = 0;         // standard deviation of one coordinate, beside the pairs' noise
  double variance_factor = 1;  // of what is fitted to all pairs: so many times that of pairs which err alone
};

inline namespace CFP_ISA {

/// The pairs in one part of the image: the sum of their residuals in units of the noise, and what it says.
struct ResidualPart {
  Vector2<double> sum = Vector2<double>::Zero();
  double weights = 0, variance = 0;  // of both coordinates of the sum, if the pairs err alone
  double agreeing = 0;               // pairs, by the weights of the loss: a part that moves has hardly any

  template <typename Scalar>
  void add(const MotionResidual<Scalar>& pair, double sigma_px) noexcept {
    constexpr double loss_sq = 64;  // 8 sigma: what neighbours share may be several
    const Vector2<double> r = pair.r.template cast<double>() / sigma_px;
    const double of_depth = static_cast<double>(pair.sigma_z) / sigma_px,
                 v = 2 + of_depth * of_depth * static_cast<double>(pair.along.squaredNorm()),
                 root = 1 / (1 + r.squaredNorm() / (v * loss_sq)), w = root * root / v;
    if (!is_finite(r.squaredNorm()) || !is_finite(v)) return;
    sum += w * r;
    weights += w;
    variance += w * w * v;
    agreeing += root * root;
  }
  /// How many pairs of two coordinates without errors of depth would say as much.
  [[nodiscard]] double pairs() const noexcept { return variance > 0 ? 2 * weights * weights / variance : 0; }
};

/// The error that the pairs with a point share under the motion that was fitted to them. In each of 4 x 3 parts of what
/// they cover the mean of n residuals has the variance sigma^2 / n + e^2 per coordinate; e is had from the upper
/// quartile of the parts, as what errs may be a part of the image, and what moves there may be another. So many
/// parameters were fitted to the two coordinates of all n parts: e^2 is n / (n - parameters / 2) times what is left of
/// it, and n times at most. Fewer than four parts with five pairs that agree tell nothing.
template <typename Scalar>
[[nodiscard]] SharedError shared_error(const PairsWithDepth<Scalar>& pairs, const CameraMotion<Scalar>& motion,
                                       int parameters) noexcept {
  constexpr std::size_t columns = 4, rows = 3, fewest_parts = 4;
  constexpr double fewest_pairs = 5, upper_quartile = 1.386;  // of half a chi-squared with two degrees of freedom
  const Scalar huge = std::numeric_limits<Scalar>::infinity();
  Vector2<Scalar> low(huge, huge), high = -low;
  for (std::size_t i = 0; i < pairs.flow.previous.size(); ++i) {
    const Vector2<Scalar> at = pairs.flow.previous[i];
    if (pairs.tells(i)) low = low.cwiseMin(at), high = high.cwiseMax(at);
  }
  const auto cell = [](Scalar at, Scalar size, std::size_t cells) {
    const Scalar share = at / size * static_cast<Scalar>(cells);
    return share >= Scalar(1) ? (std::min)(static_cast<std::size_t>(share), cells - 1) : 0;
  };
  std::array<ResidualPart, columns * rows> parts;
  MotionResidual<Scalar> pair;
  for (std::size_t i = 0; i < pairs.flow.previous.size(); ++i) {
    if (!pairs.tells(i) || !pairs.residual_of(i, motion.T_cur_prev, pair)) continue;
    const Vector2<Scalar> at = pairs.flow.previous[i] - low, size = high - low;
    parts[cell(at[1], size[1], rows) * columns + cell(at[0], size[0], columns)].add(
        pair, static_cast<double>(motion.sigma_px * pairs.flow.relative_sigma(i)));
  }

  std::array<double, columns * rows> error_sq;  // in squares of the noise
  std::size_t n = 0;
  double told_by = 0;
  for (const ResidualPart& part : parts) {
    if (part.agreeing < fewest_pairs) continue;
    error_sq[n++] = (part.sum.squaredNorm() / (part.variance * upper_quartile) - 1) / part.pairs();
    told_by += part.pairs();
  }
  if (n < fewest_parts) return {};
  const double told = static_cast<double>(n), free = (std::max)(told - 0.5 * parameters, 1.0);
  const double e_sq = (std::max)(quantile(span<double>(error_sq.data(), n), 0.75), 0.0) * told / free;
  return {static_cast<double>(motion.sigma_px) * std::sqrt(e_sq), 1 + e_sq * told_by / told};
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
