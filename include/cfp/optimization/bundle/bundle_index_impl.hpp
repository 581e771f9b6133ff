/// @file bundle_index_impl.hpp
/// Inside bundle_adjustment.hpp: sorts the usable observations twice, by pose for the linearisation and by point for
/// the elimination, and finds the blocks of the reduced camera system. Linear in observations and in pairs of
/// observations of one point.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cfp/optimization/bundle/bundle_problem.hpp"

namespace cfp::detail {

/// Work is always cut into this many parts, whatever the executor, so that one thread and two give the same bits.
inline constexpr int ba_parts = 2;

[[nodiscard]] constexpr std::size_t to_index(int i) noexcept { return static_cast<std::size_t>(i); }

/// p_cam = rotation (x - center), rows of the rotation one after the other: exact for cameras far from the origin.
struct BundlePose {
  double rotation[9];
  double center[3];
};

struct BundleIndex {
  // A *rank* numbers the poses that take part: free ones first. Points that take part are numbered anew, too.
  int free_poses = 0;
  std::vector<int> pose_of_rank, point_of;
  // Observations by pose: segment 2 r holds the mono ones of rank r, segment 2 r + 1 the RGB-D ones.
  std::vector<std::size_t> segment_begin;
  std::vector<double> u, v, disparity, weight, inv_sigma_sq;
  std::vector<int> point;
  std::vector<std::uint32_t> slot;  // 2 * slot + (1 when an earlier observation of the pose filled the slot)
  // Slots: the pairs (point, pose), by point and in it by rank.
  std::vector<std::size_t> slot_begin;  // per point
  std::vector<int> free_slots;          // per point: its first slots, those of free poses
  std::vector<int> slot_rank;
  // Pairs a <= b of the free slots of a point, from pair_begin on, a slowest: their block (b, a) in the reduced system.
  std::vector<std::size_t> pair_begin;
  std::vector<int> pair_block;
  std::vector<int> block_row, block_column;
  std::vector<int> diagonal_block;  // per free rank
  int max_free_slots = 0;
  bool eliminate_poses = false;  // few points seen by many poses; the blocks above stay empty
  std::array<int, ba_parts + 1> rank_part{}, point_part{};

