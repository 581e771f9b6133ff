/// @file uncertain_motion.hpp
/// A rigid motion with its covariance, two of them as one, and what one says of the next.
#pragma once

#include "cfp/core/span.hpp"
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

/// What a camera moved in a time; time_s 0: unknown.
template <typename Scalar>
struct TimedMotion {
  UncertainMotion<Scalar> motion;
  Scalar time_s = 0;
};

namespace detail {

/// Two motions that differ by more are not one: chi-squared of 6 degrees of freedom, one in a thousand.
inline constexpr double most_motion_distance_sq = 22.5;

}  // namespace detail

inline namespace CFP_ISA {

/// The motion between two poses of one camera whose errors have this joint covariance, 12 x 12: of (xi_prev, xi_cur) in
/// exp(xi) T_cam_world, in the order and units of UncertainMotion. To first order
///
///   J C J^T,  J = (-Ad(T_cur_prev), 1).
///
/// A position p + dp in the world and a rotation R_cam_world = exp(-theta) R, as in OpenVINS and VINS-Mono, give
/// xi = -(R dp, theta); T_world_cam exp(zeta) gives xi = -zeta; xi of a body gives Ad(T_cam_body) xi of its camera.
template <typename Scalar, typename Covariance>
[[nodiscard]] UncertainMotion<Scalar> relative_motion(const SE3<Scalar>& T_prev_world, const SE3<Scalar>& T_cur_world,
                                                      const Eigen::MatrixBase<Covariance>& joint_covariance) noexcept {
  UncertainMotion<Scalar> motion(T_cur_world * T_prev_world.inverse());
  Eigen::Matrix<Scalar, 6, 12> J;
  J.template leftCols<6>() = -adjoint(motion.T_cur_prev);
  J.template rightCols<6>().setIdentity();
  const Eigen::Matrix<Scalar, 6, 12> JC = J.lazyProduct(joint_covariance);
  motion.covariance = JC.lazyProduct(J.transpose());
  return motion;
}

/// The motion in the next time_s of a camera that keeps its velocity, as its own axes see it, but for an acceleration,
/// the standard deviation of each coordinate of which is given; how it turns may change at will. What keeps its
/// velocity in the world errs by more than that from 3 rad/s on. Both times above 0.
template <typename Scalar>
[[nodiscard]] UncertainMotion<Scalar> predicted_motion(const TimedMotion<Scalar>& last, non_deduced<Scalar> time_s,
                                                       non_deduced<Scalar> acceleration_m_s2) noexcept {
  const Scalar ratio = time_s / last.time_s, between_s = (time_s + last.time_s) / 2;
  UncertainMotion<Scalar> motion(se3_exp(Vector6<Scalar>(ratio * se3_log(last.motion.T_cur_prev))),
                                 acceleration_m_s2 * between_s * time_s, 1);
  motion.covariance += ratio * ratio * last.motion.covariance;
  return motion;
}

/// Two independent estimates of one motion as one, to first order in what they differ by; the given one if it is exact.
/// False, and the result untouched, where the covariances have no common inverse, the squared Mahalanobis distance
/// between the two is above the most, or anything is not finite.
template <typename Scalar>
[[nodiscard]] bool join(const UncertainMotion<double>& given, const UncertainMotion<Scalar>& measured,
                        double most_distance_sq, UncertainMotion<Scalar>& result) noexcept {
  const UncertainMotion<double> other = measured.template cast<double>();
  Matrix6<double> inverse;
  if (!invert_normal_equations<6>(Matrix6<double>(given.covariance + other.covariance), 1e-12, inverse)) return false;
  const Vector6<double> apart = se3_log(other.T_cur_prev * given.T_cur_prev.inverse());
  if (!(apart.dot(inverse.lazyProduct(apart)) <= most_distance_sq)) return false;
  const Matrix6<double> gain = given.covariance.lazyProduct(inverse);
  const Vector6<double> correction = gain.lazyProduct(apart);
  UncertainMotion<double> both(se3_exp(correction) * given.T_cur_prev);
  both.covariance = gain.lazyProduct(other.covariance);
  const UncertainMotion<Scalar> rounded = both.template cast<Scalar>();
  if (!rounded.covariance.allFinite() || !rounded.T_cur_prev.translation.allFinite()) return false;
  result = rounded;
  return true;
}

}  // namespace CFP_ISA
}  // namespace cfp
