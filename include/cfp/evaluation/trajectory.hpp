/// @file trajectory.hpp
/// Stamped poses and their association by time: the common ground of the trajectory errors. Trajectories may come
/// unsorted, with duplicates and with broken poses; nothing has to be cleaned before. A trajectory is any array of
/// StampedPose with size() and []: a std::vector, a span.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <tuple>
#include <vector>

#include "cfp/core/options.hpp"
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

struct AssociationWorkspace {
  struct Candidate {
    double difference_s;
    std::size_t first, second;  // positions in the orders
  };
  std::vector<std::size_t> first_order, second_order;
  std::vector<Candidate> candidates;
  std::vector<char> first_taken, second_taken;
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
  const Matrix3<Scalar>& R = pose.T_world_cam.rotation;
  const Scalar volume = determinant(R);
  const Vector3<Scalar>& t = pose.T_world_cam.translation;
  return is_finite(pose.time_s) && is_finite(t.x()) && is_finite(t.y()) && is_finite(t.z()) && volume > Scalar(0.5) &&
         volume < Scalar(2) && R.squaredNorm() < Scalar(12);
}

/// Indices of the usable poses in order of time; of several with one stamp the last in the array stays, as in the
/// dictionaries of the TUM scripts. O(n log n). order is overwritten; it grows on first use only.
template <typename Poses>
void time_order(const Poses& poses, std::vector<std::size_t>& order) {
  order.clear();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (is_usable(poses[i])) order.push_back(i);
  }
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return poses[a].time_s < poses[b].time_s || (poses[a].time_s == poses[b].time_s && a > b);
  });
  order.erase(std::unique(order.begin(), order.end(),
                          [&](std::size_t a, std::size_t b) { return poses[a].time_s == poses[b].time_s; }),
              order.end());
}

/// One-to-one association as in the TUM script associate.py: the pair of free stamps with the smallest |first − (second
/// + offset)| is matched first, ties go to the earlier first stamp and then to the earlier second one, until no pair
/// differs by less than max_difference_s. matches come out in order of time. O(n log n) in the poses and in the pairs
/// that differ by less than max_difference_s. workspace.first_order and .second_order hold time_order of the inputs
/// afterwards.
template <typename First, typename Second>
void associate(const First& first, const Second& second, const AssociationOptions& options,
               AssociationWorkspace& workspace, std::vector<TimeMatch>& matches) {
  const auto &first_order = workspace.first_order, &second_order = workspace.second_order;
  time_order(first, workspace.first_order);
  time_order(second, workspace.second_order);
  const auto second_time = [&](std::size_t j) { return second[second_order[j]].time_s + options.offset_s; };
  workspace.candidates.clear();
  for (std::size_t i = 0, begin = 0; i < first_order.size(); ++i) {
    const double time = first[first_order[i]].time_s;
    const auto is_near = [&](std::size_t j) { return std::abs(time - second_time(j)) < options.max_difference_s; };
    while (begin < second_order.size() && second_time(begin) < time && !is_near(begin)) ++begin;
    for (std::size_t j = begin; j < second_order.size() && (second_time(j) < time || is_near(j)); ++j) {
      if (is_near(j)) workspace.candidates.push_back({std::abs(time - second_time(j)), i, j});
    }
  }
  std::sort(workspace.candidates.begin(), workspace.candidates.end(), [](const auto& a, const auto& b) {
    return std::tie(a.difference_s, a.first, a.second) < std::tie(b.difference_s, b.first, b.second);
  });
  workspace.first_taken.assign(first_order.size(), 0);
  workspace.second_taken.assign(second_order.size(), 0);
  matches.clear();
  for (const auto& pair : workspace.candidates) {
    if (workspace.first_taken[pair.first] != 0 || workspace.second_taken[pair.second] != 0) continue;
    workspace.first_taken[pair.first] = workspace.second_taken[pair.second] = 1;
    matches.push_back({first_order[pair.first], second_order[pair.second]});
  }
  std::sort(matches.begin(), matches.end(),
            [&](const TimeMatch& a, const TimeMatch& b) { return first[a.first].time_s < first[b.first].time_s; });
}

}  // namespace CFP_ISA
}  // namespace cfp
