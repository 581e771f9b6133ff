// Rules of the literature that read DBSCAN's eps and min_pts off the distances to the k-th neighbour: the rivals of
// clustering/adaptive.hpp in foreground_study. All take ascending, finite values, where a neighbour search is a walk.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "cfp/clustering/adaptive.hpp"
#include "cfp/clustering/dbscan.hpp"
#include "cfp/core/numeric.hpp"

namespace cfp_study {

/// Distances of every value to its k-th nearest other value, for k = 1, 2, … one after the other.
class KDistances {
 public:
  explicit KDistances(const std::vector<double>& values) : values_(values), distances_(values.size(), 0.0) {
    for (std::size_t i = 0; i < values.size(); ++i) first_.push_back(i);
  }
  /// From the k-th to the (k + 1)-th neighbour, k < n - 1: the run [first, first + k] of a value's nearest ones grows
  /// by its nearer outer neighbour.
  void next() {
    const std::size_t n = values_.size();
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t first = first_[i], behind = first + k_ + 1;
      const bool left = first > 0 && !(behind < n && values_[behind] - values_[i] < values_[i] - values_[first - 1]);
      distances_[i] = left ? values_[i] - values_[first - 1] : values_[behind] - values_[i];
      first_[i] = left ? first - 1 : first;
    }
    ++k_;
  }
  [[nodiscard]] const std::vector<double>& get() const { return distances_; }

 private:
  const std::vector<double>& values_;
  std::vector<double> distances_;
  std::vector<std::size_t> first_;
  std::size_t k_ = 0;
};

/// In the order of the values; k is cut to n - 1. Empty for n < 2.
inline std::vector<double> k_distances(const std::vector<double>& values, std::size_t k) {
  if (values.size() < 2) return {};
  KDistances distances(values);
  for (std::size_t have = 0; have < (std::min)(k, values.size() - 1); ++have) distances.next();
  return distances.get();
}

/// 0 for n < 2.
inline double median_k_distance(const std::vector<double>& values, std::size_t k) {
  std::vector<double> distances = k_distances(values, k);
  if (distances.empty()) return 0;
  std::sort(distances.begin(), distances.end());
  return distances[distances.size() / 2];
}

/// The knee of the ascending k-distance curve: its point farthest below the chord from first to last (Ester et al. read
/// it by eye; the chord is the usual automation, Satopaa et al. 2011). The first of equals; 0 for n < 2.
inline double knee_k_distance(const std::vector<double>& values, std::size_t k) {
  std::vector<double> curve = k_distances(values, k);
  if (curve.empty()) return 0;
  std::sort(curve.begin(), curve.end());
  const double last = static_cast<double>(curve.size() - 1), rise = curve.back() - curve.front();
  std::size_t knee = 0;
  double depth = 0;
  for (std::size_t i = 0; i < curve.size(); ++i) {
    const double below = curve.front() + rise * (static_cast<double>(i) / last) - curve[i];
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
/// tried stands. `fallback` for n < 2.
inline cfp::DbscanOptions kann_options(const std::vector<double>& values, std::size_t stable, std::size_t max_k,
                                       const cfp::DbscanOptions& fallback) {
  const std::size_t n = values.size();
  if (n < 2) return fallback;
  cfp::DbscanWorkspace<double> workspace;
  std::vector<int> labels(n);
  KDistances distances(values);
  cfp::DbscanOptions chosen = fallback;
  std::size_t run = 0, clusters = 0;
  for (std::size_t k = 0; k < (std::min)(max_k, n - 1); ++k) {
    distances.next();
    cfp::DbscanOptions trial{0, 1};
    for (const double distance : distances.get()) trial.eps += distance / static_cast<double>(n);
    if (!cfp::is_finite(trial.eps)) return fallback;
    double pairs = 0;  // ordered pairs within eps, each value with itself included
    for (std::size_t i = 0, begin = 0; i < n; ++i) {
      while (!(values[i] - values[begin] <= trial.eps)) ++begin;
      pairs += 2.0 * static_cast<double>(i - begin) + 1.0;
    }
    trial.min_pts = static_cast<std::size_t>((std::max)(1.0, std::round(pairs / static_cast<double>(n))));
    const std::size_t now = cfp::dbscan_sorted(values, trial, workspace, labels).clusters;
    if (run >= stable && now != clusters) return chosen;
    run = run > 0 && now == clusters ? run + 1 : 1;
    clusters = now;
    chosen = trial;
  }
  return chosen;
}

enum class Rule { k_distance_median, k_distance_knee, kann };

/// eps and min_pts by a rule for depths that are valid or not, in any order; eps is at least 3 sigmas of the sensor at
/// the depth that the nearest 15 % reach, as the library's own rule has it.
inline cfp::DbscanOptions options_by(Rule rule, const std::vector<double>& depths) {
  std::vector<double> sorted;
  for (const double depth : depths) {
    if (cfp::is_valid_depth(depth)) sorted.push_back(depth);
  }
  std::sort(sorted.begin(), sorted.end());
  const std::size_t n = sorted.size();
  cfp::DbscanOptions chosen;
  if (n < 3) return chosen;
  if (rule == Rule::k_distance_median) {
    const std::size_t k = (std::max)(std::size_t(2), n / 20);
    chosen = {3.0 * median_k_distance(sorted, k), k + 1};
  } else if (rule == Rule::k_distance_knee) {
    chosen = {knee_k_distance(sorted, 4), 5};
  } else {
    chosen = kann_options(sorted, 10, (std::min)(n / 2, std::size_t(200)), chosen);
  }
  const double z = sorted[static_cast<std::size_t>(0.15 * static_cast<double>(n))];
  chosen.eps = (std::max)(chosen.eps, 3.0 * cfp::DepthNoise{}.sigma_m(z));
  return cfp::is_finite(chosen.eps) ? chosen : cfp::DbscanOptions{};
}

}  // namespace cfp_study
