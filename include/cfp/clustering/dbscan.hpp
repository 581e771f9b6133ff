/// @file dbscan.hpp
/// Exact DBSCAN (Ester, Kriegel, Sander, Xu, KDD 1996) of scalar values, the clustering of the paper's section IV-C.
/// In one dimension neighbourhoods are runs of the sorted values, so no tree and no quadratic search is needed.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "cfp/clustering/ascending.hpp"
#include "cfp/core/assert.hpp"
#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"
#include "cfp/core/status.hpp"

namespace cfp {

/// The label of a value that belongs to no cluster.
inline constexpr int dbscan_noise = -1;

struct DbscanOptions {
  double eps = 0.15;  ///< radius of the neighbourhood, unit of the values, finite, >= 0; |a - b| <= eps are neighbours
  std::size_t min_pts = 5;  ///< a value with at least so many neighbours, itself included, is a core point; >= 1
};

[[nodiscard]] constexpr const char* invalid_field(const DbscanOptions& options) noexcept {
  if (!(options.eps >= 0.0) || !is_finite(options.eps)) return "eps";
  return options.min_pts >= 1 ? nullptr : "min_pts";
}

struct DbscanResult {
  Status status = Status::ok;  ///< invalid_input: options outside their range, everything is noise. No clusters is ok.
  std::size_t clusters = 0;    ///< labels run from 0 to clusters - 1
  std::size_t core_points = 0;
  std::size_t noise = 0;    ///< finite values in no cluster
  std::size_t invalid = 0;  ///< NaN and infinite values; they get the noise label and are nobody's neighbour
};

/// Reused from call to call; grows to the largest input seen, then allocates nothing.
template <typename Scalar>
struct DbscanWorkspace {
  AscendingWorkspace<Scalar> ascending;
  std::vector<unsigned char> core;
};

namespace detail {

// eps in the type of the values; a finite double beyond the range of float counts as the largest float.
template <typename Scalar>
[[nodiscard]] constexpr Scalar radius(double eps) noexcept {
  return eps < static_cast<double>((std::numeric_limits<Scalar>::max)()) ? static_cast<Scalar>(eps)
                                                                         : (std::numeric_limits<Scalar>::max)();
}

// core[i] = whether at least min_pts of the ascending values lie within eps of value i.
template <typename Scalar>
void find_core_points(span<const Scalar> values, Scalar eps, std::size_t min_pts, std::vector<unsigned char>& core) {
  const std::size_t n = values.size();
  core.assign(n, 0);
  if (min_pts > n) return;
  const Scalar* v = values.data();
  const std::size_t reach = min_pts - 1;
  // One-sided test first: whoever has min_pts values within eps on one side alone. It settles nearly all core points
  // and vectorises.
  for (std::size_t i = 0; i < n - reach; ++i) core[i] = v[i + reach] - v[i] <= eps ? 1 : 0;
  for (std::size_t i = reach; i < n; ++i)
    core[i] = static_cast<unsigned char>(core[i] | (v[i] - v[i - reach] <= eps ? 1 : 0));
  // The rest: the first of the min_pts - 1 values before i that is a neighbour starts the only run that can suffice.
  for (std::size_t i = 0; i < n; ++i) {
    if (core[i] != 0) continue;
    std::size_t first = i < reach ? 0 : i - reach, last = i;
    while (first < last) {
      const std::size_t middle = first + (last - first) / 2;
      if (v[i] - v[middle] <= eps)
        last = middle;
      else
        first = middle + 1;
    }
    core[i] = first + reach < n && v[first + reach] - v[i] <= eps ? 1 : 0;
  }
}

// Calls emit(i, label) once for every ascending value i.
template <typename Scalar, typename Emit>
DbscanResult sweep(span<const Scalar> values, const DbscanOptions& options, std::vector<unsigned char>& core,
                   const Emit& emit) {
  DbscanResult result;
  const std::size_t n = values.size();
  if (invalid_field(options) != nullptr) {
    for (std::size_t i = 0; i < n; ++i) emit(i, dbscan_noise);
    result.status = Status::invalid_input;
    result.noise = n;
    return result;
  }
  const Scalar eps = radius<Scalar>(options.eps);
  find_core_points(values, eps, options.min_pts, core);
  const std::size_t none = n;
  std::size_t left = none;  // the last core point seen
  int label = -1;
  for (std::size_t begin = 0; begin < n;) {
    // [begin, right) are not core points; right is the next one, or the end.
    std::size_t right = begin;
    while (right < n && core[right] == 0) ++right;
    const bool new_cluster = left == none || (right < n && !(values[right] - values[left] <= eps));
    const int right_label = new_cluster ? label + 1 : label;
    for (std::size_t i = begin; i < right; ++i) {
      const bool near_left = left != none && values[i] - values[left] <= eps;
      const bool near_right = right < n && values[right] - values[i] <= eps;
      const bool take_left = near_left && (!near_right || values[i] - values[left] <= values[right] - values[i]);
      result.noise += near_left || near_right ? 0U : 1U;
      emit(i, take_left ? label : near_right ? right_label : dbscan_noise);
    }
    if (right == n) break;
    emit(right, right_label);
    ++result.core_points;
    label = right_label;
    left = right;
    begin = right + 1;
  }
  result.clusters = static_cast<std::size_t>(label + 1);
  return result;
}

}  // namespace detail

/// DBSCAN of values that are finite and ascending already (asserted in debug builds): `labels[i]` belongs to
/// `values[i]`. As `dbscan` otherwise. O(n log min_pts), in practice O(n).
template <typename Scalar>
DbscanResult dbscan_ascending(span<const Scalar> values, const DbscanOptions& options,
                              DbscanWorkspace<Scalar>& workspace, span<int> labels) {
  CFP_ASSERT(labels.size() == values.size());
  CFP_ASSERT(std::is_sorted(values.begin(), values.end()));
  int* out = labels.data();
  return detail::sweep(values, options, workspace.core, [out](std::size_t i, int label) { out[i] = label; });
}

/// Labels every value: clusters are numbered by ascending position, `dbscan_noise` marks the rest.
/// Core point: at least min_pts values, itself included, within eps (inclusive). Core points within eps of each other
/// share a cluster. A border point (not core, but within eps of a core point) joins its nearest core point; of two
/// equally near ones the lower value (which leaves no choice: equal values are core together and share their cluster).
/// So the labels depend on the values alone and not on their order. Distances are differences as rounded in Scalar; eps
/// is rounded to Scalar. NaN and infinite values are noise. O(n log n), in practice O(n); deterministic; allocates only
/// when the workspace grows. Departure: the original lets a border point join the cluster that happens to find it
/// first.
template <typename Scalar>
DbscanResult dbscan(span<const Scalar> values, const DbscanOptions& options, DbscanWorkspace<Scalar>& workspace,
                    span<int> labels) {
  CFP_ASSERT(labels.size() == values.size());
  const Ascending<Scalar> ascending =
      sort_ascending(values, workspace.ascending, [](Scalar value) { return is_finite(value); });
  int* out = labels.data();
  const std::size_t invalid = values.size() - ascending.values.size();
  if (invalid > 0) std::fill(out, out + values.size(), dbscan_noise);
  const std::uint32_t* index = ascending.index.data();
  const auto emit = [out, index](std::size_t i, int label) { out[index[i]] = label; };
  DbscanResult result = detail::sweep(ascending.values, options, workspace.core, emit);
  result.invalid = invalid;
  return result;
}

}  // namespace cfp
