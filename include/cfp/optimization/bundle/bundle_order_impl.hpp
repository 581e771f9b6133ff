/// @file bundle_order_impl.hpp
/// Inside bundle_adjustment.hpp: sorts the usable observations by pose for the linearisation and gives each its slot
/// for the elimination. Linear in the observations.
#pragma once

#include <algorithm>
#include <array>
#include <numeric>
#include <vector>

#include "cfp/optimization/bundle/bundle_index_impl.hpp"

namespace cfp::detail {

/// Up to so many free poses the caller's order is kept: any fill is cheap there.
inline constexpr std::size_t natural_order_limit = 64;

inline namespace CFP_ISA {

/// Sorts `from` stably by key(measurement) in [0, groups): group g is to[begin[g]], …, to[begin[g + 1] - 1].
template <typename Key, typename Link>
void group_by(const std::vector<BundleMeasurement>& from, std::size_t groups, const Key& key,
              std::vector<std::size_t>& begin, std::vector<Link>& to) {
  begin.assign(groups + 2, 0);
  for (const BundleMeasurement& m : from) ++begin[to_index(key(m)) + 2];
  for (std::size_t g = 2; g < begin.size(); ++g) begin[g] += begin[g - 1];
  to.resize(from.size());
  for (const BundleMeasurement& m : from) to[begin[to_index(key(m)) + 1]++] = m;
}
[[nodiscard]] inline int pose_of(const BundleMeasurement& m) noexcept { return m.pose; }
[[nodiscard]] inline int point_of(const BundleMeasurement& m) noexcept { return m.point; }

/// Renumbers the free poses so that those with common points get near numbers: breadth first from a pose far from the
/// others, the last one first (Cuthill, McKee 1969), which keeps the envelope of the reduced system small.
inline void order_poses(BundleIndex& index) {
  group_by(index.kept, index.caller_pose.size(), pose_of, index.range_begin, index.observations);
  group_by(index.kept, index.points, point_of, index.slot_begin, index.slots);
  std::vector<int>&queue = index.order, &seeds = index.pose_number;
  seeds.resize(index.free_poses);
  std::iota(seeds.begin(), seeds.end(), 0);
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
        for (std::size_t o = index.range_begin[k]; o < index.range_begin[k + 1]; ++o) {
          const std::size_t j = to_index(index.observations[o].point);
          if (index.is_met[index.free_poses + j] != 0) continue;
          index.is_met[index.free_poses + j] = 1;
          for (std::size_t s = index.slot_begin[j]; s < index.slot_begin[j + 1]; ++s)
            meet(to_index(index.slots[s].pose));
        }
      }
    }
  }
  std::reverse(seeds.begin(), seeds.end());
  for (std::size_t k = 0; k < index.free_poses; ++k) {
    queue[to_index(seeds[k])] = static_cast<int>(k);  // the new number of an old one
    seeds[k] = index.caller_pose[to_index(seeds[k])];
  }
  std::copy(seeds.begin(), seeds.end(), index.caller_pose.begin());
  for (BundleMeasurement& m : index.kept) {
    if (to_index(m.pose) < index.free_poses) m.pose = queue[to_index(m.pose)];
  }
}

/// Slots by what is eliminated and what is kept; then the observations by pose and kind, in each range by point, so
/// that neighbours in memory stay neighbours.
inline void sort_observations(BundleIndex& index) {
  const std::size_t poses = index.caller_pose.size();
  const auto eliminated = [&](const BundleMeasurement& m) { return index.eliminate_poses ? m.pose : m.point; };
  const auto kept = [&](const BundleMeasurement& m) { return index.eliminate_poses ? m.point : m.pose; };
  group_by(index.kept, index.eliminate_poses ? index.points : poses, kept, index.slot_begin, index.observations);
  group_by(index.observations, index.eliminate_poses ? poses : index.points, eliminated, index.slot_begin, index.kept);
  index.slots.resize(index.kept.size());
  for (std::size_t s = 0; s < index.slots.size(); ++s) index.kept[s].slot = s, index.slots[s] = index.kept[s];
  const auto range_of = [](const BundleMeasurement& m) { return 2 * m.pose + (m.stereo ? 1 : 0); };
  group_by(index.kept, 2 * poses, range_of, index.range_begin, index.observations);
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
