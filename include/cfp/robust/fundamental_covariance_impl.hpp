/// @file fundamental_covariance_impl.hpp
/// How well the F of fundamental_ransac.hpp is known. Not an interface.
#pragma once

#include "cfp/geometry/epipolar.hpp"
#include "cfp/geometry/point_pairs.hpp"
#include "cfp/math/normal_equations.hpp"
#include "cfp/robust/fundamental_pairs_impl.hpp"
#include "cfp/robust/fundamental_sampson_impl.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

// The covariance of F in pixels, of unit norm: F, of scaled pixels, was fitted to pairs of this variance under a loss
// of this many variances. Zero where they do not tell it.
template <typename T>
[[nodiscard]] FundamentalCovariance covariance_in_pixels(const PairArrays& pairs, const Matrix3<T>& F, T variance,
                                                         T loss) noexcept {
  const FactoredF<T> factored(F);
  NormalEquations<7> sums;
  Eigen::Matrix<double, 7, 7> inverse;
  SampsonModel<T>{exact_columns(pairs), loss * variance}.linearize(factored, sums);
  sums.H *= loss;
  if (!invert_normal_equations<7>(sums.H, 1e-14, inverse)) return FundamentalCovariance::Zero();
  const Matrix3<double> previous = scaling_matrix(pairs.scaling.previous),
                        current = scaling_matrix(pairs.scaling.current).transpose();
  const double norm = (current * factored.matrix() * previous).norm();
  Eigen::Matrix<double, 9, 7> B = factored.tangents();
  for (int k = 0; k < 7; ++k) {
    const Matrix3<double> tangent = B.col(k).reshaped<Eigen::RowMajor>(3, 3), pixels = current * tangent * previous;
    B.col(k) = pixels.reshaped<Eigen::RowMajor>() / norm;
  }
  const Eigen::Matrix<double, 9, 7> BC = B.lazyProduct(inverse);
  return BC.lazyProduct(B.transpose());
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
