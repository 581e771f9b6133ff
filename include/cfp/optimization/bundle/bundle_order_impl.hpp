/// @file bundle_order_impl.hpp
/// Inside bundle_adjustment.hpp: sorts the usable observations by pose for the linearisation, and finds the links
/// between points and poses and the blocks of the reduced system for the elimination. Linear in the observations and in
/// the pairs of poses of one point.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include "cfp/optimization/bundle/bundle_index_impl.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

/// Sorts `order` stably by key(i) in [0, groups): group g is sorted[begin[g]], …, sorted[begin[g + 1] - 1].
template <typename Key>
void group_by(const std::vector<int>& order, std::size_t groups, const Key& key, std::vector<std::size_t>& cursor,
              std::vector<std::size_t>& begin, std::vector<int>& sorted) {
  begin.assign(groups + 1, 0);
  for (const int i : order) ++begin[to_index(key(i)) + 1];
  for (std::size_t g = 0; g < groups; ++g) begin[g + 1] += begin[g];
  cursor.assign(begin.begin(), begin.end() - 1);
  sorted.resize(order.size());
  for (const int i : order) sorted[cursor[to_index(key(i))]++] = i;
}

/// The links by point, poses ascending; by_point holds the observations in this order, link_of their links.
inline void find_links(BundleIndex& index) {
  const std::size_t points = index.caller_point.size();
  index.order.resize(index.kept.size());
  for (std::size_t i = 0; i < index.order.size(); ++i) index.order[i] = static_cast<int>(i);
  group_by(
      index.order, index.caller_pose.size(), [&](int i) { return index.kept[to_index(i)].pose; }, index.cursor,
      index.range_begin, index.by_pose);
  group_by(
      index.by_pose, points, [&](int i) { return index.kept[to_index(i)].point; }, index.cursor, index.link_begin,
      index.by_point);
  index.link_pose.clear();
  index.free_links.assign(points, 0);
  index.link_of.resize(index.kept.size());
  index.most_free_links = 0;
  std::size_t position = 0;
  for (std::size_t j = 0; j < points; ++j) {
    const std::size_t begin = index.link_pose.size();
    for (const std::size_t end = index.link_begin[j + 1]; position < end; ++position) {
      const int pose = index.kept[to_index(index.by_point[position])].pose;
      if (index.link_pose.size() == begin || index.link_pose.back() != pose) {
        index.link_pose.push_back(pose);
        if (pose < index.free_poses) ++index.free_links[j];
      }
      index.link_of[to_index(index.by_point[position])] = static_cast<int>(index.link_pose.size()) - 1;
    }
    index.link_begin[j] = begin;
    index.most_free_links = (std::max)(index.most_free_links, index.free_links[j]);
  }
  index.link_begin[points] = index.link_pose.size();
}

/// The observations by pose and kind, in each range by point, so that neighbours in memory stay neighbours.
inline void sort_by_pose(BundleIndex& index) {
  const std::size_t n = index.kept.size();
  group_by(
      index.by_point, 2 * index.caller_pose.size(),
      [&](int i) { return 2 * index.kept[to_index(i)].pose + (index.kept[to_index(i)].stereo ? 1 : 0); }, index.cursor,
      index.range_begin, index.by_pose);
  for (auto* array : {&index.u, &index.v, &index.disparity, &index.weight, &index.information}) array->resize(n);
  index.point.resize(n), index.link.resize(n), index.repeats.resize(n);
  index.is_met.assign(index.link_pose.size(), 0);
  for (std::size_t o = 0; o < n; ++o) {
    const BundleMeasurement& m = index.kept[to_index(index.by_pose[o])];
    index.u[o] = m.u, index.v[o] = m.v, index.disparity[o] = m.disparity;
    index.weight[o] = m.weight, index.information[o] = m.information;
    index.point[o] = m.point;
    index.link[o] = index.link_of[to_index(index.by_pose[o])];
    index.repeats[o] = index.is_met[to_index(index.link[o])];
    index.is_met[to_index(index.link[o])] = 1;
  }
}

/// The blocks of the reduced system of the poses that some point fills, row after row, and for each pair its block.
inline void find_pose_blocks(BundleIndex& index) {
  const std::size_t points = index.caller_point.size(), free_poses = to_index(index.free_poses);
  for (std::size_t j = 0; j < points; ++j) {
    const std::size_t f = to_index(index.free_links[j]);
    index.pair_begin[j + 1] = index.pair_begin[j] + f * (f + 1) / 2;
  }
  index.pair_block.resize(index.pair_begin[points]);
  index.diagonal_block.resize(free_poses);
  index.last_row.assign(free_poses, -1);  // per column: the last row with a block there, and that block
  index.last_block.resize(free_poses);
  for (int k = 0; k < index.free_poses; ++k) {
    for (std::size_t o = index.range_begin[2 * to_index(k)]; o < index.range_begin[2 * to_index(k) + 2]; ++o) {
      if (index.repeats[o] != 0) continue;
      const std::size_t j = to_index(index.point[o]), first = index.link_begin[j], b = to_index(index.link[o]) - first;
      int* pair = index.pair_block.data() + index.pair_begin[j] + b;
      std::size_t stride = to_index(index.free_links[j]) - 1;
      for (std::size_t a = 0; a <= b; ++a, pair += stride--) {
        const std::size_t column = to_index(index.link_pose[first + a]);
        if (index.last_row[column] != k) {
          index.last_row[column] = k;
          index.last_block[column] = static_cast<int>(index.block_row.size());
          index.block_row.push_back(k);
          index.block_column.push_back(static_cast<int>(column));
        }
        *pair = index.last_block[column];
      }
    }
    index.diagonal_block[to_index(k)] = index.last_block[to_index(k)];
  }
}

/// Cuts poses and points into parts of about equal work.
inline void cut_into_parts(BundleIndex& index) noexcept {
  const auto cut = [](std::array<int, bundle_parts + 1>& part, std::size_t count, const auto& work_before) {
    part[0] = 0;
    std::size_t i = 0;
    for (std::size_t p = 1; p <= to_index(bundle_parts); ++p) {
      const std::size_t goal = work_before(count) / to_index(bundle_parts) * p;
      while (i < count && (p == to_index(bundle_parts) || work_before(i) < goal)) ++i;
      part[p] = static_cast<int>(i);
    }
  };
  cut(index.pose_part, index.caller_pose.size(), [&](std::size_t k) { return index.range_begin[2 * k]; });
  cut(index.point_part, index.caller_point.size(),
      [&](std::size_t j) { return index.pair_begin[j] + index.link_begin[j]; });
}

template <typename Camera, typename Scalar>
void build_index(const BundleProblem<Camera, Scalar>& problem, BundleIndex& index, BundleResult& result) {
  select_observations(problem, index, result);
  number_poses_and_points(problem.fixed_poses, index);
  find_links(index);
  sort_by_pose(index);
  const std::size_t points = index.caller_point.size();
  index.pair_begin.assign(points + 1, 0);
  index.block_row.clear(), index.block_column.clear();
  index.eliminate_poses =
      4 * points < to_index(index.free_poses);  // the points' system has less than an eighth of the rows
  if (index.eliminate_poses) {
    for (int row = 0; row < static_cast<int>(points); ++row) {
      for (int column = 0; column <= row; ++column)
        index.block_row.push_back(row), index.block_column.push_back(column);
    }
  } else {
    find_pose_blocks(index);
  }
  cut_into_parts(index);
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
