/// @file se3.hpp
/// Rigid motions. `T_a_b` maps points of frame b into frame a: p_a = T_a_b * p_b. Tangent vectors are
/// (translation, rotation): xi = (rho, w) in metres and radians; updates multiply from the left, T <- exp(xi) T, so a
/// point p = T * p_b moves by d p / d xi = [I, -hat(p)].
#pragma once

#include "cfp/math/matrix3.hpp"
#include "cfp/math/so3.hpp"

namespace cfp {

/// Rotation matrix and translation: 12 scalars, no alignment demands. Default: identity.
template <typename Scalar>
struct SE3 {
  Matrix3<Scalar> rotation = Matrix3<Scalar>::Identity();
  Vector3<Scalar> translation = Vector3<Scalar>::Zero();

  /// From the upper three rows of a homogeneous matrix.
  [[nodiscard]] CFP_INLINE static SE3 from_matrix(const Matrix4<Scalar>& T) noexcept {
    return {T.template topLeftCorner<3, 3>(), T.template topRightCorner<3, 1>()};
  }

  [[nodiscard]] CFP_INLINE Vector3<Scalar> operator*(const Vector3<Scalar>& point) const noexcept {
    return rotation * point + translation;
  }
  [[nodiscard]] CFP_INLINE SE3 operator*(const SE3& other) const noexcept {
    return {rotation * other.rotation, rotation * other.translation + translation};
  }
  [[nodiscard]] CFP_INLINE SE3 inverse() const noexcept {
    return {rotation.transpose(), -(rotation.transpose() * translation)};
  }
  /// The homogeneous matrix [R t; 0 1].
  [[nodiscard]] CFP_INLINE Matrix4<Scalar> matrix() const noexcept {
    Matrix4<Scalar> T = Matrix4<Scalar>::Identity();
    T.template topLeftCorner<3, 3>() = rotation;
    T.template topRightCorner<3, 1>() = translation;
    return T;
  }
  template <typename Other>
  [[nodiscard]] CFP_INLINE SE3<Other> cast() const noexcept {
    return {rotation.template cast<Other>(), translation.template cast<Other>()};
  }
};

inline namespace CFP_ISA {

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
  xi.template head<3>() = inverse(so3_left_jacobian(w)) * T.translation;
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

/// The centre of a camera in the world. For T of a host, whose rotation may be off in its last digits: its transpose in
/// the place of its inverse would move a camera that is far from the origin.
template <typename Scalar>
[[nodiscard]] Vector3<Scalar> camera_centre(const SE3<Scalar>& T_cam_world) noexcept {
  return -(inverse(T_cam_world.rotation) * T_cam_world.translation);
}

/// Whether T is finite (translation within 1e9) and its rotation one to 1e-2: a float matrix from a host is off by 1e-7
/// or, after many products, more; a scaled or mirrored one is a mistake.
template <typename Scalar>
[[nodiscard]] bool is_rigid_motion(const SE3<Scalar>& T) noexcept {
  if (!(T.translation.cwiseAbs().sum() <= Scalar(1e9)) || !(T.rotation.cwiseAbs().sum() <= Scalar(10))) return false;
  const Matrix3<Scalar> excess = T.rotation.transpose() * T.rotation - Matrix3<Scalar>::Identity();
  return excess.cwiseAbs().maxCoeff() < Scalar(1e-2) && determinant(T.rotation) > Scalar(0);
}

}  // namespace CFP_ISA
}  // namespace cfp
