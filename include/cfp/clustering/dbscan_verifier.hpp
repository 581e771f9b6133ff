/// @file dbscan_verifier.hpp
/// Checks a DBSCAN labelling of scalar values against the definition, whoever made it. For tests: O(n^2), allocates.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "cfp/clustering/dbscan.hpp"
#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"

namespace cfp {

/// What is wrong with a labelling; the first fault in this order is reported.
enum class DbscanFault : std::uint8_t {
  none,
  label_count,         ///< not one label per value
  invalid_labelled,    ///< a NaN or infinite value has a label other than noise
  core_is_noise,       ///< a core point is labelled noise
  cluster_torn,        ///< two core points that are density-connected have different labels
  clusters_joined,     ///< two core points that are not density-connected share a label
  noise_labelled,      ///< a value without a core point within eps carries a cluster's label
  border_is_noise,     ///< a value within eps of a core point is labelled noise
  border_foreign,      ///< a border point has the label of a cluster without a core point within eps of it
  border_not_nearest,  ///< a border point does not have the label of its nearest core point (ties: the lower value)
  numbering            ///< labels are not 0, 1, 2, … by ascending position
};

struct DbscanVerifierOptions {
  bool nearest_border = true;     ///< false: any core point within eps will do, as in the original definition
  bool ascending_numbers = true;  ///< false: any numbering
};

struct DbscanVerdict {
  DbscanFault fault = DbscanFault::none;
  std::size_t index = 0;  ///< a value at which the fault shows
};

/// Whether `labels` is a DBSCAN labelling of `values`; distances are differences as rounded in Scalar, as in `dbscan`.
template <typename Scalar>
DbscanVerdict verify_dbscan(span<const Scalar> values, const DbscanOptions& options, span<const int> labels,
                            const DbscanVerifierOptions& strictness = {}) {
  const std::size_t n = values.size();
  if (labels.size() != n) return {DbscanFault::label_count, 0};
  const Scalar eps = detail::radius<Scalar>(options.eps);
  const auto distance = [&](std::size_t a, std::size_t b) {
    return values[a] < values[b] ? values[b] - values[a] : values[a] - values[b];
  };
  const auto near = [&](std::size_t a, std::size_t b) {
    return is_finite(values[a]) && is_finite(values[b]) && distance(a, b) <= eps;
  };

  std::vector<char> core(n, 0);
  for (std::size_t i = 0; i < n; ++i) {
    std::size_t count = 0;
    for (std::size_t j = 0; j < n; ++j) count += near(i, j) ? 1U : 0U;
    core[i] = count >= options.min_pts && is_finite(values[i]) ? 1 : 0;
  }
  // The true component of every core point, by flooding.
  std::vector<std::size_t> component(n, n), front;
  for (std::size_t seed = 0; seed < n; ++seed) {
    if (core[seed] == 0 || component[seed] != n) continue;
    component[seed] = seed;
    front.assign(1, seed);
    while (!front.empty()) {
      const std::size_t at = front.back();
      front.pop_back();
      for (std::size_t j = 0; j < n; ++j) {
        if (core[j] == 0 || component[j] != n || !near(at, j)) continue;
        component[j] = seed;
        front.push_back(j);
      }
    }
  }

  DbscanVerdict verdict;
  const auto report = [&verdict](DbscanFault fault, std::size_t at) {
    if (verdict.fault == DbscanFault::none || fault < verdict.fault) verdict = {fault, at};
  };
  for (std::size_t i = 0; i < n; ++i) {
    if (!is_finite(values[i])) {
      if (labels[i] != dbscan_noise) report(DbscanFault::invalid_labelled, i);
      continue;
    }
    if (core[i] != 0) {
      if (labels[i] < 0) report(DbscanFault::core_is_noise, i);
      for (std::size_t j = 0; j < i; ++j) {
        if (core[j] == 0) continue;
        if (component[i] == component[j] && labels[i] != labels[j]) report(DbscanFault::cluster_torn, i);
        if (component[i] != component[j] && labels[i] == labels[j]) report(DbscanFault::clusters_joined, i);
        if (strictness.ascending_numbers && values[j] < values[i] && labels[j] > labels[i])
          report(DbscanFault::numbering, i);
        if (strictness.ascending_numbers && values[i] < values[j] && labels[i] > labels[j])
          report(DbscanFault::numbering, i);
      }
      continue;
    }
    std::size_t nearest = n;
    bool own = false;
    for (std::size_t j = 0; j < n; ++j) {
      if (core[j] == 0 || !near(i, j)) continue;
      own = own || labels[j] == labels[i];
      const bool better = nearest == n || distance(i, j) < distance(i, nearest) ||
                          (distance(i, j) == distance(i, nearest) && values[j] < values[nearest]);
      if (better) nearest = j;
    }
    if (nearest == n) {
      if (labels[i] != dbscan_noise) report(DbscanFault::noise_labelled, i);
    } else if (labels[i] == dbscan_noise) {
      report(DbscanFault::border_is_noise, i);
    } else if (!own) {
      report(DbscanFault::border_foreign, i);
    } else if (strictness.nearest_border && labels[i] != labels[nearest]) {
      report(DbscanFault::border_not_nearest, i);
    }
  }
  if (strictness.ascending_numbers) {
    std::vector<char> used;
    for (std::size_t i = 0; i < n; ++i) {
      if (labels[i] < 0) continue;
      const std::size_t label = static_cast<std::size_t>(labels[i]);
      if (label >= n) {
        report(DbscanFault::numbering, i);
        continue;
      }
      if (label >= used.size()) used.resize(label + 1, 0);
      used[label] = 1;
    }
    for (const char seen : used) {
      if (seen == 0) report(DbscanFault::numbering, 0);
    }
  }
  return verdict;
}

}  // namespace cfp
