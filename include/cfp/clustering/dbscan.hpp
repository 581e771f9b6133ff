/// @file dbscan.hpp
/// Exact DBSCAN (Ester, Kriegel, Sander, Xu, KDD 1996) of scalar values, the clustering of the paper's section IV-C.
/// In one dimension neighbourhoods are runs of the sorted values, so no tree and no quadratic search is needed.
#pragma once

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "cfp/core/numeric.hpp"
#include "cfp/core/options.hpp"
#include "cfp/core/span.hpp"
#include "cfp/core/status.hpp"

namespace cfp {

/// The label of a value that belongs to no cluster.
inline constexpr int dbscan_noise = -1;

struct DbscanOptions {
  double eps = 0.15;  ///< radius of the neighbourhood, unit of the values, finite, >= 0; |a - b| <= eps are neighbours
  std::size_t min_pts = 5;  ///< a value with at least so many neighbours, itself included, is a core point; >= 1
};

struct DbscanResult {
  Status status = Status::ok;  ///< invalid_input: options outside their range, everything is noise. No clusters is ok.
  std::size_t clusters = 0;    ///< labels run from 0 to clusters - 1
  std::size_t core_points = 0;
  std::size_t noise = 0;    ///< finite values in no cluster
  std::size_t invalid = 0;  ///< NaN and infinite values; they get the noise label and are nobody's neighbour
};

/// Sorted values; value i stood at `index[i]` of the input. Views into the workspace that made them, valid until its
/// next use.
template <typename Scalar>
struct SortedValues {
  span<const Scalar> values;
  span<const std::uint32_t> index;
};

/// Reused from call to call; grows to the largest input seen, then allocates nothing.
template <typename Scalar>
struct DbscanWorkspace {
  std::vector<std::pair<Scalar, std::uint32_t>> sorted;
  std::vector<std::uint32_t> index;
  std::vector<Scalar> values;  // sorted
  std::vector<std::uint32_t> neighbours;
  std::vector<int> labels;  // of sorted values

