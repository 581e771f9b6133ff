/// @file order_statistic.hpp
/// Order statistics in linear time: the quantiles at 0.1, 0.2, 0.3 of the object probability (paper section IV-B) and
/// the adaptive threshold of the constraints (section IV-D). Exact: the result is one of the given values.
///
/// The values must not contain NaN: callers filter (a NaN here does not crash, but takes part as a very large or very
/// small number). Infinite and negative values are fine.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "cfp/core/assert.hpp"
#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"
#include "cfp/math/order_statistic_impl.hpp"

namespace cfp {

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

/// The smallest value; 0 for none.
template <typename Scalar>
[[nodiscard]] Scalar minimum(span<const Scalar> values) noexcept {
  return values.empty() ? Scalar(0) : detail::value_range(values.data(), values.size()).smallest;
}
template <typename Scalar>
[[nodiscard]] Scalar minimum(span<Scalar> values) noexcept {
  return minimum(span<const Scalar>(values));
}

/// The value at 0-based position rank0 of the ascending order (0: the smallest). Overwrites `scratch`: afterwards its
/// content is unspecified. 0 for an empty span; a rank beyond the end counts as the last.
///
/// A histogram over the bit patterns, ordered as the numbers are, narrows the candidates to those of one of 256
/// buckets, again and again until few are left, which are compared with each other: linear for any distribution (at
/// most 5 rounds for float, 10 for double), without the branch misses that make up most of std::nth_element's time.
/// Allocates nothing.
template <typename Scalar>
[[nodiscard]] Scalar order_statistic(span<Scalar> scratch, std::size_t rank0) noexcept {
  CFP_ASSERT(rank0 < scratch.size());
  if (scratch.empty()) return Scalar(0);
  const std::size_t n = scratch.size();
  return detail::select_one(scratch.data(), n, (std::min)(rank0, n - 1), detail::value_range(scratch.data(), n));
}

/// The values at the quantile ranks of `quantiles` (ascending), as {0.1, 0.2, 0.3}, with one pass over the data for
/// all. Overwrites `scratch`. All 0 for an empty span.
template <typename Scalar, std::size_t Count>
[[nodiscard]] std::array<Scalar, Count> select_quantiles(span<Scalar> scratch,
                                                         const std::array<double, Count>& quantiles) noexcept {
  static_assert(Count > 0, "at least one quantile");
  std::array<Scalar, Count> values{};
  if (scratch.empty()) return values;
  std::array<std::size_t, Count> ranks{};
  for (std::size_t i = 0; i < Count; ++i) {
    ranks[i] = quantile_rank(quantiles[i], scratch.size()) - 1;
    CFP_ASSERT(i == 0 || ranks[i - 1] <= ranks[i]);
  }
  detail::select_many(scratch.data(), scratch.size(), ranks, values);
  return values;
}

}  // namespace cfp
