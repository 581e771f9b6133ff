/// @file uncertain_motion.hpp
/// A rigid motion with its covariance, and two of them as one.
#pragma once

#include "cfp/core/types.hpp"
#include "cfp/math/normal_equations.hpp"
#include "cfp/math/se3.hpp"

namespace cfp {

/// The camera's motion between two frames, and how well it is known.
template <typename Scalar>
struct UncertainMotion {
  SE3<Scalar> T_cur_prev;
  /// Of xi = (translation, rotation) in exp(xi) T_cur_prev: m^2, m rad, rad^2; zero: the motion is exact.
  Eigen::Matrix<Scalar, 6, 6, Eigen::DontAlign> covariance = Eigen::Matrix<Scalar, 6, 6, Eigen::DontAlign>::Zero();

  // Inline: a default one may stand out of line, and what zeroes a matrix must not be shared by units of other flags.
  CFP_INLINE UncertainMotion() noexcept {}  // NOLINT(modernize-use-equals-default)
  CFP_INLINE explicit UncertainMotion(const SE3<Scalar>& exact) noexcept : T_cur_prev(exact) {}
  /// Standard deviations of each coordinate of the translation, m, and of the rotation, rad.
  CFP_INLINE UncertainMotion(const SE3<Scalar>& T, Scalar translation_sigma_m, Scalar rotation_sigma_rad) noexcept
      : T_cur_prev(T) {
    for (int k = 0; k < 6; ++k) {
      const Scalar sigma = k < 3 ? translation_sigma_m : rotation_sigma_rad;
      covariance(k, k) = sigma * sigma;
    }
  }
  template <typename Other>
  [[nodiscard]] CFP_INLINE UncertainMotion<Other> cast() const noexcept {
    UncertainMotion<Other> result(T_cur_prev.template cast<Other>());
    for (int k = 0; k < 36; ++k) result.covariance.data()[k] = static_cast<Other>(covariance.data()[k]);
    return result;
  }
};

inline namespace CFP_ISA {

/// Two independent estimates of one motion as one, to first order in what they differ by; the given one if it is exact.
/// The measured one where the covariances have no common inverse, or anything is not finite.
template <typename Scalar>
[[nodiscard]] UncertainMotion<Scalar> joined(const UncertainMotion<double>& given,
                                             const UncertainMotion<Scalar>& measured) noexcept {
  const UncertainMotion<double> other = measured.template cast<double>();
  Matrix6<double> inverse;
  if (!invert_normal_equations<6>(Matrix6<double>(given.covariance + other.covariance), 1e-12, inverse))
    return measured;
  const Matrix6<double> gain = given.covariance.lazyProduct(inverse);
  const Vector6<double> correction = gain.lazyProduct(se3_log(other.T_cur_prev * given.T_cur_prev.inverse()));
  if (!correction.allFinite()) return measured;
  UncertainMotion<double> result(se3_exp(correction) * given.T_cur_prev);
  result.covariance = gain.lazyProduct(other.covariance);
  return result.template cast<Scalar>();
}

}  // namespace CFP_ISA
}  // namespace cfp
