/// @file sorted_values.hpp
/// Values in ascending order together with where they stood: what clustering in one dimension works on.
#pragma once

#include <algorithm>
#include <vector>

#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"

namespace cfp {

/// Sorted values; value i stood at `index[i]` of the input. Views into the workspace that made them, valid until its
/// next use.
template <typename Scalar>
struct SortedValues {
  span<const Scalar> values;
  span<const std::uint32_t> index;
};

/// Grows to the largest input seen, then allocates nothing.
template <typename Scalar>
struct SortWorkspace {
  struct Item {
    Scalar value;
    std::uint32_t index;
  };
  std::vector<Item> items, sorted;
  std::vector<std::size_t> bucket_end;
  std::vector<Scalar> values;
  std::vector<std::uint32_t> index;
};

inline namespace CFP_ISA {

/// Those of `values` for which `keep(value)` holds, ascending, equal values by ascending index (-0 equals +0). `keep`
/// must refuse NaN and infinities. One counting pass puts the values into buckets of equal width, std::sort orders each
/// bucket: O(n) unless the values crowd into few buckets, never worse than O(n log n).
template <typename Scalar, typename Keep>
SortedValues<Scalar> sort_values(span<const non_deduced<Scalar>> values, const Keep& keep,
                                 SortWorkspace<Scalar>& workspace) {
  using Item = typename SortWorkspace<Scalar>::Item;
  CFP_ASSERT(values.size() < 0xffffffffU);
  std::vector<Item>&items = workspace.items, &sorted = workspace.sorted;
  items.clear();
  Scalar low = (std::numeric_limits<Scalar>::max)(), high = (std::numeric_limits<Scalar>::lowest)();
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!keep(values[i])) continue;
    items.push_back({values[i], static_cast<std::uint32_t>(i)});
    low = (std::min)(low, values[i]);
    high = (std::max)(high, values[i]);
  }
  const std::size_t n = items.size();

  // The bucket is monotone in the value, also after rounding, so the buckets are in order.
  Scalar scale = static_cast<Scalar>(2 * n) / (high - low);
  if (!is_finite(scale)) scale = Scalar(0);  // equal values, or too near each other; 0 for a range that overflows
  const auto bucket = [=](const Item& item) {
    return scale > Scalar(0) ? (std::min)(static_cast<std::size_t>((item.value - low) * scale), 2 * n) : 0;
  };
  std::vector<std::size_t>& end = workspace.bucket_end;
  end.assign(2 * n + 2, 0);
  for (const Item& item : items) ++end[bucket(item) + 1];
  for (std::size_t b = 1; b < end.size(); ++b) end[b] += end[b - 1];
  sorted.resize(n);
  for (const Item& item : items) sorted[end[bucket(item)]++] = item;
  const auto before = [](const Item& a, const Item& b) {
    return a.value < b.value || (!(b.value < a.value) && a.index < b.index);
  };
  for (std::size_t b = 0, begin = 0; begin < n; begin = end[b++]) {
    if (end[b] - begin > 1) std::sort(sorted.data() + begin, sorted.data() + end[b], before);
  }
  workspace.values.resize(n);
  workspace.index.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    workspace.values[i] = sorted[i].value;
    workspace.index[i] = sorted[i].index;
  }
  return {workspace.values, workspace.index};
}

}  // namespace CFP_ISA
}  // namespace cfp
