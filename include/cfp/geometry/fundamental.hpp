/// @file fundamental.hpp
/// The fundamental matrix without robustness: eight-point (least squares, weighted) and seven-point (minimal) solvers.
/// F maps a pixel of the previous image to its line in the current one: x_cur^T F x_prev = 0 with homogeneous pixels,
/// l_cur = F x_prev (the paper's F_{k,k-1}). Every F returned has unit Frobenius norm and rank 2. For distances under F
/// see epipolar.hpp, for pairs with mismatches fundamental_ransac.hpp. Source of the solvers: Hartley and Zisserman,
/// "Multiple View Geometry", ch. 11.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"
#include "cfp/core/status.hpp"
#include "cfp/geometry/fundamental_impl.hpp"
#include "cfp/math/so3.hpp"

namespace cfp {

/// The matrix of rank at most 2 nearest to F (Frobenius), scaled to unit norm; zero for an F that is zero or not
/// finite.
template <typename Scalar>
[[nodiscard]] Matrix3<Scalar> nearest_fundamental(const Matrix3<Scalar>& F) noexcept {
  const Scalar largest = F.cwiseAbs().maxCoeff();
  if (!(largest > Scalar(0)) || !F.allFinite()) return Matrix3<Scalar>::Zero();
  const Eigen::JacobiSVD<Matrix3<Scalar>> svd(F / largest, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Vector3<Scalar> sigma = svd.singularValues();
  sigma.z() = Scalar(0);
  return svd.matrixU() * sigma.normalized().asDiagonal() * svd.matrixV().transpose();
}

/// Normalised eight-point algorithm: the F that minimises sum w (x_cur^T F x_prev)^2 in coordinates centred and scaled
/// per image (weighted centroid, mean distance sqrt 2), then made rank 2 there. weights: empty (ones) or one per pair;
/// a pair whose weight is not positive and finite, or whose coordinates are not finite and below 1e5 px, counts as
/// absent. Works in double. not_enough_data below eight pairs, degenerate when they determine no unique F (all on one
/// plane or line, pure rotation, equal points; noise hides this from any linear solver); F is then zero. Allocates
/// nothing; O(n).
template <typename Scalar>
Status fundamental_8point(PointSpan<Scalar, 2> prev, PointSpan<Scalar, 2> cur, span<const Scalar> weights,
                          Matrix3<Scalar>& F) noexcept {
  CFP_ASSERT(prev.size() == cur.size() && (weights.empty() || weights.size() == prev.size()));
  F.setZero();
  detail::PixelScaling scale_prev, scale_cur;
  const std::size_t used = detail::scale_pixels<Scalar>(prev, cur, weights, scale_prev, scale_cur);
  if (used < 8) return Status::not_enough_data;
  if (!scale_prev.valid() || !scale_cur.valid()) return Status::degenerate;

  Eigen::Matrix<double, 9, 9> M = Eigen::Matrix<double, 9, 9>::Zero();
  for (std::size_t i = 0; i < prev.size(); ++i) {
    const double w = detail::pair_weight<Scalar>(prev, cur, weights, i);
    if (!(w > 0)) continue;
    const Vector3<double> p = scale_prev(prev(i, 0), prev(i, 1)), q = scale_cur(cur(i, 0), cur(i, 1));
    Eigen::Matrix<double, 9, 1> row;
    row.head<3>() = q.x() * p;
    row.segment<3>(3) = q.y() * p;
    row.tail<3>() = p;
    const Eigen::Matrix<double, 9, 1> weighted = w / scale_prev.largest_weight * row;
    for (int c = 0; c < 9; ++c) M.col(c).noalias() += row[c] * weighted;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> eigen(M);
  if (eigen.info() != Eigen::Success || !(eigen.eigenvalues()[1] > 1e-13 * eigen.eigenvalues()[8]))
    return Status::degenerate;
  const Matrix3<double> scaled =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(eigen.eigenvectors().col(0).data());
  F = detail::unscaled(nearest_fundamental<double>(scaled), scale_prev, scale_cur).template cast<Scalar>();
  return Status::ok;
}

/// Seven-point algorithm: every F of rank 2 that satisfies seven pairs exactly, one or three of them; returns the
/// count. 0, with solutions untouched, when the seven do not determine finitely many (six or more on a plane, repeated
/// or non-finite points). Works in double. Allocates nothing; about a microsecond.
template <typename Scalar>
[[nodiscard]] int fundamental_7point(PointSpan<Scalar, 2> prev, PointSpan<Scalar, 2> cur,
                                     std::array<Matrix3<Scalar>, 3>& solutions) noexcept {
  CFP_ASSERT(prev.size() == 7 && cur.size() == 7);
  detail::PixelScaling scale_prev, scale_cur;
  if (detail::scale_pixels<Scalar>(prev, cur, {}, scale_prev, scale_cur) < 7 || !scale_prev.valid() ||
      !scale_cur.valid())
    return 0;
  double p[7][2], q[7][2];
  for (std::size_t i = 0; i < 7; ++i) {
    for (int c = 0; c < 2; ++c) {
      p[i][c] = scale_prev(prev(i, 0), prev(i, 1))[c];
      q[i][c] = scale_cur(cur(i, 0), cur(i, 1))[c];
    }
  }
  Matrix3<double> scaled[3];
  const int count = detail::solve_seven_point(p, q, scaled);
  for (int i = 0; i < count; ++i) {
    solutions[static_cast<std::size_t>(i)] = detail::unscaled(scaled[i], scale_prev, scale_cur).template cast<Scalar>();
  }
  return count;
}

}  // namespace cfp
