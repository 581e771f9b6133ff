/// @file bundle_index_impl.hpp
/// Inside bundle_adjustment.hpp: numbers the poses and points that take part, sorts the usable observations by pose for
/// the linearisation, and finds the links between points and poses for the elimination. Linear in the observations and
/// in the pairs of poses of one point.
///
/// Words: *poses* and *points* are numbered anew, free poses first. A *link* joins a point and a pose that observes it,
/// once or several times. A *part* is the share of the work that one thread may do.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cfp/optimization/bundle/block_cholesky_impl.hpp"
#include "cfp/optimization/bundle/bundle_problem.hpp"

namespace cfp::detail {

/// Work is always cut into this many parts, whatever the executor, so that one thread and two give the same bits.
inline constexpr int bundle_parts = 2;

/// One observation as numbers, of a pose and a point of the caller's.
struct BundleMeasurement {
  int pose = 0, point = 0;
  double u = 0, v = 0, disparity = 0, weight = 1, information = 1;  // information: 1 / sigma^2
  bool stereo = false;
};

struct BundleIndex {
  int free_poses = 0;
  std::vector<int> caller_pose, caller_point;  // of the caller, per pose and point
  // Observations by pose: range 2 k of pose k holds the mono ones, range 2 k + 1 the stereo ones.
  std::vector<std::size_t> range_begin;
  std::vector<double> u, v, disparity, weight, information;
  std::vector<int> point, link;
  std::vector<char> repeats;  // an earlier observation of the pose has this link
  // Links by point, in it by pose.
  std::vector<std::size_t> link_begin;  // per point
  std::vector<int> free_links;          // per point: its first links, those to free poses
  std::vector<int> link_pose;
  // Blocks of the reduced system. Of the pairs a <= b of the free links of a point, from pair_begin on, a slowest:
  // their block (b, a).
  std::vector<std::size_t> pair_begin;
  std::vector<int> pair_block, block_row, block_column, diagonal_block;
  int most_free_links = 0;
  bool eliminate_poses = false;  // few points seen by many poses; the reduced system is that of the points
  std::array<int, bundle_parts + 1> pose_part{}, point_part{};

  // Scratch while building.
  std::vector<BundleMeasurement> kept;
  std::vector<int> pose_number, point_number, order, by_pose, by_point, link_of, last_row, last_block;
  std::vector<char> is_rigid, is_met;
  std::vector<std::size_t> cursor;
};

inline namespace CFP_ISA {

/// False when the observation is invalid, apart from its pose and point.
template <typename Scalar>
[[nodiscard]] bool read_measurement(const BundleObservations<Scalar>& observations, std::size_t i, double baseline_fx,
                                    BundleMeasurement& m) noexcept {
  m.pose = observations.pose[i], m.point = observations.point[i];
  m.u = static_cast<double>(observations.pixels(i, 0));
  m.v = static_cast<double>(observations.pixels(i, 1));
  m.weight = observations.weights.empty() ? 1.0 : static_cast<double>(observations.weights[i]);
  const double sigma = observations.sigmas.empty() ? 1.0 : static_cast<double>(observations.sigmas[i]);
  m.information = 1 / (sigma * sigma);
  const double right = observations.u_right.empty() ? -1.0 : static_cast<double>(observations.u_right[i]);
  m.stereo = right > 0 && is_finite(right) && baseline_fx > 0 && is_finite(baseline_fx);
  m.disparity = m.stereo ? m.u - right : 0.0;
  return is_finite(m.u) && is_finite(m.v) && m.weight >= 0 && is_finite(m.weight) && sigma > 0 && m.information > 0 &&
         is_finite(m.information);
}

/// |r|^2 / sigma^2 of one observation; false when the camera does not see the point.
template <typename Camera>
[[nodiscard]] bool squared_error(const Camera& camera, const SE3<double>& T_cam_world, const Vector3<double>& point,
                                 const BundleMeasurement& m, double baseline_fx, double& error) noexcept {
  using Real = typename Camera::ScalarType;
  const Vector3<double> p = T_cam_world * point;
  Vector2<Real> pixel;
  if (!camera.project(p.template cast<Real>(), pixel)) return false;
  const double du = static_cast<double>(pixel.x()) - m.u, dv = static_cast<double>(pixel.y()) - m.v;
  const double dr = m.stereo ? du + m.disparity - baseline_fx / p.z() : 0.0;
  error = (du * du + dv * dv + dr * dr) * m.information;
  return true;
}

template <typename Camera>
[[nodiscard]] const Camera& camera_of(span<const Camera> cameras, int pose) noexcept {
  return cameras.size() == 1 ? cameras[0] : cameras[to_index(pose)];
}

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

/// Keeps the observations that can be used, and marks the poses and points they touch.
template <typename Camera, typename Scalar>
void select_observations(const BundleProblem<Camera, Scalar>& problem, BundleIndex& index, BundleResult& result) {
  index.kept.clear();
  index.pose_number.assign(problem.poses.size(), -1);
  index.point_number.assign(problem.points.size(), -1);
  index.is_rigid.resize(problem.poses.size());
  for (std::size_t k = 0; k < problem.poses.size(); ++k) index.is_rigid[k] = is_rigid_motion(problem.poses[k]) ? 1 : 0;
  for (std::size_t i = 0; i < problem.observations.pose.size(); ++i) {
    BundleMeasurement m;
    const bool readable = read_measurement(problem.observations, i, problem.baseline_fx, m);
    const std::size_t k = static_cast<std::size_t>(m.pose), j = static_cast<std::size_t>(m.point);
    if (!readable || m.pose < 0 || k >= problem.poses.size() || m.point < 0 || j >= problem.points.size()) {
      ++result.invalid;
      continue;
    }
    if (m.weight == 0) {
      ++result.zero_weight;
      continue;
    }
    if (index.is_rigid[k] == 0 || !is_finite(problem.points[j].sum())) {
      ++result.invalid;
      continue;
    }
    double error = 0;
    if (!squared_error(camera_of(problem.cameras, m.pose), problem.poses[k], problem.points[j], m, problem.baseline_fx,
                       error)) {
      ++result.behind;
    } else if (!is_finite(error * m.weight)) {
      ++result.invalid;
    } else {
      index.kept.push_back(m);
      index.pose_number[k] = index.point_number[j] = 0;
    }
  }
  result.used = index.kept.size();
}

/// Numbers the poses and points that were marked.
inline void number_poses_and_points(span<const char> fixed_poses, BundleIndex& index) {
  const auto number = [](std::vector<int>& numbers, std::vector<int>& list, const auto& wanted) {
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      if (numbers[i] < 0 || !wanted(i)) continue;
      numbers[i] = static_cast<int>(list.size());
      list.push_back(static_cast<int>(i));
    }
  };
  const auto is_fixed = [&](std::size_t k) { return !fixed_poses.empty() && fixed_poses[k] != 0; };
  index.caller_pose.clear(), index.caller_point.clear();
  number(index.pose_number, index.caller_pose, [&](std::size_t k) { return !is_fixed(k); });
  index.free_poses = static_cast<int>(index.caller_pose.size());
  number(index.pose_number, index.caller_pose, is_fixed);
  number(index.point_number, index.caller_point, [](std::size_t) { return true; });
  for (BundleMeasurement& m : index.kept) {
    m.pose = index.pose_number[to_index(m.pose)];
    m.point = index.point_number[to_index(m.point)];
  }
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
