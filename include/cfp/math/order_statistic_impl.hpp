/// @file order_statistic_impl.hpp
/// Selection by histograms over the bit patterns of floating-point numbers, behind order_statistic.hpp.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>

#include <Eigen/Core>

#include "cfp/core/assert.hpp"
#include "cfp/simd/chunk.hpp"
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
  return bits ^ ((Key(0) - (bits >> (8 * sizeof(Key) - 1))) | sign);  // a negative number has all its bits flipped
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

/// The value at 0-based position rank < n of at most `few` values: the largest one that has no more than `rank` below
/// it. All are compared with all, without a branch to mispredict.
template <typename Scalar>
inline constexpr std::size_t few = sizeof(Scalar) == 4 ? 32 : 16;

template <typename Scalar>
[[nodiscard]] Scalar select_from_few(const Scalar* values, std::size_t n, std::size_t rank) noexcept {
  using Key = SortKey<Scalar>;
  constexpr std::size_t size = few<Scalar>;
  CFP_ASSERT(rank < n && n <= size);
  Key keys[size], below[size] = {};
  std::fill_n(keys, size, (std::numeric_limits<Key>::max)());
  for (std::size_t i = 0; i < n; ++i) keys[i] = sort_key(values[i]);
  for (std::size_t i = 0; i < n; ++i) {
    const Key key = keys[i];
    for (std::size_t j = 0; j < size; ++j) below[j] += key < keys[j] ? 1U : 0U;
  }
  std::size_t best = 0;
  Key best_key = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const bool better = below[i] <= rank && keys[i] >= best_key;
    best = better ? i : best;
    best_key = better ? keys[i] : best_key;
  }
  return values[best];
}

/// How often the keys of n values fall into each of 256 buckets: steps of 2^shift from the smallest on. A key out of
/// the range, which only a NaN has, falls into some bucket, the same each time.
template <typename Scalar>
class BucketCounts {
 public:
  static constexpr std::size_t buckets = 256;

  BucketCounts(const Scalar* values, std::size_t n, const ValueRange<Scalar>& range) noexcept
      : lowest_(sort_key(range.smallest)) {
    const SortKey<Scalar> width = sort_key(range.largest) - lowest_;
    while ((width >> shift_) >= buckets) ++shift_;
    for_each_block(values, n, [this](std::size_t, std::size_t size, const std::uint8_t* bucket) {
      std::size_t i = 0;
      for (; i + 4 <= size; i += 4) {
        const std::size_t b0 = bucket[i], b1 = bucket[i + 1], b2 = bucket[i + 2], b3 = bucket[i + 3];
        ++counts_[0][b0];
        ++counts_[1][b1];
        ++counts_[0][b2];
        ++counts_[1][b3];
      }
      for (; i < size; ++i) ++counts_[0][bucket[i]];
    });
  }

  [[nodiscard]] std::size_t operator[](std::size_t bucket) const noexcept {
    return std::size_t(counts_[0][bucket]) + counts_[1][bucket];
  }
  /// The bucket of a rank, which becomes the rank within that bucket.
  [[nodiscard]] std::size_t find(std::size_t& rank) const noexcept {
    std::size_t bucket = 0;
    while ((*this)[bucket] <= rank) rank -= (*this)[bucket++];
    return bucket;
  }
  /// Copies the values of those buckets that are marked, in their order; `to` may be `values`. Returns how many.
  std::size_t copy_marked(const Scalar* values, std::size_t n, const std::uint8_t (&marked)[buckets],
                          Scalar* to) const noexcept {
    std::size_t kept = 0;
    for_each_block(values, n, [&](std::size_t first, std::size_t size, const std::uint8_t* bucket) {
      for (std::size_t i = 0; i < size; ++i) {
        to[kept] = values[first + i];
        kept += marked[bucket[i]];
      }
    });
    return kept;
  }

