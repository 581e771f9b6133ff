/// @file bundle_order_impl.hpp
/// Inside bundle_adjustment.hpp: sorts the usable observations by pose for the linearisation and gives each its slot
/// for the elimination. Linear in the observations.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "cfp/optimization/bundle/bundle_index_impl.hpp"

namespace cfp::detail {

/// Up to so many free poses the caller's order is kept: any fill is cheap there.
inline constexpr std::size_t natural_order_limit = 64;

inline namespace CFP_ISA {

/// Sorts `order` stably by key(i) in [0, groups): group g is sorted[begin[g]], …, sorted[begin[g + 1] - 1].
template <typename Key>
void group_by(const std::vector<int>& order, std::size_t groups, const Key& key, std::vector<std::size_t>& begin,
              std::vector<int>& sorted) {
  begin.assign(groups + 2, 0);
  for (const int i : order) ++begin[to_index(key(i)) + 2];
  for (std::size_t g = 2; g < begin.size(); ++g) begin[g] += begin[g - 1];
  sorted.resize(order.size());
  for (const int i : order) sorted[begin[to_index(key(i)) + 1]++] = i;
}

inline void count_up(std::size_t n, std::vector<int>& order) {
  order.resize(n);
  for (std::size_t i = 0; i < n; ++i) order[i] = static_cast<int>(i);
}

/// Renumbers the free poses so that those with common points get near numbers: breadth first from a pose far from the
/// others, the last one first (Cuthill, McKee 1969), which keeps the envelope of the reduced system small.
inline void order_poses(BundleIndex& index) {
  const auto pose_of = [&](int i) { return index.kept[to_index(i)].pose; };
  const auto point_of = [&](int i) { return index.kept[to_index(i)].point; };
  count_up(index.kept.size(), index.order);
  group_by(index.order, index.caller_pose.size(), pose_of, index.pose_begin, index.by_pose);
  group_by(index.order, index.points, point_of, index.point_begin, index.by_point);
  std::vector<int>&queue = index.order, &seeds = index.pose_number;
  count_up(index.free_poses, seeds);
  for (int sweep = 0; sweep < 2; ++sweep, queue.swap(seeds)) {  // the first ends at a pose to begin from
    index.is_met.assign(index.free_poses + index.points, 0);
    queue.clear();
    const auto meet = [&](std::size_t k) {
      if (k < index.free_poses && index.is_met[k] == 0) index.is_met[k] = 1, queue.push_back(static_cast<int>(k));
    };
    std::size_t head = 0;
    for (std::size_t seed = seeds.size(); seed-- > 0;) {
      meet(to_index(seeds[seed]));
      for (; head < queue.size(); ++head) {
        const std::size_t k = to_index(queue[head]);
        for (std::size_t o = index.pose_begin[k]; o < index.pose_begin[k + 1]; ++o) {
          const std::size_t j = to_index(point_of(index.by_pose[o]));
          if (index.is_met[index.free_poses + j] != 0) continue;
          index.is_met[index.free_poses + j] = 1;
          for (std::size_t i = index.point_begin[j]; i < index.point_begin[j + 1]; ++i)
            meet(to_index(pose_of(index.by_point[i])));
        }
      }
    }
  }
  queue = index.caller_pose;  // the old numbers' poses
  index.by_pose.resize(queue.size());
  count_up(queue.size(), index.by_pose);  // the old numbers' new ones
  for (std::size_t k = 0; k < index.free_poses; ++k) {
    const std::size_t old = to_index(seeds[index.free_poses - 1 - k]);
    index.caller_pose[k] = queue[old];
    index.by_pose[old] = static_cast<int>(k);
  }
  for (BundleMeasurement& m : index.kept) m.pose = index.by_pose[to_index(m.pose)];
}

/// Slots by what is eliminated and what is kept; then the observations by pose and kind, in each range by point, so
/// that neighbours in memory stay neighbours.
inline void sort_observations(BundleIndex& index) {
  const std::size_t n = index.kept.size(), poses = index.caller_pose.size();
  const auto pose_of = [&](int i) { return index.kept[to_index(i)].pose; };
  const auto point_of = [&](int i) { return index.kept[to_index(i)].point; };
  count_up(n, index.order);
  if (index.eliminate_poses) {
    group_by(index.order, index.points, point_of, index.slot_begin, index.by_point);
    group_by(index.by_point, poses, pose_of, index.slot_begin, index.order);
  } else {
    group_by(index.order, poses, pose_of, index.slot_begin, index.by_pose);
    group_by(index.by_pose, index.points, point_of, index.slot_begin, index.order);
  }
  index.slot_pose.resize(n), index.slot_point.resize(n);
  for (std::size_t s = 0; s < n; ++s) {
    BundleMeasurement& m = index.kept[to_index(index.order[s])];
    m.slot = s;
    index.slot_pose[s] = m.pose, index.slot_point[s] = m.point;
  }
  const auto range_of = [&](int i) { return 2 * pose_of(i) + (index.kept[to_index(i)].stereo ? 1 : 0); };
  group_by(index.order, 2 * poses, range_of, index.range_begin, index.by_pose);
  index.observations.resize(n);
  for (std::size_t o = 0; o < n; ++o) index.observations[o] = index.kept[to_index(index.by_pose[o])];
}

/// Cuts `count` groups, of which number i begins at begin[stride i], into parts of about equal size.
inline std::array<std::size_t, bundle_parts + 1> cut_into_parts(const std::vector<std::size_t>& begin,
                                                                std::size_t count, std::size_t stride) noexcept {
  std::array<std::size_t, bundle_parts + 1> part{};
  std::size_t i = 0;
  for (std::size_t p = 1; p < part.size(); part[p++] = i) {
    while (i < count && (p == bundle_parts || begin[stride * i] * bundle_parts < begin[stride * count] * p)) ++i;
  }
  return part;
}

template <typename Camera, typename Scalar>
void build_index(const BundleProblem<Camera, Scalar>& problem, BundleIndex& index, BundleResult& result) {
  select_observations(problem, index, result);
  number_poses_and_points(problem.fixed_poses, index);
  index.eliminate_poses =
      4 * index.points < index.free_poses;  // the points' system has less than an eighth of the rows
  if (!index.eliminate_poses && index.free_poses > natural_order_limit) order_poses(index);
  sort_observations(index);
  index.pose_part = cut_into_parts(index.range_begin, index.caller_pose.size(), 2);
  index.eliminated_part = cut_into_parts(index.slot_begin, index.eliminate_poses ? index.free_poses : index.points, 1);
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
