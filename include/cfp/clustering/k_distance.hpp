/// @file k_distance.hpp
/// Rules of the literature that read DBSCAN's eps and min_pts off the distances to the k-th neighbour (k-distance
/// median, k-distance knee, KANN-DBSCAN), on ascending values, where a neighbour search is a walk. `adaptive.hpp`
/// offers them by name.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "cfp/clustering/dbscan.hpp"
#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"

namespace cfp {

/// Grows to the largest input seen, then allocates nothing.
template <typename Scalar>
struct KDistanceWorkspace {
  std::vector<std::size_t> first;  ///< where the run of a value's nearest neighbours starts
  std::vector<Scalar> distances;
  DbscanWorkspace<Scalar> dbscan;
  std::vector<int> labels;
};

namespace detail {

template <typename Scalar>
void start_k_distances(std::size_t n, KDistanceWorkspace<Scalar>& workspace) {
  workspace.distances.assign(n, Scalar(0));
  workspace.first.resize(n);
  for (std::size_t i = 0; i < n; ++i) workspace.first[i] = i;
}

// From the k-th to the (k + 1)-th neighbour of every value: the run [first, first + k] grows by its nearer outer
// neighbour.
template <typename Scalar>
void next_k_distances(span<const Scalar> values, std::size_t k, KDistanceWorkspace<Scalar>& workspace) noexcept {
  const std::size_t n = values.size();
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t first = workspace.first[i], next = first + k + 1;
    const bool left = first > 0 && !(next < n && values[next] - values[i] < values[i] - values[first - 1]);
    workspace.distances[i] = left ? values[i] - values[first - 1] : values[next] - values[i];
    workspace.first[i] = left ? first - 1 : first;
  }
}

}  // namespace detail

/// Distance of every ascending, finite value to its k-th nearest other value, into `workspace.distances`, in the order
/// of the values. k is cut to n - 1. O(n k). Empty for n < 2.
template <typename Scalar>
void k_distances(span<const Scalar> values, std::size_t k, KDistanceWorkspace<Scalar>& workspace) {
  detail::start_k_distances(values.size() < 2 ? 0 : values.size(), workspace);
  if (values.size() < 2) return;
  for (std::size_t have = 0; have < (std::min)(k, values.size() - 1); ++have)
    detail::next_k_distances(values, have, workspace);
}

/// Median of the k-distances; 0 for n < 2. Reorders `workspace.distances`.
template <typename Scalar>
[[nodiscard]] Scalar median_k_distance(span<const Scalar> values, std::size_t k,
                                       KDistanceWorkspace<Scalar>& workspace) {
  k_distances(values, k, workspace);
  if (workspace.distances.empty()) return Scalar(0);
  const auto middle = workspace.distances.begin() + static_cast<std::ptrdiff_t>(workspace.distances.size() / 2);
  std::nth_element(workspace.distances.begin(), middle, workspace.distances.end());
  return *middle;
}

/// The knee of the ascending k-distance curve: its point farthest below the chord from first to last (Ester et al. read
/// it by eye; the chord is the usual automation, Satopaa et al. 2011). The first of equals; 0 for n < 2. Sorts
/// `workspace.distances`.
template <typename Scalar>
[[nodiscard]] Scalar knee_k_distance(span<const Scalar> values, std::size_t k, KDistanceWorkspace<Scalar>& workspace) {
  k_distances(values, k, workspace);
  const std::vector<Scalar>& curve = workspace.distances;
  if (curve.empty()) return Scalar(0);
  std::sort(workspace.distances.begin(), workspace.distances.end());
  const double last = static_cast<double>(curve.size() - 1), low = static_cast<double>(curve.front());
  const double rise = static_cast<double>(curve.back()) - low;
  std::size_t knee = 0;
  double depth = 0;
  for (std::size_t i = 0; i < curve.size(); ++i) {
    const double below = low + rise * (static_cast<double>(i) / last) - static_cast<double>(curve[i]);
    if (below > depth) {
      depth = below;
      knee = i;
    }
  }
  return curve[knee];
}

/// KANN-DBSCAN (Li, Zhang, Dong, Xu 2019): for K = 1, 2, … eps is the mean K-distance and min_pts the mean number of
/// neighbours within it (each value itself included); the first number of clusters that stays for `stable` consecutive
/// K is believed, and the largest K of that run is taken. At most `max_k` are tried; without a stable run the last
/// tried stands. O(n max_k): what is cubic in general is affordable on ascending values. `fallback` for n < 2.
template <typename Scalar>
[[nodiscard]] DbscanOptions kann_options(span<const Scalar> values, std::size_t stable, std::size_t max_k,
                                         const DbscanOptions& fallback, KDistanceWorkspace<Scalar>& workspace) {
  const std::size_t n = values.size();
  if (n < 2) return fallback;
  workspace.labels.resize(n);
  detail::start_k_distances(n, workspace);
  DbscanOptions chosen = fallback;
  std::size_t run = 0, clusters = 0;
  for (std::size_t k = 0; k < (std::min)(max_k, n - 1); ++k) {
    detail::next_k_distances(values, k, workspace);
    DbscanOptions trial;
    trial.eps = 0;
    for (const Scalar distance : workspace.distances)
      trial.eps += static_cast<double>(distance) / static_cast<double>(n);
    if (!is_finite(trial.eps)) return fallback;
    const Scalar eps = detail::radius<Scalar>(trial.eps);
    double pairs = 0;  // ordered pairs within eps, each value with itself included
    for (std::size_t i = 0, begin = 0; i < n; ++i) {
      while (!(values[i] - values[begin] <= eps)) ++begin;
      pairs += 2.0 * static_cast<double>(i - begin) + 1.0;
    }
    trial.min_pts = static_cast<std::size_t>((std::max)(1.0, std::round(pairs / static_cast<double>(n))));
    const std::size_t now = dbscan_ascending(values, trial, workspace.dbscan, span<int>(workspace.labels)).clusters;
    if (run >= stable && now != clusters) return chosen;
    run = run > 0 && now == clusters ? run + 1 : 1;
    clusters = now;
    chosen = trial;
  }
  return chosen;
}

}  // namespace cfp
