/// @file trajectory.hpp
/// Stamped poses, their association by time and its coverage: shared by the trajectory errors. Trajectories may come
/// unsorted, with duplicates and with broken poses; nothing has to be cleaned before. A trajectory is any array of
/// StampedPose with size() and []: a std::vector, a span.
#pragma once

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>
#include <vector>

#include "cfp/core/options.hpp"
#include "cfp/evaluation/error_statistics.hpp"
#include "cfp/math/matrix3.hpp"
#include "cfp/math/se3.hpp"

namespace cfp {

/// A camera pose with its time. The time is a double for every Scalar: Unix seconds with microseconds need 51 bits.
template <typename Scalar>
struct StampedPose {
  double time_s = 0;
  SE3<Scalar> T_world_cam;  ///< camera to world, as in TUM trajectory files
};

struct AssociationOptions {
  /// two stamps match when they differ by less than this, > 0 (the TUM scripts' default)
  double max_difference_s = 0.02;
  double offset_s = 0;  ///< added to the stamps of the second trajectory, finite
};

/// Indices into the two trajectories.
struct TimeMatch {
  std::size_t first = 0;
  std::size_t second = 0;
};

/// How much of a recording an estimated trajectory covers: what a reader needs beside every error.
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

[[nodiscard]] inline OptionPath invalid_field(const AssociationOptions& options) noexcept {
  if (!(options.max_difference_s > 0)) return "max_difference_s";
  if (!is_finite(options.offset_s)) return "offset_s";
  return {};
}

/// Finite stamp, finite translation, and a rotation matrix whose determinant is about one (0.5 to 2: printed
/// quaternions are rounded, and an all-zero one, the TUM files' "no pose", must fail).
template <typename Scalar>
[[nodiscard]] bool is_usable(const StampedPose<Scalar>& pose) noexcept {
  const SE3<Scalar>& T = pose.T_world_cam;
  const Scalar volume = determinant(T.rotation);
  return is_finite(pose.time_s) && T.translation.allFinite() && volume > Scalar(0.5) && volume < Scalar(2) &&
         T.rotation.squaredNorm() < Scalar(12);
}

/// Indices of the usable poses in order of time; of several with one stamp the last in the array stays, as in the
/// dictionaries of the TUM scripts. O(n log n).
template <typename Poses>
[[nodiscard]] std::vector<std::size_t> time_order(const Poses& poses) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (is_usable(poses[i])) order.push_back(i);
  }
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return poses[a].time_s < poses[b].time_s || (poses[a].time_s == poses[b].time_s && a > b);
  });
  order.erase(std::unique(order.begin(), order.end(),
                          [&](std::size_t a, std::size_t b) { return poses[a].time_s == poses[b].time_s; }),
              order.end());
  return order;
}

/// One-to-one association as in the TUM script associate.py: the pair of free stamps with the smallest |first − (second
/// + offset)| is matched first, ties go to the earlier first stamp and then to the earlier second one, until no pair
/// differs by less than max_difference_s. Matches come in order of the first stamp. O(n log n) in the poses and in the
/// pairs that differ by less than max_difference_s.
template <typename First, typename Second>
[[nodiscard]] std::vector<TimeMatch> associate(const First& first, const Second& second,
                                               const AssociationOptions& options = {}) {
  const std::vector<std::size_t> first_order = time_order(first), second_order = time_order(second);
  const auto second_time = [&](std::size_t j) { return second[second_order[j]].time_s + options.offset_s; };
  std::vector<std::tuple<double, std::size_t, std::size_t>> candidates;  // difference, positions in the orders
  for (std::size_t i = 0, begin = 0; i < first_order.size(); ++i) {
    const double time = first[first_order[i]].time_s;
    while (begin < second_order.size() && time - second_time(begin) >= options.max_difference_s) ++begin;
    for (std::size_t j = begin; j < second_order.size() && second_time(j) - time < options.max_difference_s; ++j)
      candidates.emplace_back(std::abs(time - second_time(j)), i, j);
  }
  std::sort(candidates.begin(), candidates.end());
  std::vector<char> first_taken(first_order.size()), second_taken(second_order.size());
  std::vector<TimeMatch> matches;
  for (const auto& [difference_s, i, j] : candidates) {
    if (first_taken[i] != 0 || second_taken[j] != 0) continue;
    first_taken[i] = second_taken[j] = 1;
    matches.push_back({first_order[i], second_order[j]});
  }
  std::sort(matches.begin(), matches.end(),
            [&](const TimeMatch& a, const TimeMatch& b) { return first[a.first].time_s < first[b.first].time_s; });
  return matches;
}

/// Coverage of the matches (first = truth, second = estimate), which are in order of the estimate's stamps.
/// expected_poses 0 stands for all usable estimated poses. Without a match all fractions and times are 0; times
/// saturate at the largest double. O(n log n).
template <typename Truth, typename Estimate>
[[nodiscard]] TrajectoryCoverage trajectory_coverage(const Truth& truth, const Estimate& estimate,
                                                     const std::vector<TimeMatch>& matches, std::size_t expected_poses,
                                                     double offset_s) {
  const std::vector<std::size_t> truth_order = time_order(truth), estimate_order = time_order(estimate);
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
  const double whole_s = truth[truth_order.back()].time_s - truth[truth_order.front()].time_s;
  const double covered_s = estimate[matches.back().second].time_s - estimate[matches.front().second].time_s;
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

namespace detail {
inline namespace CFP_ISA {

/// find_closest_index of evaluate_rpe.py over the ascending values value(0), …, value(n − 1), n > 0: a bisection that
/// remembers the nearest value it met. Of two equally near it returns the one it met first, which no simpler search
/// would.
template <typename Value>
std::size_t closest_index(std::size_t n, double target, const Value& value) noexcept {
  std::size_t begin = 0, end = n, best = 0;
  double difference = std::abs(value(0) - target);
  while (begin < end) {
    const std::size_t middle = (begin + end) / 2;
    if (std::abs(value(middle) - target) < difference) {
      difference = std::abs(value(middle) - target);
      best = middle;
    }
    if (value(middle) > target) {
      end = middle;
    } else {
      begin = middle + 1;
    }
  }
  return best;
}

template <typename Scalar>
SE3<double> double_pose(const StampedPose<Scalar>& pose) noexcept {
  const SE3<double> T = pose.T_world_cam.template cast<double>();
  return {normalized_rotation<double>(T.rotation), T.translation};
}

/// Median time between neighbours (numpy.median); 0 below two poses.
template <typename Poses>
double median_interval(const Poses& poses, const std::vector<std::size_t>& order) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < order.size(); ++i) {
    intervals.push_back(
        (std::min)(poses[order[i]].time_s - poses[order[i - 1]].time_s, (std::numeric_limits<double>::max)()));
  }
  return error_statistics(std::move(intervals)).median;
}

/// One more of PoseErrors: the length of a translation, the largest double where it overflows, and a rotation's angle.
template <typename Errors>  // so that an evaluation that is not called is not compiled
void add_error(std::size_t index, const Vector3<double>& translation, const Matrix3<double>& rotation, Errors& errors) {
  const double length = std::hypot(translation[0], translation[1], translation[2]);
  errors.pose.push_back(index);
  errors.translation_m.push_back((std::min)((std::numeric_limits<double>::max)(), length));
  errors.rotation_deg.push_back(so3_log(rotation).norm() * 180 / pi<double>);
}

}  // namespace CFP_ISA
}  // namespace detail
}  // namespace cfp
