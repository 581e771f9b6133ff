/// @file se3.hpp
/// Rigid motions. `T_a_b` maps points of frame b into frame a: p_a = T_a_b * p_b. Tangent vectors are
/// (translation, rotation): xi = (rho, w) in metres and radians; updates multiply from the left, T <- exp(xi) T, so a
/// point p = T * p_b moves by d p / d xi = [I, -hat(p)].
#pragma once

#include <Eigen/Core>

#include "cfp/math/so3.hpp"

namespace cfp {

/// Rotation matrix and translation: 12 scalars, no alignment demands. Default: identity.
template <typename Scalar>
struct SE3 {
  Matrix3<Scalar> rotation = Matrix3<Scalar>::Identity();
  Vector3<Scalar> translation = Vector3<Scalar>::Zero();

  [[nodiscard]] Vector3<Scalar> operator*(const Vector3<Scalar>& point) const noexcept {
    return rotation * point + translation;
  }
  [[nodiscard]] SE3 operator*(const SE3& other) const noexcept {
    return {rotation * other.rotation, rotation * other.translation + translation};
  }
  [[nodiscard]] SE3 inverse() const noexcept { return {rotation.transpose(), -(rotation.transpose() * translation)}; }
  template <typename Other>
  [[nodiscard]] SE3<Other> cast() const noexcept {
    return {rotation.template cast<Other>(), translation.template cast<Other>()};
  }
};

/// exp((rho, w)) = (exp(w), J_l(w) rho).
template <typename Scalar>
[[nodiscard]] SE3<Scalar> se3_exp(const Vector6<Scalar>& xi) noexcept {
  const Vector3<Scalar> w = xi.template tail<3>();
  return {so3_exp(w), so3_left_jacobian(w) * xi.template head<3>()};
}

/// log, the inverse of se3_exp for rotations below pi.
template <typename Scalar>
[[nodiscard]] Vector6<Scalar> se3_log(const SE3<Scalar>& T) noexcept {
  Vector6<Scalar> xi;
  const Vector3<Scalar> w = so3_log(T.rotation);
  xi.template head<3>() = so3_left_jacobian_inverse(w) * T.translation;
  xi.template tail<3>() = w;
  return xi;
}

/// Adjoint: exp(Ad(T) xi) = T exp(xi) T^-1, for the (rho, w) order.
template <typename Scalar>
[[nodiscard]] Matrix6<Scalar> adjoint(const SE3<Scalar>& T) noexcept {
  Matrix6<Scalar> A = Matrix6<Scalar>::Zero();
  A.template topLeftCorner<3, 3>() = T.rotation;
  A.template bottomRightCorner<3, 3>() = T.rotation;
  A.template topRightCorner<3, 3>() = hat(T.translation) * T.rotation;
  return A;
}

}  // namespace cfp
