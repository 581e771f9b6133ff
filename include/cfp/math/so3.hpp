/// @file so3.hpp
/// Rotations: hat, exponential, logarithm, left Jacobian. A rotation is a plain 3x3 matrix (no alignment demands:
/// public structs have one layout under all vector flags); rotation vectors are in radians.
/// Source: Sola, Deray, Atchuthan: "A micro Lie theory for state estimation in robotics", 2018, eqs. (69), (132)-(145).
#pragma once

#include <cmath>

#include "cfp/core/numeric.hpp"
#include "cfp/core/types.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// The skew-symmetric matrix with hat(a) b = a x b.
template <typename Scalar>
[[nodiscard]] Matrix3<Scalar> hat(const Vector3<Scalar>& a) noexcept {
  const Scalar zero(0);
  return Matrix3<Scalar>{{zero, -a.z(), a.y()}, {a.z(), zero, -a.x()}, {-a.y(), a.x(), zero}};
}

/// I + a hat(w) + b hat(w)^2, the form of everything below.
template <typename Scalar>
[[nodiscard]] Matrix3<Scalar> so3_series(const Vector3<Scalar>& w, const Scalar& a, const Scalar& b) noexcept {
  const Matrix3<Scalar> W = hat(w);
  Matrix3<Scalar> M = a * W;
  M.noalias() += b * (W * W);
  M.diagonal().array() += Scalar(1);
  return M;
}

/// exp: rotation vector (axis times angle, rad) to rotation matrix: I + a hat(w) + b hat(w)^2 with
/// a = sin(t)/t, b = (1 - cos t)/t^2, t = |w|; Taylor expansion below Tolerance::small_angle. Never divides by zero.
template <typename Scalar = double>
[[nodiscard]] Matrix3<Scalar> so3_exp(const Vector3<Scalar>& w) noexcept {
  using std::sin;
  using std::sqrt;
  const Scalar t2 = w.squaredNorm();
  Scalar a, b;
  if (t2 > Scalar(Tolerance<Scalar>::small_angle) * Scalar(Tolerance<Scalar>::small_angle)) {
    const Scalar t = sqrt(t2);
    const Scalar half = sin(t * Scalar(0.5));
    a = sin(t) / t;
    b = Scalar(2) * half * half / t2;
  } else {
    a = Scalar(1) - t2 / Scalar(6);
    b = Scalar(0.5) - t2 / Scalar(24);
  }
  return so3_series(w, a, b);
}

/// The rotation matrix of the quaternion q = (x, y, z, w) over its length, in the order of Eigen's coefficients and of
/// TUM trajectories: a pose is {so3_from_quaternion(q), translation}. Not finite for a zero quaternion.
template <typename Scalar>
[[nodiscard]] Matrix3<Scalar> so3_from_quaternion(const Vector4<Scalar>& q) noexcept {
  const Vector3<Scalar> v = q.template head<3>();
  const Scalar twice = Scalar(2) / q.squaredNorm();
  return so3_series(v, Scalar(twice * q[3]), twice);
}

/// A quaternion (x, y, z, w) with w >= 0 of the rotation R, of unit length up to the error of R.
template <typename Scalar>
[[nodiscard]] Vector4<Scalar> quaternion(const Matrix3<Scalar>& R) noexcept {
  using std::sqrt;
  Matrix4<Scalar> Q;  // 4 q q^T
  Q(3, 3) = Scalar(1) + R.trace();
  Eigen::Index largest = 3;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const Eigen::Index j = (i + 1) % 3, k = (i + 2) % 3;
    Q(i, i) = Scalar(1) + R(i, i) - R(j, j) - R(k, k);
    Q(i, j) = Q(j, i) = R(j, i) + R(i, j);
    Q(i, 3) = Q(3, i) = R(k, j) - R(j, k);
    if (Q(i, i) > Q(largest, largest)) largest = i;
  }
  // The column of the largest number: no small one is divided by (Shepperd 1978).
  const Vector4<Scalar> q = Q.col(largest) * (Scalar(0.5) / sqrt(Q(largest, largest)));
  return q[3] < Scalar(0) ? Vector4<Scalar>(-q) : q;
}

/// log: rotation matrix to rotation vector with angle in [0, pi] (at pi one of the two axes). Goes through the
/// quaternion, so it is exact near 0 and near pi; a matrix that is not quite a rotation gives the vector of a nearby
/// one.
template <typename Scalar>
[[nodiscard]] Vector3<Scalar> so3_log(const Matrix3<Scalar>& R) noexcept {
  using std::atan2;
  using std::sqrt;
  const Vector4<Scalar> q = quaternion(R);
  const Vector3<Scalar> v = q.template head<3>();
  const Scalar n2 = v.squaredNorm();
  if (n2 > Scalar(Tolerance<Scalar>::small_angle) * Scalar(Tolerance<Scalar>::small_angle)) {
    const Scalar n = sqrt(n2);
    return (Scalar(2) * atan2(n, q[3]) / n) * v;
  }
  const Scalar inv_w = Scalar(1) / q[3];
  return (Scalar(2) * inv_w - Scalar(2) / Scalar(3) * n2 * inv_w * inv_w * inv_w) * v;
}

/// Left Jacobian of SO(3): exp(w + d) ~ exp(J_l(w) d) exp(w); also the factor between the translational tangent and the
/// translation in the SE(3) exponential. I + b hat(w) + c hat(w)^2, c = (t - sin t)/t^3. It has an inverse for |w| < 2
/// pi.
template <typename Scalar>
[[nodiscard]] Matrix3<Scalar> so3_left_jacobian(const Vector3<Scalar>& w) noexcept {
  using std::sin;
  using std::sqrt;
  const Scalar t2 = w.squaredNorm();
  Scalar b, c;
  // The difference t - sin t cancels well above small_angle. Below 0.1 rad the four-term series is exact for both
  // scalars.
  if (t2 > Scalar(1e-2)) {
    const Scalar t = sqrt(t2);
    const Scalar half = sin(t * Scalar(0.5));
    b = Scalar(2) * half * half / t2;
    c = (t - sin(t)) / (t2 * t);
  } else {
    b = Scalar(0.5) - t2 / Scalar(24) * (Scalar(1) - t2 / Scalar(30) * (Scalar(1) - t2 / Scalar(56)));
    c = Scalar(1) / Scalar(6) - t2 / Scalar(120) * (Scalar(1) - t2 / Scalar(42) * (Scalar(1) - t2 / Scalar(72)));
  }
  return so3_series(w, b, c);
}

/// The rotation of R's normalised quaternion: to first order the nearest one to an R that is nearly a rotation. Removes
/// the drift that products of many rotations collect.
template <typename Scalar>
[[nodiscard]] Matrix3<Scalar> normalized_rotation(const Matrix3<Scalar>& R) noexcept {
  return so3_from_quaternion(quaternion(R));
}

}  // namespace CFP_ISA
}  // namespace cfp