  void reserve(std::size_t n) {
    sorted.reserve(n), index.reserve(n), values.reserve(n), neighbours.reserve(n), labels.reserve(n);
  }
};

namespace detail {
inline namespace CFP_ISA {

// eps in the type of the values; a finite double beyond the range of float counts as the largest float.
template <typename Scalar>
[[nodiscard]] constexpr Scalar radius(double eps) noexcept {
  return static_cast<Scalar>((std::min)(eps, static_cast<double>((std::numeric_limits<Scalar>::max)())));
}

// Position of a share in [0, 1) of n > 0 ascending values.
[[nodiscard]] constexpr std::size_t position_of_share(double share, std::size_t n) noexcept {
  const auto at = static_cast<std::size_t>(share * static_cast<double>(n));
  return at < n ? at : n - 1;
}

// neighbours[i] = how many of the ascending values lie within eps of value i, itself included.
template <typename Scalar>
void count_neighbours(span<const Scalar> values, Scalar eps, std::vector<std::uint32_t>& neighbours) {
  const std::size_t n = values.size();
  neighbours.resize(n);
  for (std::size_t i = 0, begin = 0, end = 0; i < n; ++i) {
    while (!(values[i] - values[begin] <= eps)) ++begin;
    while (end < n && values[end] - values[i] <= eps) ++end;
    neighbours[i] = static_cast<std::uint32_t>(end - begin);
  }
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

[[nodiscard]] constexpr OptionPath invalid_field(const DbscanOptions& options) noexcept {
  if (!detail::non_negative(options.eps)) return "eps";
  if (options.min_pts < 1) return "min_pts";
  return {};
}

/// Those of `values` for which `keep(value)` holds, ascending, equal values by ascending index (-0 equals +0). `keep`
/// must refuse NaN and infinities. O(n log n).
template <typename Scalar, typename Keep>
SortedValues<Scalar> sort_values(span<const non_deduced<Scalar>> values, const Keep& keep,
                                 DbscanWorkspace<Scalar>& workspace) {
  CFP_ASSERT(values.size() < 0xffffffffU);
  workspace.sorted.clear(), workspace.values.clear(), workspace.index.clear();
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (keep(values[i])) workspace.sorted.emplace_back(values[i], static_cast<std::uint32_t>(i));
  }
  std::sort(workspace.sorted.begin(), workspace.sorted.end());
  for (const auto& [value, i] : workspace.sorted) {
    workspace.values.push_back(value);
    workspace.index.push_back(i);
  }
  return {workspace.values, workspace.index};
}

/// DBSCAN of values that are finite and ascending already (asserted in debug builds): `labels[i]` belongs to
/// `values[i]`. As `dbscan` otherwise. O(n).
template <typename Scalar>
DbscanResult dbscan_sorted(span<const non_deduced<Scalar>> values, const DbscanOptions& options,
                           DbscanWorkspace<Scalar>& workspace, span<int> labels) {
  CFP_ASSERT(labels.size() == values.size());
  CFP_ASSERT(std::is_sorted(values.begin(), values.end()));
  std::vector<std::uint32_t>& neighbours = workspace.neighbours;
  DbscanResult result;
  const std::size_t n = values.size();
  if (invalid_field(options)) {
    std::fill(labels.begin(), labels.end(), dbscan_noise);
    result.status = Status::invalid_input;
    result.noise = n;
    return result;
  }
  const Scalar eps = detail::radius<Scalar>(options.eps);
  detail::count_neighbours<Scalar>(values, eps, neighbours);
  const auto is_core = [&](std::size_t i) { return neighbours[i] >= options.min_pts; };
  // A core point within eps of the one before is of its cluster.
  for (std::size_t i = 0, before = n; i < n; ++i) {
    if (!is_core(i)) continue;
    if (before == n || !(values[i] - values[before] <= eps)) ++result.clusters;
    labels[i] = static_cast<int>(result.clusters) - 1;
    ++result.core_points;
    before = i;
  }
  // Every value takes the label of the nearest core point, its own where it is one.
  constexpr Scalar none = std::numeric_limits<Scalar>::infinity();
  for (std::size_t i = 0, left = n, right = 0; i < n; ++i) {
    while (right < n && (right < i || !is_core(right))) ++right;
    if (right == i) left = i;
    const Scalar below = left < n ? values[i] - values[left] : none;
    const Scalar above = right < n ? values[right] - values[i] : none;
    const bool near = (std::min)(below, above) <= eps;
    labels[i] = near ? labels[below <= above ? left : right] : dbscan_noise;
    result.noise += near ? 0U : 1U;
  }
  return result;
}

/// Labels every value: clusters are numbered by ascending position, `dbscan_noise` marks the rest.
/// Core point: at least min_pts values, itself included, within eps (inclusive). Core points within eps of each other
/// share a cluster. A border point (not core, but within eps of a core point) joins its nearest core point; of two
/// equally near ones the lower value (which leaves no choice: equal values are core together and share their cluster).
/// So the labels depend on the values alone and not on their order. Distances are differences as rounded in Scalar; eps
/// is rounded to Scalar. NaN and infinite values are noise. O(n log n); deterministic; allocates only when the
/// workspace grows. Departure: the original lets a border point join the cluster that happens to find it first.
template <typename Scalar>
DbscanResult dbscan(span<const non_deduced<Scalar>> values, const DbscanOptions& options,
                    DbscanWorkspace<Scalar>& workspace, span<int> labels) {
  CFP_ASSERT(labels.size() == values.size());
  const SortedValues<Scalar> sorted = sort_values(
      values, [](Scalar value) { return is_finite(value); }, workspace);
  workspace.labels.resize(sorted.values.size());
  DbscanResult result = dbscan_sorted(sorted.values, options, workspace, workspace.labels);
  std::fill(labels.begin(), labels.end(), dbscan_noise);
  for (std::size_t i = 0; i < sorted.values.size(); ++i) labels[sorted.index[i]] = workspace.labels[i];
  result.invalid = values.size() - sorted.values.size();
  return result;
}

}  // namespace CFP_ISA
}  // namespace cfp
