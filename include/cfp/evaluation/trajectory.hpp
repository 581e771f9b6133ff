/// @file trajectory.hpp
/// Stamped poses and their association by time: the common ground of the trajectory errors. Trajectories may come
/// unsorted, with duplicates and with broken poses; nothing has to be cleaned before.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "cfp/core/options.hpp"
#include "cfp/core/span.hpp"
#include "cfp/math/matrix3.hpp"
#include "cfp/math/se3.hpp"

namespace cfp {

/// A camera pose with its time. The time is a double for every Scalar: Unix seconds with microseconds need 51 bits.
template <typename Scalar>
struct StampedPose {
  double time_s = 0;
  SE3<Scalar> T_world_cam;  ///< camera to world, as in TUM trajectory files
};

inline namespace CFP_ISA {

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
template <typename Scalar>
void time_order(span<const StampedPose<Scalar>> poses, std::vector<std::size_t>& order) {
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

}  // namespace CFP_ISA

struct AssociationOptions {
  /// two stamps match when they differ by less than this, > 0 (the TUM scripts' default)
  double max_difference_s = 0.02;
  double offset_s = 0;  ///< added to the stamps of the second trajectory, finite
};

inline namespace CFP_ISA {

[[nodiscard]] inline OptionPath invalid_field(const AssociationOptions& options) noexcept {
  if (!(options.max_difference_s > 0)) return "max_difference_s";
  if (!is_finite(options.offset_s)) return "offset_s";
  return {};
}

}  // namespace CFP_ISA

/// Indices into the two trajectories.
struct TimeMatch {
  std::size_t first = 0;
  std::size_t second = 0;
};

struct AssociationWorkspace {
  struct Event {
    double time_s;
    std::size_t pose;
    bool of_second;
    std::size_t previous, next;  // neighbours among the events that are still free; none = their number
  };
  struct Candidate {
    double difference_s, first_s, second_s;
    std::size_t left, right;  // events
  };
  std::vector<std::size_t> first_order, second_order;
  std::vector<Event> events;
  std::vector<Candidate> heap;
};

inline namespace CFP_ISA {

/// One-to-one association as in the TUM script associate.py: the pair of free stamps with the smallest |first − (second
/// + offset)| is matched first, ties go to the earlier first stamp and then to the earlier second one, until no pair
/// differs by less than max_difference_s. matches come out in order of time. The script forms all pairs; here only
/// neighbours in the merged order are candidates (the closest free pair is always one), so it costs O(n log n) whatever
/// the options. workspace.first_order and .second_order hold time_order of the inputs afterwards.
template <typename Scalar>
void associate(span<const StampedPose<Scalar>> first, span<const StampedPose<Scalar>> second,
               const AssociationOptions& options, AssociationWorkspace& workspace, std::vector<TimeMatch>& matches) {
  matches.clear();
  time_order(first, workspace.first_order);
  time_order(second, workspace.second_order);
  auto& events = workspace.events;
  auto& heap = workspace.heap;
  events.clear();
  heap.clear();
  for (const std::size_t i : workspace.first_order) events.push_back({first[i].time_s, i, false, 0, 0});
  for (const std::size_t i : workspace.second_order)
    events.push_back({second[i].time_s + options.offset_s, i, true, 0, 0});
  std::sort(events.begin(), events.end(), [](const auto& a, const auto& b) {
    return a.time_s < b.time_s ||
           (a.time_s == b.time_s && std::make_pair(a.of_second, a.pose) < std::make_pair(b.of_second, b.pose));
  });
  const std::size_t none = events.size();
  for (std::size_t e = 0; e < none; ++e) {
    events[e].previous = e == 0 ? none : e - 1;
    events[e].next = e + 1;
  }
  const auto later = [](const auto& a, const auto& b) {
    if (a.difference_s != b.difference_s) return a.difference_s > b.difference_s;
    return a.first_s != b.first_s ? a.first_s > b.first_s : a.second_s > b.second_s;
  };
  const auto consider = [&](std::size_t left, std::size_t right) {
    if (left == none || right == none || events[left].of_second == events[right].of_second) return;
    const double difference = std::abs(events[right].time_s - events[left].time_s);
    if (!(difference < options.max_difference_s)) return;
    const std::size_t of_first = events[left].of_second ? right : left;
    heap.push_back({difference, events[of_first].time_s, events[left + right - of_first].time_s, left, right});
    std::push_heap(heap.begin(), heap.end(), later);
  };
  for (std::size_t e = 0; e + 1 < none; ++e) consider(e, e + 1);
  while (!heap.empty()) {
    std::pop_heap(heap.begin(), heap.end(), later);
    const auto best = heap.back();
    heap.pop_back();
    auto& left = events[best.left];
    auto& right = events[best.right];
    if (left.next != best.right || right.previous != best.left) continue;  // one of them is taken already
    const auto& of_first = left.of_second ? right : left;
    matches.push_back({of_first.pose, (left.of_second ? left : right).pose});
    const std::size_t before = left.previous;
    const std::size_t after = right.next;
    left.next = right.previous = none + 1;
    if (before != none) events[before].next = after;
    if (after != none) events[after].previous = before;
    consider(before, after);
  }
  std::sort(matches.begin(), matches.end(),
            [&](const TimeMatch& a, const TimeMatch& b) { return first[a.first].time_s < first[b.first].time_s; });
}

}  // namespace CFP_ISA

}  // namespace cfp
