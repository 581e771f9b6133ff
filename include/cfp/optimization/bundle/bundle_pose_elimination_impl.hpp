/// @file bundle_pose_elimination_impl.hpp
/// Inside bundle_adjustment.hpp: eliminates the poses instead of the points, for many views of few points (a
/// calibration target, a handful of tracks through a long film), where the reduced camera system would be large and
/// full.
///
/// The same equations the other way round: with H' = L L^T of a pose and Y = L^-1 W of each of its points, y = L^-1 g,
/// a dense system of 3 rows per point,
///   (V' - sum of Y^T Y) step = -g_x + sum of Y^T y,   and then each pose's step = -L^-T (y + sum of Y step_x).
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "cfp/optimization/bundle/bundle_schur_impl.hpp"

namespace cfp::detail {

struct BundlePoseElimination {
  Eigen::MatrixXd system;         // lower triangle
  Eigen::VectorXd steps;          // of the points
  std::vector<double> triangles;  // per free pose: L (36), y (6)
  std::vector<double> rows;       // per slot: Y (18)

  void resize(const BundleIndex& index) {
    const Eigen::Index size = 3 * static_cast<Eigen::Index>(index.point_of.size());
    system.resize(size, size);
    steps.resize(size);
    triangles.resize(42 * to_index(index.free_poses));
    rows.resize(18 * index.slot_rank.size());
  }
};

/// Calls visit(point, slot) for every point that the pose of this rank sees.
template <typename Visit>
void for_each_slot_of(const BundleIndex& index, std::size_t rank, Visit&& visit) {
  for (std::size_t o = index.segment_begin[2 * rank]; o < index.segment_begin[2 * rank + 2]; ++o) {
    if (index.slot[o] % 2 == 0) visit(to_index(index.point[o]), static_cast<std::size_t>(index.slot[o] / 2));
  }
}

/// The steps of the poses. False when the equations are not positive definite.
[[nodiscard]] inline bool eliminate_poses(const BundleIndex& index, const BundleState& state,
                                          const BundleLinearization& linear, double lambda, BundleSchur& schur,
                                          BundlePoseElimination& work, double* pose_steps) {
  using Rows = Eigen::Map<Eigen::Matrix<double, 6, 3>>;
  using Vector = Eigen::Map<Vector6<double>>;
  work.system.setZero();
  for (std::size_t j = 0; j < index.point_of.size(); ++j) {
    double V[6];
    if (!damp_point(index, linear, lambda, j, V, schur)) return false;
    const Eigen::Index at = 3 * static_cast<Eigen::Index>(j);
    for (Eigen::Index c = 0, e = 0; c < 3; ++c) {
      for (Eigen::Index r = c; r < 3; ++r) work.system(at + r, at + c) = V[e++];
      work.steps[at + c] = -schur.points[BundleSchur::point_doubles * j + 6 + static_cast<std::size_t>(c)];
    }
  }
  for (std::size_t k = 0; k < to_index(index.free_poses); ++k) {
    const double* pose = linear.poses.data() + k * BundleLinearization::pose_doubles;
    const Eigen::LLT<Matrix6<double>> llt(damped_pose(pose, lambda));
    if (llt.info() != Eigen::Success || !(llt.matrixLLT().diagonal().minCoeff() > 0)) return false;
    const Eigen::Map<Matrix6<double>> L(work.triangles.data() + 42 * k);
    Eigen::Map<Matrix6<double>>(work.triangles.data() + 42 * k) = llt.matrixLLT();
    Vector y(work.triangles.data() + 42 * k + 36);
    y = L.triangularView<Eigen::Lower>().solve(Vector6<double>(Eigen::Map<const Vector6<double>>(pose + 36)));
    const std::size_t first = index.segment_begin[2 * k];
    for_each_slot_of(index, k, [&](std::size_t j, std::size_t slot) {
      const double *N = linear.slots.data() + BundleLinearization::slot_doubles * slot,
                   *x = state.points.data() + 3 * j, *c = state.poses[k].center;
      const double n[3][3] = {{N[0], N[1], N[2]}, {N[1], N[3], N[4]}, {N[2], N[4], N[5]}},
                   d[3] = {x[0] - c[0], x[1] - c[1], x[2] - c[2]};
      Rows Y(work.rows.data() + 18 * slot);
      for (int column = 0; column < 3; ++column) {
        const double* w = n[column];
        Y.col(column) << w[0], w[1], w[2], d[1] * w[2] - d[2] * w[1], d[2] * w[0] - d[0] * w[2],
            d[0] * w[1] - d[1] * w[0];
      }
      L.triangularView<Eigen::Lower>().solveInPlace(Y);
      const Eigen::Index row = 3 * static_cast<Eigen::Index>(j);
      work.steps.segment<3>(row) += Y.transpose() * y;
      for (std::size_t o = first; o < index.segment_begin[2 * k + 2]; ++o) {  // this point and those before it
        if (index.slot[o] % 2 != 0) continue;
        const std::size_t other = index.slot[o] / 2;
        const Eigen::Index column = 3 * static_cast<Eigen::Index>(index.point[o]);
        const Rows Z(work.rows.data() + 18 * other);
        if (row >= column)
          work.system.block<3, 3>(row, column).noalias() -= Y.transpose().lazyProduct(Z);
        else
          work.system.block<3, 3>(column, row).noalias() -= Z.transpose().lazyProduct(Y);
        if (other == slot) break;
      }
    });
  }
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(work.system);
  if (llt.info() != Eigen::Success || !(work.system.diagonal().minCoeff() > 0)) return false;
  llt.solveInPlace(work.steps);
  for (std::size_t k = 0; k < to_index(index.free_poses); ++k) {
    Vector6<double> sum = Vector(work.triangles.data() + 42 * k + 36);
    for_each_slot_of(index, k, [&](std::size_t j, std::size_t slot) {
      sum += Rows(work.rows.data() + 18 * slot) * work.steps.segment<3>(3 * static_cast<Eigen::Index>(j));
    });
    Eigen::Map<Matrix6<double>>(work.triangles.data() + 42 * k)
        .transpose()
        .triangularView<Eigen::Upper>()
        .solveInPlace(sum);
    Vector(pose_steps + 6 * k) = -sum;
  }
  return true;
}

}  // namespace cfp::detail
