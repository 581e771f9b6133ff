/// @file fundamental.hpp
/// The fundamental matrix without robustness: eight-point (least squares, weighted) and seven-point (minimal) solvers.
/// F maps a pixel of the previous image to its line in the current one: x_cur^T F x_prev = 0 with homogeneous pixels,
/// l_cur = F x_prev (the paper's F_{k,k-1}). Every F returned has unit Frobenius norm and rank 2. For distances under F
/// see epipolar.hpp, for pairs with mismatches fundamental_ransac.hpp. Source of the solvers: Hartley and Zisserman,
/// "Multiple View Geometry", ch. 11.
#pragma once

#include <array>
#include <cmath>
#include <utility>

#include "cfp/core/status.hpp"
#include "cfp/core/types.hpp"
#include "cfp/geometry/point_pairs.hpp"
#include "cfp/math/cubic.hpp"
#include "cfp/math/matrix3.hpp"

namespace cfp {

namespace detail {
inline namespace CFP_ISA {

// Null space of the seven epipolar equations by elimination. Rows are exchanged, and columns, too, where all that is
// left of one is small beside the coordinates, which are about 1: so it stays exact when any of the nine coefficients
// vanishes (pure translations do that). False when the rank is below seven.
template <typename T>
[[nodiscard]] bool seven_point_null_space(T (&A)[7][9], Matrix3<T>& F1, Matrix3<T>& F2) noexcept {
  int column[9] = {0, 1, 2, 3, 4, 5, 6, 7, 8};
  T largest = 0;
  for (int k = 0; k < 7; ++k) {
    int pivot_row = k, pivot_col = k;
    T pivot = 0;
    const auto search = [&](int c) {
      for (int r = k; r < 7; ++r) {
        const T value = std::abs(A[r][c]);
        const bool larger = value > pivot;
        pivot_row = larger ? r : pivot_row, pivot_col = larger ? c : pivot_col, pivot = larger ? value : pivot;
      }
    };
    search(k);
    if (!(pivot > T(0.01))) {
      for (int c = k + 1; c < 9; ++c) search(c);
    }
    largest = (std::max)(largest, pivot);
    if (!(pivot > T(1e-12) * largest)) return false;
    if (pivot_row != k) std::swap(A[k], A[pivot_row]);
    if (pivot_col != k) {
      for (auto& row : A) std::swap(row[k], row[pivot_col]);
      std::swap(column[k], column[pivot_col]);
    }
    const T inverse = 1 / A[k][k];  // over whole rows: a fixed length vectorises
    for (int c = 0; c < 9; ++c) A[k][c] *= inverse;
    for (int r = k + 1; r < 7; ++r) {
      const T factor = A[r][k];
      for (int c = 0; c < 9; ++c) A[r][c] -= factor * A[k][c];
    }
  }
  for (int free = 0; free < 2; ++free) {
    T x[9] = {};
    x[7 + free] = 1;
    for (int k = 6; k >= 0; --k) {
      for (int c = k + 1; c < 9; ++c) x[k] -= A[k][c] * x[c];
    }
    Matrix3<T>& F = free == 0 ? F1 : F2;
    for (int k = 0; k < 9; ++k) F(column[k] / 3, column[k] % 3) = x[k];
    F.normalize();
  }
  return true;
}

// Seven-point solver on scaled pixels (x, y, 1): the matrices of the pencil through the null space whose determinant
// vanishes.
template <typename T>
[[nodiscard]] int solve_seven_point(const std::array<Vector3<T>, 7>& p, const std::array<Vector3<T>, 7>& q,
                                    std::array<Matrix3<T>, 3>& F) noexcept {
  T A[7][9];
  for (std::size_t i = 0; i < 7; ++i) {
    for (int k = 0; k < 9; ++k) A[i][k] = q[i][k / 3] * p[i][k % 3];
  }
  Matrix3<T> a, b;
  if (!seven_point_null_space(A, a, b)) return 0;
  // det(a + x b) has at most three roots, so among four members of the pencil one has a determinant well away from
  // zero: that one as b makes the cubic's leading coefficient safe and leaves no root at infinity.
  const Matrix3<T> candidates[4] = {b, a, (a + b).normalized(), (a - b).normalized()};
  int best = 0;
  T det_b = determinant(candidates[0]);
  for (int k = 1; k < 4; ++k) {
    const T det = determinant(candidates[k]);
    if (std::abs(det) > std::abs(det_b)) best = k, det_b = det;
  }
  if (best == 1) a = b;
  b = candidates[best];
  if (!(std::abs(det_b) > 0)) return 0;
  // Coefficients of det(a + x b): det a, tr(adj(a) b), tr(a adj(b)), det b.
  T roots[3];
  const int count = real_cubic_roots(cofactors(b).cwiseProduct(a).sum() / det_b,
                                     cofactors(a).cwiseProduct(b).sum() / det_b, determinant(a) / det_b, roots);
  for (int k = 0; k < count; ++k) F[static_cast<std::size_t>(k)] = (a + roots[k] * b).normalized();
  return count;
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// The matrix of rank at most 2 nearest to F (Frobenius), scaled to unit norm; zero for an F that is zero or not
/// finite.
template <typename Scalar>
[[nodiscard]] Matrix3<Scalar> nearest_fundamental(const Matrix3<Scalar>& F) noexcept {
  if (!F.allFinite() || F.isZero(0)) return Matrix3<Scalar>::Zero();
  const SVD3<Scalar> f = svd(F);
  const Vector3<Scalar> sigma = f.sigma / f.sigma[0];
  return (f.U.template leftCols<2>() * sigma.template head<2>().normalized().asDiagonal() *
          f.V.template leftCols<2>().transpose());
}

/// Normalised eight-point algorithm: the F that minimises sum w (x_cur^T F x_prev)^2 in coordinates centred and scaled
/// per image (weighted centroid, mean distance sqrt 2), then made rank 2 there. Works in double. not_enough_data below
/// eight pairs, degenerate when they determine no unique F (all on one plane or line, pure rotation, equal points;
/// noise hides this from any linear solver); F is then zero. Allocates nothing; O(n).
template <typename Scalar>
[[nodiscard]] Status fundamental_8point(const PointPairs<Scalar>& pairs, Matrix3<Scalar>& F) noexcept {
  F.setZero();
  const detail::PairScaling scaling = detail::scale_pairs(pairs);
  if (scaling.used < 8) return Status::not_enough_data;
  if (!scaling.valid()) return Status::degenerate;

  using Matrix9 = Eigen::Matrix<double, 9, 9>;
  Matrix9 M = Matrix9::Zero(), V = Matrix9::Identity();
  const auto add = [&](std::size_t, const Vector2<double>& previous, const Vector2<double>& current, double weight) {
    const Vector3<double> p = scaled(scaling.previous, previous), q = scaled(scaling.current, current);
    Eigen::Matrix<double, 9, 1> row;
    for (int k = 0; k < 3; ++k) row.segment<3>(3 * k) = q[k] * p;
    M += weight / scaling.largest_weight * row * row.transpose();
  };
  detail::for_each_pair(pairs, add);
  detail::orthogonalize_columns(M, V);
  if (!(M.col(7).norm() > 1e-13 * M.col(0).norm())) return Status::degenerate;
  const Matrix3<double> found = V.col(8).reshaped<Eigen::RowMajor>(3, 3);
  F = detail::unscaled_fundamental(nearest_fundamental(found), scaling).template cast<Scalar>();
  return Status::ok;
}

/// Seven-point algorithm: every F of rank 2 that satisfies seven pairs exactly, one or three of them; returns the
/// count. 0, with solutions untouched, when the seven do not determine finitely many (six or more on a plane, repeated
/// or non-finite points). Works in double. Allocates nothing; about a microsecond.
template <typename Scalar>
[[nodiscard]] int fundamental_7point(const PointPairs<Scalar>& pairs,
                                     std::array<Matrix3<Scalar>, 3>& solutions) noexcept {
  CFP_ASSERT(pairs.previous.size() == 7);
  const detail::PairScaling scaling = detail::scale_pairs(pairs);
  if (scaling.used < 7 || !scaling.valid()) return 0;
  std::array<Vector3<double>, 7> p, q;
  detail::for_each_pair(pairs,
                        [&](std::size_t i, const Vector2<double>& previous, const Vector2<double>& current, double) {
                          p[i] = scaled(scaling.previous, previous);
                          q[i] = scaled(scaling.current, current);
                        });
  std::array<Matrix3<double>, 3> found;
  const int count = detail::solve_seven_point(p, q, found);
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i)
    solutions[i] = detail::unscaled_fundamental(found[i], scaling).template cast<Scalar>();
  return count;
}

}  // namespace CFP_ISA
}  // namespace cfp
