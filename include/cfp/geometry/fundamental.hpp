/// @file fundamental.hpp
/// The fundamental matrix without robustness: eight-point (least squares, weighted) and seven-point (minimal) solvers.
/// F maps a pixel of the previous image to its line in the current one: x_cur^T F x_prev = 0 with homogeneous pixels,
/// l_cur = F x_prev (the paper's F_{k,k-1}). Every F returned has unit Frobenius norm and rank 2. For distances under F
/// see epipolar.hpp, for pairs with mismatches fundamental_ransac.hpp. Source of the solvers: Hartley and Zisserman,
/// "Multiple View Geometry", ch. 11.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include <Eigen/Core>

#include "cfp/core/status.hpp"
#include "cfp/core/types.hpp"
#include "cfp/geometry/fundamental_impl.hpp"
#include "cfp/geometry/point_pairs.hpp"
#include "cfp/math/matrix3.hpp"

namespace cfp {
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
  std::array<Vector2<double>, 7> p, q;
  detail::for_each_pair(pairs,
                        [&](std::size_t i, const Vector2<double>& previous, const Vector2<double>& current, double) {
                          p[i] = scaled(scaling.previous, previous).template head<2>();
                          q[i] = scaled(scaling.current, current).template head<2>();
                        });
  std::array<Matrix3<double>, 3> found;
  const int count = detail::solve_seven_point(p, q, found);
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i)
    solutions[i] = detail::unscaled_fundamental(found[i], scaling).template cast<Scalar>();
  return count;
}

}  // namespace CFP_ISA
}  // namespace cfp
