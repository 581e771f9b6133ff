/// @file dbscan_verifier.hpp
/// Checks a DBSCAN labelling of scalar values against the definition, whoever made it. For tests: O(n^2), allocates.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cfp/clustering/dbscan.hpp"
#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"

namespace cfp_testing {

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

namespace detail {

// The definition, by comparing every value with every other one.
template <typename Scalar>
struct DbscanOracle {
  cfp::span<const Scalar> values;
  Scalar eps;
  std::vector<char> core;
  std::vector<std::size_t> component;  // of core points: equal for density-connected ones

  DbscanOracle(cfp::span<const Scalar> v, const cfp::DbscanOptions& options)
      : values(v), eps(cfp::detail::radius<Scalar>(options.eps)), core(v.size(), 0), component(v.size()) {
    const std::size_t n = values.size();
    for (std::size_t i = 0; i < n; ++i) {
      std::size_t count = 0;
      for (std::size_t j = 0; j < n; ++j) count += near(i, j) ? 1U : 0U;
      core[i] = count >= options.min_pts && cfp::is_finite(values[i]) ? 1 : 0;
      component[i] = i;
    }
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        if (core[i] == 0 || core[j] == 0 || component[i] == component[j] || !near(i, j)) continue;
        std::replace(component.begin(), component.end(), std::size_t(component[i]), std::size_t(component[j]));
      }
    }
  }
  [[nodiscard]] Scalar distance(std::size_t a, std::size_t b) const {
    return values[a] < values[b] ? values[b] - values[a] : values[a] - values[b];
  }
  [[nodiscard]] bool near(std::size_t a, std::size_t b) const {
    return cfp::is_finite(values[a]) && cfp::is_finite(values[b]) && distance(a, b) <= eps;
  }
};

template <typename Scalar>
DbscanFault fault_of_core(const DbscanOracle<Scalar>& oracle, cfp::span<const int> labels, std::size_t i,
                          bool ordered) {
  if (labels[i] < 0) return DbscanFault::core_is_noise;
  DbscanFault worst = DbscanFault::none;
  const auto report = [&worst](DbscanFault fault) {
    worst = worst == DbscanFault::none || fault < worst ? fault : worst;
  };
  for (std::size_t j = 0; j < labels.size(); ++j) {
    if (oracle.core[j] == 0) continue;
    const bool same = oracle.component[i] == oracle.component[j];
    if (same && labels[i] != labels[j]) report(DbscanFault::cluster_torn);
    if (!same && labels[i] == labels[j]) report(DbscanFault::clusters_joined);
    if (ordered && oracle.values[j] < oracle.values[i] && labels[j] > labels[i]) report(DbscanFault::numbering);
  }
  return worst;
}

template <typename Scalar>
DbscanFault fault_of_other(const DbscanOracle<Scalar>& oracle, cfp::span<const int> labels, std::size_t i,
                           bool to_nearest) {
  const std::size_t n = labels.size();
  std::size_t nearest = n;
  bool own = false;
  for (std::size_t j = 0; j < n; ++j) {
    if (oracle.core[j] == 0 || !oracle.near(i, j)) continue;
    own = own || labels[j] == labels[i];
    const bool better =
        nearest == n || oracle.distance(i, j) < oracle.distance(i, nearest) ||
        (oracle.distance(i, j) == oracle.distance(i, nearest) && oracle.values[j] < oracle.values[nearest]);
    if (better) nearest = j;
  }
  if (nearest == n) return labels[i] != cfp::dbscan_noise ? DbscanFault::noise_labelled : DbscanFault::none;
  if (labels[i] == cfp::dbscan_noise) return DbscanFault::border_is_noise;
  if (!own) return DbscanFault::border_foreign;
  return to_nearest && labels[i] != labels[nearest] ? DbscanFault::border_not_nearest : DbscanFault::none;
}

}  // namespace detail

/// Whether `labels` is a DBSCAN labelling of `values` (any contiguous container of float or double); distances are
/// differences as rounded in the values' type, as in `dbscan`.
template <typename Values>
[[nodiscard]] DbscanVerdict verify_dbscan(const Values& values, const cfp::DbscanOptions& options,
                                          cfp::span<const int> labels, const DbscanVerifierOptions& strictness = {}) {
  using Scalar = cfp::range_value_t<Values>;
  if (labels.size() != values.size()) return {DbscanFault::label_count, 0};
  const detail::DbscanOracle<Scalar> oracle(values, options);
  DbscanVerdict verdict;
  const auto report = [&verdict](DbscanFault fault, std::size_t at) {
    if (fault != DbscanFault::none && (verdict.fault == DbscanFault::none || fault < verdict.fault))
      verdict = {fault, at};
  };
  int highest = cfp::dbscan_noise;
  for (std::size_t i = 0; i < labels.size(); ++i) {
    highest = (std::max)(highest, labels[i]);
    if (oracle.core[i] != 0) {
      report(detail::fault_of_core(oracle, labels, i, strictness.ascending_numbers), i);
    } else if (cfp::is_finite(oracle.values[i])) {
      report(detail::fault_of_other(oracle, labels, i, strictness.nearest_border), i);
    } else if (labels[i] != cfp::dbscan_noise) {
      report(DbscanFault::invalid_labelled, i);
    }
  }
  for (int label = 0; strictness.ascending_numbers && label < highest; ++label) {
    if (std::find(labels.begin(), labels.end(), label) != labels.end()) continue;
    report(DbscanFault::numbering, 0);
    break;
  }
  return verdict;
}

}  // namespace cfp_testing
