/// @file trajectory_coverage.hpp
/// How much of a recording an estimated trajectory covers: what a reader needs beside every error.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "cfp/core/span.hpp"
#include "cfp/evaluation/trajectory.hpp"

namespace cfp {

struct TrajectoryCoverage {
  std::size_t matched = 0;   ///< estimated poses that entered the error
  std::size_t expected = 0;  ///< frames the estimate should have
  std::size_t unusable = 0;  ///< estimated poses dropped: not finite, no rotation, or a stamp that comes again
  double pose_fraction = 0;  ///< matched / expected, in [0, 1]
  double time_fraction = 0;  ///< time from the first to the last matched pose / from the first to the last true one
  double largest_gap_s = 0;  ///< between neighbouring matched poses
  double largest_stamp_difference_s = 0;  ///< between a matched pose and its truth
};

inline namespace CFP_ISA {

/// Coverage of the matches (first = truth, second = estimate), which are in order of time; the orders are those of
/// time_order. expected_poses 0 stands for all usable estimated poses. Without a match all fractions and times are 0;
/// times saturate at the largest double. O(matches), allocates nothing.
template <typename Truth, typename Estimate>
[[nodiscard]] TrajectoryCoverage trajectory_coverage(const Truth& truth, const Estimate& estimate,
                                                     span<const std::size_t> truth_order,
                                                     span<const std::size_t> estimate_order,
                                                     span<const TimeMatch> matches, std::size_t expected_poses,
                                                     double offset_s) noexcept {
  TrajectoryCoverage coverage;
  coverage.matched = matches.size();
  coverage.expected = expected_poses > 0 ? expected_poses : estimate_order.size();
  coverage.unusable = estimate.size() - estimate_order.size();
  if (matches.empty()) return coverage;
  const auto longer = [](double a, double b) {
    return (std::max)(a, (std::min)(b, (std::numeric_limits<double>::max)()));
  };
  coverage.pose_fraction =
      clamp_probability(static_cast<double>(coverage.matched) / static_cast<double>(coverage.expected));
  const double whole_s = truth[truth_order[truth_order.size() - 1]].time_s - truth[truth_order[0]].time_s;
  const double covered_s = estimate[matches[matches.size() - 1].second].time_s - estimate[matches[0].second].time_s;
  coverage.time_fraction = whole_s > 0 ? clamp_probability(covered_s / whole_s) : 1;
  for (std::size_t k = 0; k < matches.size(); ++k) {
    const double time_s = estimate[matches[k].second].time_s;
    if (k > 0) coverage.largest_gap_s = longer(coverage.largest_gap_s, time_s - estimate[matches[k - 1].second].time_s);
    coverage.largest_stamp_difference_s =
        longer(coverage.largest_stamp_difference_s, std::abs(truth[matches[k].first].time_s - (time_s + offset_s)));
  }
  return coverage;
}

}  // namespace CFP_ISA
}  // namespace cfp
