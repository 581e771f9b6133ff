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
  std::vector<std::uint32_t> kept, index;
  std::vector<std::size_t> bucket_end;
  std::vector<Scalar> values;

  void reserve(std::size_t n) { kept.reserve(n), index.reserve(n), bucket_end.reserve(2 * n + 2), values.reserve(n); }
};

inline namespace CFP_ISA {

/// Those of `values` for which `keep(value)` holds, ascending, equal values by ascending index (-0 equals +0). `keep`
/// must refuse NaN and infinities. One counting pass puts the values into buckets of equal width, std::sort orders each
/// bucket: O(n) unless the values crowd into few buckets, never worse than O(n log n).
template <typename Scalar, typename Keep>
SortedValues<Scalar> sort_values(span<const non_deduced<Scalar>> values, const Keep& keep,
                                 SortWorkspace<Scalar>& workspace) {
  CFP_ASSERT(values.size() < 0xffffffffU);
  std::vector<std::uint32_t>&kept = workspace.kept, &index = workspace.index;
  kept.clear();
  Scalar low = (std::numeric_limits<Scalar>::max)(), high = (std::numeric_limits<Scalar>::lowest)();
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!keep(values[i])) continue;
    kept.push_back(static_cast<std::uint32_t>(i));
    low = (std::min)(low, values[i]);
    high = (std::max)(high, values[i]);
  }
  const std::size_t n = kept.size();

  // The bucket is monotone in the value, also after rounding, so the buckets are in order.
  Scalar scale = static_cast<Scalar>(2 * n) / (high - low);
  if (!is_finite(scale)) scale = Scalar(0);  // equal values, or too near each other; 0 for a range that overflows
  const auto bucket = [=](std::uint32_t i) {
    return scale > Scalar(0) ? (std::min)(static_cast<std::size_t>((values[i] - low) * scale), 2 * n) : 0;
  };
  std::vector<std::size_t>& end = workspace.bucket_end;
  end.assign(2 * n + 2, 0);
  for (const std::uint32_t i : kept) ++end[bucket(i) + 1];
  for (std::size_t b = 1; b < end.size(); ++b) end[b] += end[b - 1];
  index.resize(n);
  for (const std::uint32_t i : kept) index[end[bucket(i)]++] = i;
  const auto before = [=](std::uint32_t a, std::uint32_t b) {
    return values[a] < values[b] || (!(values[b] < values[a]) && a < b);
  };
  for (std::size_t b = 0, begin = 0; begin < n; begin = end[b++]) {
    if (end[b] - begin > 1) std::sort(index.data() + begin, index.data() + end[b], before);
  }
  workspace.values.resize(n);
  for (std::size_t i = 0; i < n; ++i) workspace.values[i] = values[index[i]];
  return {workspace.values, workspace.index};
}

}  // namespace CFP_ISA
}  // namespace cfp
