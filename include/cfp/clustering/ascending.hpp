/// @file ascending.hpp
/// Values in ascending order together with where they stood: what 1-D clustering works on. Sorting is most of its cost.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "cfp/core/assert.hpp"
#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"

namespace cfp {

/// Sorted values; value i stood at `index[i]` of the input. Views into the workspace that made them, valid until its
/// next use.
template <typename Scalar>
struct Ascending {
  span<const Scalar> values;
  span<const std::uint32_t> index;
};

/// Grows to the largest input seen, then allocates nothing.
template <typename Scalar>
struct AscendingWorkspace {
  struct Item {
    Scalar value;
    std::uint32_t index;
  };
  std::vector<Item> items, scratch;
  std::vector<Scalar> values;
  std::vector<std::uint32_t> index;
};

namespace detail {

// Two counting passes over 2 * digit_bits bits of the value's position between the smallest and the largest; what
// shares a position keeps its order. Monotone in floating point, so the result is sorted but for values nearer than
// range / 4^digit_bits.
template <int digit_bits, typename Scalar>
void counting_sort(Scalar low, Scalar scale, AscendingWorkspace<Scalar>& workspace) noexcept {
  constexpr std::size_t buckets = std::size_t(1) << digit_bits;
  const auto position = [low, scale](Scalar value) { return static_cast<std::uint32_t>((value - low) * scale); };
  std::array<std::uint32_t, buckets> coarse{}, fine{};
  for (const auto& item : workspace.items) {
    const std::uint32_t p = position(item.value);
    ++fine[p % buckets];
    ++coarse[p / buckets];
  }
  std::uint32_t fine_sum = 0, coarse_sum = 0;
  for (std::size_t b = 0; b < buckets; ++b) {
    const std::uint32_t f = fine[b], c = coarse[b];
    fine[b] = fine_sum;
    coarse[b] = coarse_sum;
    fine_sum += f;
    coarse_sum += c;
  }
  for (const auto& item : workspace.items) workspace.scratch[fine[position(item.value) % buckets]++] = item;
  for (const auto& item : workspace.scratch) {
    const std::uint32_t to = coarse[position(item.value) / buckets]++;
    workspace.values[to] = item.value;
    workspace.index[to] = item.index;
  }
}

// Stable insertion sort that gives up, the arrays still holding the same pairs, after `budget` moves.
template <typename Scalar>
bool insertion_sort(Scalar* values, std::uint32_t* index, std::size_t n, std::size_t budget) noexcept {
  for (std::size_t i = 1; i < n; ++i) {
    if (!(values[i] < values[i - 1])) continue;
    const Scalar value = values[i];
    const std::uint32_t at = index[i];
    std::size_t j = i;
    for (; j > 0 && value < values[j - 1]; --j) {
      values[j] = values[j - 1];
      index[j] = index[j - 1];
    }
    values[j] = value;
    index[j] = at;
    if (i - j > budget) return false;
    budget -= i - j;
  }
  return true;
}

template <typename Scalar>
void comparison_sort(AscendingWorkspace<Scalar>& workspace) noexcept {
  using Item = typename AscendingWorkspace<Scalar>::Item;
  std::sort(workspace.items.begin(), workspace.items.end(), [](const Item& a, const Item& b) {
    return a.value < b.value || (!(b.value < a.value) && a.index < b.index);
  });
  for (std::size_t i = 0; i < workspace.items.size(); ++i) {
    workspace.values[i] = workspace.items[i].value;
    workspace.index[i] = workspace.items[i].index;
  }
}

}  // namespace detail

/// Those of `values` for which `keep(value)` holds, ascending, equal values by ascending index (-0 equals +0). `keep`
/// must refuse NaN and infinities. Counting passes over the value's position in the range, finished by insertion; O(n)
/// for values without wild outliers, at worst (one outlier that presses all others together) std::sort's O(n log n).
template <typename Scalar, typename Keep>
Ascending<Scalar> sort_ascending(span<const Scalar> values, AscendingWorkspace<Scalar>& workspace, const Keep& keep) {
  CFP_ASSERT(values.size() < 0xffffffffU);
  workspace.items.resize(values.size());
  Scalar low = (std::numeric_limits<Scalar>::max)(), high = (std::numeric_limits<Scalar>::lowest)();
  std::size_t n = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const Scalar value = values[i];
    const bool kept = keep(value);
    workspace.items[n] = {value, static_cast<std::uint32_t>(i)};
    n += kept ? 1U : 0U;
    low = kept && value < low ? value : low;
    high = kept && value > high ? value : high;
  }
  workspace.items.resize(n);
  workspace.scratch.resize(n);
  workspace.values.resize(n);
  workspace.index.resize(n);

  // Measured: below about 40 values the counters cost more than plain insertion; two 8-bit digits win up to about 1500
  // values, beyond they leave too much to insertion.
  const bool few = n < 40;
  const int digit_bits = n < 1500 ? 8 : 11;
  const Scalar positions = static_cast<Scalar>((1L << (2 * digit_bits)) - 2);
  const Scalar scale = positions / (high - low);
  if (few || !(scale > Scalar(0)) || !is_finite(scale)) {
    for (std::size_t i = 0; i < n; ++i) {
      workspace.values[i] = workspace.items[i].value;
      workspace.index[i] = workspace.items[i].index;
    }
  } else if (digit_bits == 8) {
    detail::counting_sort<8>(low, scale, workspace);
  } else {
    detail::counting_sort<11>(low, scale, workspace);
  }
  if (!detail::insertion_sort(workspace.values.data(), workspace.index.data(), n, few ? n * n : 8 * n))
    detail::comparison_sort(workspace);
  return {workspace.values, workspace.index};
}

}  // namespace cfp
