/// @file order_statistic_impl.hpp
/// Selection by histograms over the bit patterns of floating-point numbers, behind order_statistic.hpp.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>

#include <Eigen/Core>

#include "cfp/core/assert.hpp"
#include "cfp/version.hpp"

namespace cfp::detail {

template <typename Scalar>
using SortKey = std::conditional_t<sizeof(Scalar) == 4, std::uint32_t, std::uint64_t>;

/// An unsigned integer that is ordered as the numbers are, -0 and +0 being one.
template <typename Scalar>
[[nodiscard]] SortKey<Scalar> sort_key(Scalar value) noexcept {
  static_assert(std::numeric_limits<Scalar>::is_iec559 && sizeof(Scalar) == sizeof(SortKey<Scalar>), "float or double");
  using Key = SortKey<Scalar>;
  constexpr Key sign = Key(1) << (8 * sizeof(Key) - 1);
  value += Scalar(0);  // -0 becomes +0
  Key bits;
  std::memcpy(&bits, &value, sizeof(bits));
  return (bits & sign) != 0 ? ~bits : bits | sign;
}

template <typename Scalar>
struct ValueRange {
  Scalar smallest, largest;
};

template <typename Scalar>
[[nodiscard]] ValueRange<Scalar> value_range(const Scalar* values, std::size_t n) noexcept {
  const Eigen::Map<const Eigen::Array<Scalar, Eigen::Dynamic, 1>> array(values, static_cast<Eigen::Index>(n));
  return {array.minCoeff(), array.maxCoeff()};
}

/// Sets results[i] to the value at 0-based position ranks[i], both ascending. n > 0, count > 0. Destroys `values`.
template <typename Scalar>
void select_few(Scalar* values, std::size_t n, const std::size_t* ranks, Scalar* results, std::size_t count) noexcept {
  const auto less = [](Scalar a, Scalar b) { return sort_key(a) < sort_key(b); };
  std::size_t end = n;
  for (std::size_t i = count; i-- > 0;) {
    if (ranks[i] < end) {
      std::nth_element(values, values + ranks[i], values + end, less);
      end = ranks[i];
    }
    results[i] = values[ranks[i]];
  }
}

/// The same for any n: bucket b of the histogram holds the keys with (key - lowest) >> shift == b.
template <typename Scalar>
void select(Scalar* values, std::size_t n, std::size_t* ranks, Scalar* results, std::size_t count) noexcept {
  constexpr std::size_t few = 48;
  constexpr std::size_t buckets = 256;
  using Key = SortKey<Scalar>;
  // A round narrows the range of one rank by 128 or more; the limit matters only when a NaN upsets the range.
  for (std::size_t round = 0; n > few && round < 2 * sizeof(Key); ++round) {
    const ValueRange<Scalar> range = value_range(values, n);
    const Key lowest = sort_key(range.smallest);
    const Key width = sort_key(range.largest) - lowest;
    if (width == 0) {
      std::fill_n(results, count, range.smallest);
      return;
    }
    unsigned shift = 0;
    while ((width >> shift) >= buckets) ++shift;
    // A NaN among the values may lie outside the range; the last bucket takes it.
    const auto bucket = [&](Scalar value) {
      return static_cast<std::size_t>((std::min)(static_cast<Key>((sort_key(value) - lowest) >> shift), static_cast<Key>(buckets - 1)));
    };
    // Two counters per bucket in turn, so that equal neighbours do not wait for each other.
    std::uint32_t counts[2][buckets] = {};
    for (std::size_t i = 0; i + 1 < n; i += 2) {
      ++counts[0][bucket(values[i])];
      ++counts[1][bucket(values[i + 1])];
    }
    if (n % 2 != 0) ++counts[0][bucket(values[n - 1])];
    std::size_t first = 0, below = 0;
    const auto count_in = [&](std::size_t b) { return std::size_t(counts[0][b]) + counts[1][b]; };
    while (below + count_in(first) <= ranks[0]) below += count_in(first++);
    std::size_t last = first, up_to = below + count_in(first);
    while (up_to <= ranks[count - 1]) up_to += count_in(++last);
    // Keep the candidates: buckets first to last, in front.
    std::size_t kept = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const Scalar value = values[i];
      const std::size_t b = bucket(value);
      values[kept] = value;
      kept += (b >= first && b <= last) ? 1 : 0;
    }
    for (std::size_t i = 0; i < count; ++i) ranks[i] -= below;
    CFP_ASSERT(kept == up_to - below);
    const bool too_wide = count > 1 && kept > n / 2;
    n = kept;
    if (too_wide) break;
  }
  select_few(values, n, ranks, results, count);
}

}  // namespace cfp::detail
