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

// By how much a covariance by the weighted sum of squares is too large, in the mean, where weights are no information,
// the inverse variances of the pairs: sum of w^2 s^4 d^2 over that of w s^4 d^2, s the root of the loss's weight at d.
[[nodiscard]] inline double weight_in_covariance(const PairArrays& pairs, span<const double> distances_sq,
                                                 double scale) noexcept {
  double with_squares = 0, with_weights = 0;
  for (std::size_t i = 0; i < pairs.size; ++i) {
    const double w = pairs.row(score_weight)[i], root = scale / (scale + distances_sq[i]), share = root * root;
    if (!is_finite(distances_sq[i])) continue;
    with_weights += w * share * share * distances_sq[i];
    with_squares += w * w * share * share * distances_sq[i];
  }
  return with_weights > 0 ? with_squares / with_weights : 1;
}

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
