/// @file order_statistic.hpp
/// Order statistics in linear time: the quantiles at 0.1, 0.2, 0.3 of the object probability (paper section IV-B) and
/// the adaptive threshold of the constraints (section IV-D). Exact: the result is one of the given values.
///
/// The values must not contain NaN: callers filter (a NaN here does not crash, but the result may be any of the
/// values). Infinite and negative values are fine.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// 1-based position of the q-quantile among n ascending values: ceil(q n), at least 1 and at most n; 0 for n = 0. A
/// product that exceeds a whole number by its rounding error alone counts as that number: quantile_rank(0.1, 30) is 3,
/// though 0.1 * 30 = 3.0000000000000004. q <= 0 and NaN give 1, q >= 1 gives n. Pass q as a double: 0.1F is not 0.1.
[[nodiscard]] inline std::size_t quantile_rank(double q, std::size_t n) noexcept {
  if (q >= 1) return n;
  const double size = static_cast<double>(n);
  const double position = std::ceil(q * size * (1.0 - 4 * std::numeric_limits<double>::epsilon()));
  if (!(position > 1)) return (std::min)(n, std::size_t(1));
  return position < size ? static_cast<std::size_t>(position) : n;
}

/// The value at 0-based position rank0 of the ascending order (0: the smallest). Reorders `values`. 0 without values; a
/// rank beyond the end counts as the last. Linear time on average, allocates nothing.
template <typename Scalar>
[[nodiscard]] Scalar order_statistic(span<Scalar> values, std::size_t rank0) noexcept {
  if (values.empty()) return Scalar(0);
  rank0 = (std::min)(rank0, values.size() - 1);
  // A comparison of its own, and so an nth_element that units with other vector flags do not share.
  const auto below = [](Scalar a, Scalar b) { return a < b; };
  std::nth_element(values.begin(), values.begin() + rank0, values.end(), below);
  return values[rank0];
}

/// The q-quantile, at quantile_rank. Reorders `values`; 0 without any.
template <typename Scalar>
[[nodiscard]] Scalar quantile(span<Scalar> values, double q) noexcept {
  return order_statistic(values, quantile_rank(q, values.size()) - 1);
}

}  // namespace CFP_ISA
}  // namespace cfp
