/// @file shared_error_impl.hpp
/// The error that neighbouring flow pairs share (correlated error), for flow_model.hpp. Not an interface.
#pragma once

#include <algorithm>
#include <array>
#include <limits>

#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"
#include "cfp/frame/camera_motion.hpp"
#include "cfp/frame/point_grid_impl.hpp"
#include "cfp/geometry/epipolar.hpp"
#include "cfp/geometry/motion_residual_impl.hpp"
#include "cfp/math/order_statistic.hpp"

namespace cfp::detail {

/// Caused by rolling shutter, wrong distortion or focal length, depth that is late or misaligned. It is no noise: it
/// does not average out over neighbours.
struct SharedError {
  bool known = false;
  double error_sq = 0;  // variance of one coordinate, besides the pairs' noise, px^2; may be below 0 by chance
  double pairs = 0;     // that share it, in the mean of the parts
};

inline namespace CFP_ISA {

/// W^-1 r of a pair, with W the covariance of its noise (the unit) and of its depth: its measurement of the shared
/// error, and the share, 0 to 1, that remains of the coordinate along which the depth moves it.
struct SharedResidual {
  Vector2<double> told = Vector2<double>::Zero();
  double distance_sq = 0;  // r^T W^-1 r
  double along = 0;
};

/// The pairs in one part of the image: the sum of their residuals, and its information.
struct ResidualPart {
  Vector2<double> sum = Vector2<double>::Zero();
  double across = 0, along = 0;  // so many times an error that all share: in the sum, by coordinate
  double variance = 0;           // of both coordinates of the sum, if the pairs' errors are independent
  double agreeing = 0;           // pairs, by the weights of the loss: a part that moves has hardly any

  void add(const SharedResidual& pair) noexcept {
    constexpr double loss_sq = 128;  // 8 sigma per coordinate: the shared error may be several
    if (!is_finite(pair.distance_sq) || !is_finite(pair.along)) return;
    const double root = 1 / (1 + pair.distance_sq / loss_sq), w = root * root;
    sum += w * pair.told;
    across += w;
    along += w * pair.along;
    variance += w * w * (1 + pair.along);
    agreeing += w;
  }
  /// The number of pairs with two coordinates and exact depths that would carry the same information.
  [[nodiscard]] double pairs() const noexcept {
    return variance > 0 ? (across * across + along * along) / variance : 0;
  }
};

/// The error that pairs share under what was fitted to them: `tells(i)`, whether pair i was, `residual(i, out)`, its
/// residual, false without one. In each of 4 x 3 parts of what most of them cover the mean of n residuals has the
/// variance sigma^2 / n + e^2 per coordinate. e is estimated from the upper quartile of the parts, since the error may
/// be in some parts only, and something may move in others. `parameters` were fitted to n parts of two coordinates each
/// (one for unknown depths): to correct for it, e^2 is multiplied by n / (n - parameters / coordinates), at most by n.
/// Unknown with fewer than six parts that have five inliers: from fewer, e^2 is chance times that factor, which makes
/// the motion so uncertain that somebody getting up looks static for some frames.
template <typename Scalar, typename Tells, typename Residual>
[[nodiscard]] SharedError shared_error(const FlowPairs<Scalar>& flow, Scalar sigma_px, int parameters, Tells&& tells,
                                       Residual&& residual) noexcept {
  constexpr std::size_t columns = 4, rows = 3, fewest_parts = 6;
  constexpr double fewest_pairs = 5, upper_quartile = 1.386;  // of half a chi-squared with two degrees of freedom
  const auto extent = [&](int axis) {
    return extent_of_most<Scalar>(flow.previous.size(), [&](std::size_t i) {
      return tells(i) ? flow.previous(i, axis) : std::numeric_limits<Scalar>::quiet_NaN();
    });
  };
  const std::array<Scalar, 2> x = extent(0), y = extent(1);
  const auto cell = [](Scalar at, const std::array<Scalar, 2>& over, std::size_t cells) {
    const Scalar share = (at - over[0]) / (over[1] - over[0]) * static_cast<Scalar>(cells);
    return share >= Scalar(1) ? static_cast<std::size_t>((std::min)(share, static_cast<Scalar>(cells - 1))) : 0;
  };
  std::array<ResidualPart, columns * rows> parts;
  SharedResidual pair;
  for (std::size_t i = 0; i < flow.previous.size(); ++i) {
    if (!tells(i) || !residual(i, pair)) continue;
    parts[cell(flow.previous(i, 1), y, rows) * columns + cell(flow.previous(i, 0), x, columns)].add(pair);
  }

  std::array<double, columns * rows> error_sq;  // in squares of the noise
  std::size_t n = 0;
  double told_by = 0, across = 0, along = 0;
  for (const ResidualPart& part : parts) {
    if (part.agreeing < fewest_pairs) continue;
    error_sq[n++] = (part.sum.squaredNorm() / (part.variance * upper_quartile) - 1) / part.pairs();
    told_by += part.pairs(), across += part.across, along += part.along;
  }
  const double told = static_cast<double>(n), free = (std::max)(told - parameters * across / (across + along), 1.0);
  SharedError shared;
  if (n > 0) shared.pairs = told_by / told;
  shared.known = n >= fewest_parts;
  if (!shared.known) return shared;
  const auto sigma_sq = static_cast<double>(sigma_px) * static_cast<double>(sigma_px);
  shared.error_sq = sigma_sq * quantile(span<double>(error_sq.data(), n), 0.75) * told / free;
  return shared;
}

/// Of the pairs with a point, under the motion that was fitted to them.
template <typename Scalar>
[[nodiscard]] SharedError shared_error(const PairsWithDepth<Scalar>& pairs, const CameraMotion<Scalar>& motion,
                                       int parameters) noexcept {
  const auto residual = [&](std::size_t i, SharedResidual& out) {
    MotionResidual<Scalar> pair;
    if (!pairs.residual_of(i, motion.T_cur_prev, pair)) return false;
    const auto sigma = static_cast<double>(motion.sigma_px * pairs.flow.relative_sigma(i));
    const Vector2<double> r = pair.r.template cast<double>() / sigma,
                          j = (pair.along * pair.sigma_z).template cast<double>() / sigma;
    out.along = 1 / (1 + j.squaredNorm());
    out.told = r - j * (j.dot(r) * out.along);
    out.distance_sq = r.dot(out.told);
    return true;
  };
  return shared_error(
      pairs.flow, motion.sigma_px, parameters, [&](std::size_t i) { return pairs.tells(i); }, residual);
}

/// Of the pairs marked in `outside`, under the F that was fitted to them: it has seven parameters.
template <typename Scalar>
[[nodiscard]] SharedError shared_error(const FlowPairs<Scalar>& flow, span<const char> outside,
                                       const Matrix3<Scalar>& F, Scalar sigma_px) noexcept {
  const auto residual = [&](std::size_t i, SharedResidual& out) {
    const Vector2<Scalar> current = flow.current[i];
    const Vector3<double> line = epipolar_line(F, flow.previous[i]).template cast<double>();
    const double x = static_cast<double>(current[0]), y = static_cast<double>(current[1]),
                 normal_sq = line[0] * line[0] + line[1] * line[1],
                 sigma = static_cast<double>(sigma_px * flow.relative_sigma(i));
    out.told = line.head<2>() * ((line[0] * x + line[1] * y + line[2]) / (normal_sq * sigma));
    out.distance_sq = out.told.squaredNorm();
    return true;
  };
  return shared_error(
      flow, sigma_px, 7, [&](std::size_t i) { return outside[i] != 0; }, residual);
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
