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

#include "cfp/core/span.hpp"

namespace cfp {

namespace detail {
inline namespace CFP_ISA {

// Moves the values that `goes_first` accepts to the front and returns their number, without a branch to mispredict.
template <typename Scalar, typename Predicate>
std::size_t branchless_partition(Scalar* values, std::size_t n, const Predicate& goes_first) noexcept {
  std::size_t front = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const Scalar value = values[i];
    values[i] = values[front];
    values[front] = value;
    front += goes_first(value) ? 1U : 0U;
  }
  return front;
}

// Hoare's quickselect: values[rank] becomes what sorting would put there, with nothing larger before it. Partitions
// without branches make it several times as fast as std::nth_element.
template <typename Scalar>
void select_rank(Scalar* values, std::size_t n, std::size_t rank) noexcept {
  constexpr std::size_t few = 16;
  constexpr int max_rounds = 64;  // a heap finishes what so many pivots did not
  for (int round = 0; n > few && round < max_rounds; ++round) {
    const Scalar a = values[0], b = values[n / 2], c = values[n - 1];
    const Scalar pivot = (std::max)((std::min)(a, b), (std::min)((std::max)(a, b), c));
    const std::size_t below = branchless_partition(values, n, [pivot](Scalar x) { return x < pivot; });
    if (rank < below) {
      n = below;
      continue;
    }
    const std::size_t up_to =
        below + branchless_partition(values + below, n - below, [pivot](Scalar x) { return x <= pivot; });
    if (rank < up_to) return;
    values += up_to;
    rank -= up_to;
    n -= up_to;
  }
  std::partial_sort(values, values + rank + 1, values + n);
}

}  // namespace CFP_ISA
}  // namespace detail

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
/// rank beyond the end counts as the last. Linear time, allocates nothing.
template <typename Scalar>
[[nodiscard]] Scalar order_statistic(span<Scalar> values, std::size_t rank0) noexcept {
  if (values.empty()) return Scalar(0);
  rank0 = (std::min)(rank0, values.size() - 1);
  detail::select_rank(values.data(), values.size(), rank0);
  return values[rank0];
}

/// The q-quantile, at quantile_rank. Reorders `values`; 0 without any.
template <typename Scalar>
[[nodiscard]] Scalar quantile(span<Scalar> values, double q) noexcept {
  return order_statistic(values, quantile_rank(q, values.size()) - 1);
}

}  // namespace CFP_ISA
}  // namespace cfp