 private:
  /// Calls work(first, size, bucket) for consecutive blocks, bucket[i] being that of values[first + i]. The keys of a
  /// whole block come first, in a loop of known length for the vectoriser.
  template <typename Work>
  void for_each_block(const Scalar* values, std::size_t n, Work&& work) const noexcept {
    const SortKey<Scalar> lowest = lowest_;
    const unsigned shift = shift_;
    for_each_chunk(n, [&](std::size_t first, std::size_t size) {
      Scalar padded[chunk_size];
      std::uint8_t bucket[chunk_size];
      if (size == chunk_size) {
        std::copy_n(values + first, chunk_size, padded);
      } else {
        std::fill_n(padded, chunk_size, values[first]);
        std::copy_n(values + first, size, padded);
      }
      for (std::size_t i = 0; i < chunk_size; ++i)
        bucket[i] = static_cast<std::uint8_t>((sort_key(padded[i]) - lowest) >> shift);
      work(first, size, bucket);
    });
  }

  SortKey<Scalar> lowest_;
  unsigned shift_ = 0;
  std::uint32_t counts_[2][buckets] = {};  // in turn, so that equal neighbours do not wait for each other
};

/// The value at 0-based position rank < n of n values in the given range. Destroys `values`.
template <typename Scalar>
[[nodiscard]] Scalar select_one(Scalar* values, std::size_t n, std::size_t rank, ValueRange<Scalar> range) noexcept {
  // A round narrows the range by 128 or more; the limit matters only when a NaN upsets the range.
  for (std::size_t round = 0; n > few<Scalar> && round < 2 * sizeof(Scalar); ++round) {
    if (round > 0) range = value_range(values, n);
    if (sort_key(range.smallest) == sort_key(range.largest)) return range.smallest;
    const BucketCounts<Scalar> counts(values, n, range);
    std::uint8_t marked[BucketCounts<Scalar>::buckets] = {};
    marked[counts.find(rank)] = 1;
    n = counts.copy_marked(values, n, marked, values);
  }
  if (n <= few<Scalar>) return select_from_few(values, n, rank);
  std::nth_element(values, values + rank, values + n, [](Scalar a, Scalar b) { return sort_key(a) < sort_key(b); });
  return values[rank];
}

/// Sets results[i] to the value at 0-based position ranks[i], both ascending. n > 0. Destroys `values`.
template <typename Scalar, std::size_t Count>
void select_many(Scalar* values, std::size_t n, std::array<std::size_t, Count> ranks,
                 std::array<Scalar, Count>& results) noexcept {
  using Counts = BucketCounts<Scalar>;
  std::size_t kept = n;
  if (n > few<Scalar>) {
    const ValueRange<Scalar> range = value_range(values, n);
    if (sort_key(range.smallest) == sort_key(range.largest)) {
      results.fill(range.smallest);
      return;
    }
    // One round for all ranks brings their buckets to the front. Then each bucket by itself, copied to the room behind.
    const Counts counts(values, n, range);
    std::array<std::size_t, Count> bucket{}, within = ranks;
    std::uint8_t marked[Counts::buckets] = {};
    for (std::size_t i = 0; i < Count; ++i) marked[bucket[i] = counts.find(within[i])] = 1;
    kept = counts.copy_marked(values, n, marked, values);
    if (2 * kept < n) {
      for (std::size_t i = 0; i < Count; ++i) {
        std::uint8_t only[Counts::buckets] = {};
        only[bucket[i]] = 1;
        const std::size_t size = counts.copy_marked(values, kept, only, values + kept);
        Scalar* const room = values + kept;
        results[i] = size <= few<Scalar> ? select_from_few(room, size, within[i])
                                         : select_one(room, size, within[i], value_range(room, size));
      }
      return;
    }
    for (std::size_t i = 0, below = 0; i < Count; ++i) {
      if (i > 0 && bucket[i] != bucket[i - 1]) below += counts[bucket[i - 1]];
      ranks[i] = below + within[i];
    }
  }
  for (std::size_t i = Count, end = kept; i-- > 0;) {
    if (ranks[i] < end) {
      std::nth_element(values, values + ranks[i], values + end,
                       [](Scalar a, Scalar b) { return sort_key(a) < sort_key(b); });
      end = ranks[i];
    }
    results[i] = values[ranks[i]];
  }
}

}  // namespace cfp::detail
