/// @file bundle_pose_elimination_impl.hpp
/// Inside bundle_adjustment.hpp: eliminates the poses instead of the points, for many views of few points (a
/// calibration target, a handful of tracks through a long film), where the reduced system of the poses would be large
/// and full.
#pragma once

#include <algorithm>
#include <cstddef>

#include <Eigen/Core>

#include "cfp/optimization/bundle/bundle_schur_impl.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

/// Calls visit(point, link) for every point that pose k sees.
template <typename Visit>
void for_each_link_of(const BundleIndex& index, std::size_t k, const Visit& visit) {
  for (std::size_t o = index.range_begin[2 * k]; o < index.range_begin[2 * k + 2]; ++o) {
    if (index.repeats[o] == 0) visit(to_index(index.point[o]), to_index(index.link[o]));
  }
}

/// The same equations the other way round: with H' = L L^T of a pose, Y = L^-1 W of each of its points and y = L^-1 g,
/// a full system of 3 rows per point,
///   (V' - sum of Y^T Y) step = -g_x + sum of Y^T y,   and then each pose's step = -L^-T (y + sum of Y step_x).
/// The poses' steps; false when the equations are not positive definite.
template <int Pose = 6, int Point = 3>
[[nodiscard]] bool eliminate_poses(const BundleIndex& index, const BundleState& state,
                                   const BundleLinearization& linear, double lambda, BundleSchur& schur) {
  using PoseMatrix = Eigen::Map<Eigen::Matrix<double, Pose, Pose>>;
  using PoseVector = Eigen::Map<Eigen::Matrix<double, Pose, 1>>;
  using PointMatrix = Eigen::Map<Eigen::Matrix<double, Point, Point>>;
  using PointVector = Eigen::Map<Eigen::Matrix<double, Point, 1>>;
  using Coupling = Eigen::Map<Eigen::Matrix<double, Pose, Point>>;
  const auto triangle = [&](std::size_t k) { return PoseMatrix(schur.triangles.data() + 42 * k); };
  const auto y = [&](std::size_t k) { return PoseVector(schur.triangles.data() + 42 * k + 36); };
  const auto Y = [&](std::size_t link) {
    return Coupling(schur.couplings.data() + BundleSchur::coupling_doubles * link);
  };
  const auto step = [&](std::size_t j) { return PointVector(schur.right_side[0].data() + 3 * j); };
  const auto block = [&](std::size_t row, std::size_t column) {
    return PointMatrix(schur.blocks[0].data() + 9 * (row * (row + 1) / 2 + column));
  };
  std::fill(schur.blocks[0].begin(), schur.blocks[0].end(), 0.0);
  for (std::size_t j = 0; j < index.caller_point.size(); ++j) {
    double V[6];
    if (!damp_point(index, linear, lambda, j, V, schur)) return false;
    for (int c = 0, e = 0; c < 3; ++c) {
      for (int r = c; r < 3; ++r) block(j, j)(r, c) = V[e++];
      step(j)[c] = -schur.points[BundleSchur::point_doubles * j + 6 + to_index(c)];
    }
  }
  for (std::size_t k = 0; k < to_index(index.free_poses); ++k) {
    const double* pose = linear.poses.data() + k * BundleLinearization::pose_doubles;
    damp_pose(pose, lambda, triangle(k).data());
    if (!invert_triangle<Pose>(triangle(k))) return false;
    y(k) = triangle(k).lazyProduct(Eigen::Map<const Eigen::Matrix<double, Pose, 1>>(pose + 36));
    for_each_link_of(index, k, [&](std::size_t j, std::size_t link) {
      const double *x = state.points.data() + 3 * j, *c = state.poses[k].center;
      Eigen::Matrix<double, Pose, Point> W;
      couple(linear.links.data() + BundleLinearization::link_doubles * link, {x[0] - c[0], x[1] - c[1], x[2] - c[2]},
             W.data());
      Y(link) = triangle(k).lazyProduct(W);
      step(j) += Y(link).transpose().lazyProduct(y(k));
    });
    for_each_link_of(index, k, [&](std::size_t j, std::size_t link) {
      for_each_link_of(index, k, [&](std::size_t other, std::size_t other_link) {
        if (other <= j) block(j, other) -= Y(link).transpose().lazyProduct(Y(other_link));
      });
    });
  }
  if (!factorize_blocks<Point>(schur.blocks[0], schur.factor)) return false;
  solve_blocks<Point>(schur.right_side[0], schur.factor);
  for (std::size_t k = 0; k < to_index(index.free_poses); ++k) {
    Eigen::Matrix<double, Pose, 1> sum = y(k);
    for_each_link_of(index, k, [&](std::size_t j, std::size_t link) { sum += Y(link).lazyProduct(step(j)); });
    PoseVector(schur.pose_steps.data() + 6 * k) = -triangle(k).transpose().lazyProduct(sum);
  }
  return true;
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