  // Scratch of build.
  std::vector<int> rank_of, point_number, kept, by_rank, by_point, stamp, stamp_block;
  std::vector<std::size_t> cursor;
};

/// One observation as numbers; false when it is invalid.
struct BundleMeasurement {
  double u = 0, v = 0, disparity = 0, weight = 1, inv_sigma_sq = 1;
  bool stereo = false;
};

template <typename Scalar>
[[nodiscard]] bool read_measurement(const BundleObservations<Scalar>& observations, std::size_t i, double baseline_fx,
                                    BundleMeasurement& m) noexcept {
  m.u = static_cast<double>(observations.pixels(i, 0));
  m.v = static_cast<double>(observations.pixels(i, 1));
  m.weight = observations.weights.empty() ? 1.0 : static_cast<double>(observations.weights[i]);
  const double sigma = observations.sigmas.empty() ? 1.0 : static_cast<double>(observations.sigmas[i]);
  m.inv_sigma_sq = 1 / (sigma * sigma);
  const double right = observations.u_right.empty() ? -1.0 : static_cast<double>(observations.u_right[i]);
  m.stereo = right > 0 && is_finite(right) && baseline_fx > 0 && is_finite(baseline_fx);
  m.disparity = m.stereo ? m.u - right : 0.0;
  return is_finite(m.u) && is_finite(m.v) && m.weight >= 0 && is_finite(m.weight) && sigma > 0 && m.inv_sigma_sq > 0 &&
         is_finite(m.inv_sigma_sq);
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
  error = (du * du + dv * dv + dr * dr) * m.inv_sigma_sq;
  return true;
}

template <typename Camera>
[[nodiscard]] const Camera& camera_of(span<const Camera> cameras, int pose) noexcept {
  return cameras.size() == 1 ? cameras[0] : cameras[to_index(pose)];
}

/// Sums of the counts before each entry; `begin` has one entry more than there are counts, which stand at begin[i + 1].
inline void accumulate_counts(std::vector<std::size_t>& begin) noexcept {
  for (std::size_t i = 1; i < begin.size(); ++i) begin[i] += begin[i - 1];
}

/// Which observations can be used, and which poses and points they touch.
template <typename Camera, typename Scalar>
void select_observations(const BundleProblem<Camera, Scalar>& problem, BundleIndex& index, BundleResult& result) {
  const auto& observations = problem.observations;
  index.kept.clear();
  index.rank_of.assign(problem.poses.size(), -1);
  index.point_number.assign(problem.points.size(), -1);
  for (std::size_t i = 0; i < observations.pose.size(); ++i) {
    const int k = observations.pose[i], j = observations.point[i];
    BundleMeasurement m;
    if (!(k >= 0 && to_index(k) < problem.poses.size() && j >= 0 && to_index(j) < problem.points.size()) ||
        !read_measurement(observations, i, problem.baseline_fx, m)) {
      ++result.invalid;
      continue;
    }
    if (m.weight == 0) {
      ++result.zero_weight;
      continue;
    }
    const SE3<double>& pose = problem.poses[to_index(k)];
    const Vector3<double>& point = problem.points[to_index(j)];
    if (!is_finite(pose.rotation.sum() + pose.translation.sum() + point.sum())) {
      ++result.invalid;
      continue;
    }
    double error = 0;
    if (!squared_error(camera_of(problem.cameras, k), pose, point, m, problem.baseline_fx, error)) {
      ++result.behind;
    } else if (!is_finite(error * m.weight)) {
      ++result.invalid;
    } else {
      index.kept.push_back(static_cast<int>(i));
      index.rank_of[to_index(k)] = 0;
      index.point_number[to_index(j)] = 0;
    }
  }
  result.used = index.kept.size();

  index.pose_of_rank.clear();
  for (const bool fixed : {false, true}) {
    for (std::size_t k = 0; k < problem.poses.size(); ++k) {
      if (index.rank_of[k] < 0 || (!problem.fixed_poses.empty() && problem.fixed_poses[k] != 0) != fixed) continue;
      index.rank_of[k] = static_cast<int>(index.pose_of_rank.size());
      index.pose_of_rank.push_back(static_cast<int>(k));
    }
    if (!fixed) index.free_poses = static_cast<int>(index.pose_of_rank.size());
  }
  index.point_of.clear();
  for (std::size_t j = 0; j < problem.points.size(); ++j) {
    if (index.point_number[j] < 0) continue;
    index.point_number[j] = static_cast<int>(index.point_of.size());
    index.point_of.push_back(static_cast<int>(j));
  }
}

/// Slots by point, ranks ascending; leaves in by_point the kept observations in slot order and in `stamp` their slots.
template <typename Scalar>
void sort_by_point(const BundleObservations<Scalar>& observations, BundleIndex& index) {
  const std::size_t ranks = index.pose_of_rank.size(), points = index.point_of.size(), n = index.kept.size();
  index.cursor.assign(ranks + 1, 0);
  for (const int i : index.kept) ++index.cursor[to_index(index.rank_of[to_index(observations.pose[to_index(i)])]) + 1];
  accumulate_counts(index.cursor);
  index.by_rank.resize(n);
  for (const int i : index.kept)
    index.by_rank[index.cursor[to_index(index.rank_of[to_index(observations.pose[to_index(i)])])]++] = i;

  index.slot_begin.assign(points + 1, 0);
  for (const int i : index.kept)
    ++index.slot_begin[to_index(index.point_number[to_index(observations.point[to_index(i)])]) + 1];
  accumulate_counts(index.slot_begin);
  index.cursor.assign(index.slot_begin.begin(), index.slot_begin.end());
  index.by_point.resize(n);
  for (const int i : index.by_rank)
    index.by_point[index.cursor[to_index(index.point_number[to_index(observations.point[to_index(i)])])]++] = i;

  index.slot_rank.clear();
  index.free_slots.assign(points, 0);
  index.stamp.resize(n);
  index.max_free_slots = 0;
  std::size_t position = 0;
  for (std::size_t j = 0; j < points; ++j) {
    const std::size_t begin = index.slot_rank.size();
    for (const std::size_t end = index.slot_begin[j + 1]; position < end; ++position) {
      const int rank = index.rank_of[to_index(observations.pose[to_index(index.by_point[position])])];
      if (index.slot_rank.size() == begin || index.slot_rank.back() != rank) {
        index.slot_rank.push_back(rank);
        if (rank < index.free_poses) ++index.free_slots[j];
      }
      index.stamp[position] = static_cast<int>(index.slot_rank.size()) - 1;
    }
    index.slot_begin[j] = begin;
    index.max_free_slots = (std::max)(index.max_free_slots, index.free_slots[j]);
  }
  index.slot_begin[points] = index.slot_rank.size();
}

/// The observations by pose and kind, in each segment by slot, so that neighbours in memory stay neighbours.
template <typename Camera, typename Scalar>
void sort_by_pose(const BundleProblem<Camera, Scalar>& problem, BundleIndex& index) {
  const auto& observations = problem.observations;
  const std::size_t ranks = index.pose_of_rank.size(), n = index.kept.size();
  BundleMeasurement m;
  const auto segment_of = [&](int i) {
    (void)read_measurement(observations, to_index(i), problem.baseline_fx, m);
    return 2 * to_index(index.rank_of[to_index(observations.pose[to_index(i)])]) + (m.stereo ? 1U : 0U);
  };
  index.segment_begin.assign(2 * ranks + 1, 0);
  for (const int i : index.kept) ++index.segment_begin[segment_of(i) + 1];
  accumulate_counts(index.segment_begin);
  index.cursor.assign(index.segment_begin.begin(), index.segment_begin.end());
  for (auto* array : {&index.u, &index.v, &index.disparity, &index.weight, &index.inv_sigma_sq}) array->resize(n);
  index.point.resize(n);
  index.slot.resize(n);
  for (std::size_t position = 0; position < n; ++position) {
    const int i = index.by_point[position];
    const std::size_t o = index.cursor[segment_of(i)]++;
    index.u[o] = m.u;
    index.v[o] = m.v;
    index.disparity[o] = m.disparity;
    index.weight[o] = m.weight;
    index.inv_sigma_sq[o] = m.inv_sigma_sq;
    index.point[o] = index.point_number[to_index(observations.point[to_index(i)])];
    index.slot[o] = 2 * static_cast<std::uint32_t>(index.stamp[position]);
  }
  index.stamp.assign(index.slot_rank.size(), 0);
  for (std::uint32_t& slot : index.slot) {
    int& seen = index.stamp[slot / 2];
    slot += static_cast<std::uint32_t>(seen);
    seen = 1;
  }
}

/// The blocks of the reduced system that some point fills, row after row, and for each pair of slots its block.
inline void find_blocks(BundleIndex& index) {
  const std::size_t points = index.point_of.size();
  index.pair_begin.assign(points + 1, 0);
  index.block_row.clear();
  index.block_column.clear();
  index.eliminate_poses =
      4 * points < to_index(index.free_poses);  // then the points' system has less than an eighth of the rows
  if (index.eliminate_poses) return;
  for (std::size_t j = 0; j < points; ++j) {
    const std::size_t f = to_index(index.free_slots[j]);
    index.pair_begin[j + 1] = index.pair_begin[j] + f * (f + 1) / 2;
  }
  index.pair_block.resize(index.pair_begin[points]);
  index.diagonal_block.resize(to_index(index.free_poses));
  index.stamp.assign(to_index(index.free_poses), -1);
  index.stamp_block.resize(to_index(index.free_poses));
  for (int k = 0; k < index.free_poses; ++k) {
    for (std::size_t o = index.segment_begin[2 * to_index(k)]; o < index.segment_begin[2 * to_index(k) + 2]; ++o) {
      if (index.slot[o] % 2 != 0) continue;
      const std::size_t j = to_index(index.point[o]), first = index.slot_begin[j], b = index.slot[o] / 2 - first;
      int* pair = index.pair_block.data() + index.pair_begin[j] + b;
      std::size_t stride = to_index(index.free_slots[j]) - 1;
      for (std::size_t a = 0; a <= b; ++a, pair += stride--) {
        const std::size_t column = to_index(index.slot_rank[first + a]);
        if (index.stamp[column] != k) {
          index.stamp[column] = k;
          index.stamp_block[column] = static_cast<int>(index.block_row.size());
          index.block_row.push_back(k);
          index.block_column.push_back(static_cast<int>(column));
        }
        *pair = index.stamp_block[column];
      }
    }
    index.diagonal_block[to_index(k)] = index.stamp_block[to_index(k)];
  }
}

/// Cuts ranks and points into parts of about equal work.
inline void cut_into_parts(BundleIndex& index) noexcept {
  const auto cut = [](std::array<int, ba_parts + 1>& part, std::size_t count, const auto& work_before) {
    part[0] = 0;
    std::size_t i = 0;
    for (std::size_t p = 1; p <= to_index(ba_parts); ++p) {
      const std::size_t goal = work_before(count) / to_index(ba_parts) * p;
      while (i < count && (p == to_index(ba_parts) || work_before(i) < goal)) ++i;
      part[p] = static_cast<int>(i);
    }
  };
  cut(index.rank_part, index.pose_of_rank.size(), [&](std::size_t r) { return index.segment_begin[2 * r]; });
  cut(index.point_part, index.point_of.size(),
      [&](std::size_t j) { return index.pair_begin[j] + index.slot_begin[j]; });
}

template <typename Camera, typename Scalar>
void build_index(const BundleProblem<Camera, Scalar>& problem, BundleIndex& index, BundleResult& result) {
  select_observations(problem, index, result);
  sort_by_point(problem.observations, index);
  sort_by_pose(problem, index);
  find_blocks(index);
  cut_into_parts(index);
}

}  // namespace cfp::detail
