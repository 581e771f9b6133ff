/// @file motion_residual_impl.hpp
/// The linearised residual of a flow pair under the camera's motion, for distances and normal equations. Not an
/// interface.
#pragma once

#include <algorithm>
#include <cmath>

#include "cfp/core/numeric.hpp"
#include "cfp/core/types.hpp"
#include "cfp/geometry/depth_noise.hpp"
#include "cfp/math/matrix3.hpp"
#include "cfp/math/normal_equations.hpp"
#include "cfp/math/se3.hpp"

namespace cfp::detail {

/// What a pair says of a motion, in units of the noise.
struct PairTerm {
  double weight = 0;       // of a Geman-McClure loss; 0 of what is not finite
  double distance_sq = 0;  // Mahalanobis, of the noise and of the depth's error
  double coordinates = 0;  // effective measurements of the pixel: 2, down to 1 for an unknown depth
};

inline namespace CFP_ISA {

/// A flow pair against the camera's motion. For local use: alignment depends on flags.
template <typename Scalar>
struct MotionResidual {
  Vector2<Scalar> r;          // pixel_cur - project(p), px
  Vector2<Scalar> along;      // J = d project / d z, px/m
  Scalar sigma_z;             // of the depth, m
  Vector3<Scalar> point;      // in the current camera, m
  Matrix23<Scalar> jacobian;  // d project / d point

  [[nodiscard]] CFP_INLINE Eigen::Matrix<Scalar, 2, 6> M() const noexcept {  // d project / d xi
    Eigen::Matrix<Scalar, 2, 6> result;
    result.template leftCols<3>() = jacobian;
    for (int row = 0; row < 2; ++row) result.template block<1, 3>(row, 3) = cross(point, jacobian.row(row)).transpose();
    return result;
  }
};

/// At depth z. False for a pixel without a ray or a point behind the current camera.
template <typename Camera, typename Scalar>
[[nodiscard]] CFP_INLINE bool motion_residual(const Vector2<Scalar>& pixel_prev, const Scalar& z,
                                              const Vector2<Scalar>& pixel_cur, const SE3<Scalar>& T_cur_prev,
                                              const Camera& camera, MotionResidual<Scalar>& out) noexcept {
  Vector3<Scalar> ray;
  if (!camera.unproject(pixel_prev, ray)) return false;
  const Vector3<Scalar> turned = T_cur_prev.rotation * ray;
  out.point = turned * z + T_cur_prev.translation;
  Vector2<Scalar> projected;
  if (!camera.project(out.point, projected, &out.jacobian)) return false;
  out.r = pixel_cur - projected;
  out.along = out.jacobian.lazyProduct(turned);
  return true;
}

/// At the measured depth, or at the mean of an unknown one.
template <typename Camera, typename Scalar>
[[nodiscard]] CFP_INLINE bool expected_residual(const Vector2<Scalar>& pixel_prev, const Scalar& depth_prev,
                                                const Vector2<Scalar>& pixel_cur, const SE3<Scalar>& T_cur_prev,
                                                const Camera& camera, const MotionDistanceOptions& options,
                                                MotionResidual<Scalar>& out) noexcept {
  const bool measured = is_valid_depth(depth_prev);
  const Scalar z = measured ? depth_prev : Scalar(1 / options.unknown_depth.inverse_mean);
  out.sigma_z = measured ? Scalar(options.depth_noise.sigma_m(static_cast<double>(z)))
                         : z * z * Scalar(options.unknown_depth.inverse_sigma);
  return motion_residual(pixel_prev, z, pixel_cur, T_cur_prev, camera, out);
}

/// Linearised at the depth that fits the pair best among what is likely, a Gauss-Newton step from its inverse: with a
/// noisy depth H would have the square of its noise, and a motion would come out too short. r is what is left of a
/// measured depth's; of an unknown one's, r without what the depth explains: nothing tells the length of the motion.
template <typename Camera, typename Scalar>
[[nodiscard]] bool likely_residual(const Vector2<Scalar>& pixel_prev, const Scalar& depth_prev,
                                   const Vector2<Scalar>& pixel_cur, const SE3<Scalar>& T_cur_prev,
                                   const Camera& camera, const Scalar& sigma_px, const MotionDistanceOptions& options,
                                   MotionResidual<Scalar>& out) noexcept {
  if (!expected_residual(pixel_prev, depth_prev, pixel_cur, T_cur_prev, camera, options, out)) return false;
  const bool measured = is_valid_depth(depth_prev);
  const Scalar mean = measured ? 1 / depth_prev : Scalar(options.unknown_depth.inverse_mean);
  const Scalar variance = out.sigma_z * out.sigma_z, sigma = out.sigma_z * mean * mean;
  const Scalar farther = variance * out.along.dot(out.r) / (sigma_px * sigma_px + variance * out.along.squaredNorm());
  const Scalar inverse =
      std::clamp(mean - farther * mean * mean, (std::max)(mean / 50, mean - 6 * sigma), mean + 6 * sigma);
  const Scalar z = 1 / inverse;
  if (!motion_residual(pixel_prev, z, pixel_cur, T_cur_prev, camera, out)) return false;
  out.sigma_z = z * z * sigma;
  if (measured) {
    out.r += out.along * (z * z * (mean - inverse));
  } else {
    const Scalar spread = out.sigma_z / sigma_px;
    // r has lost a factor 1 + s^2, s = spread |along|, to the depth: W along the line is its square.
    out.sigma_z *= std::sqrt(2 + spread * spread * out.along.squaredNorm());
  }
  return true;
}

/// Adds a pair in units of the noise: H += w M^T W^-1 M, g -= w M^T W^-1 r, W of the noise and of the depth's error
/// along j, w of the loss at `moved`.
template <int N>
PairTerm add_pair(const Eigen::Matrix<double, 2, N>& M, const Vector2<double>& r, const Vector2<double>& j,
                  const Eigen::Matrix<double, N, 1>& moved, NormalEquations<N>& sums) noexcept {
  constexpr double loss_sq = 32;  // 4 sigma per coordinate
  const Vector2<double> e = r - M.lazyProduct(moved);
  const double kept = 1 / (1 + j[0] * j[0] + j[1] * j[1]), across = j[0] * e[1] - j[1] * e[0];
  const double distance_sq = (e[0] * e[0] + e[1] * e[1] + across * across) * kept;
  if (!is_finite(distance_sq)) return {};
  const double root = 1 / (1 + distance_sq / loss_sq), w = root * root;
  for (int a = 0; a < N; ++a) {
    const double share = (j[0] * M(0, a) + j[1] * M(1, a)) * kept;
    const double m0 = w * (M(0, a) - j[0] * share), m1 = w * (M(1, a) - j[1] * share);
    sums.g[a] -= m0 * r[0] + m1 * r[1];
    for (int b = a; b < N; ++b) sums.H(a, b) += m0 * M(0, b) + m1 * M(1, b);
  }
  return {w, distance_sq, 1 + kept};
}

/// The same of a pair against the motion alone.
template <typename Scalar>
PairTerm add_pair(const MotionResidual<Scalar>& pair, double sigma_px, const Vector6<double>& moved,
                  NormalEquations<6>& sums) noexcept {
  const Eigen::Matrix<double, 2, 6> M = pair.M().template cast<double>() / sigma_px;
  return add_pair<6>(M, pair.r.template cast<double>() / sigma_px,
                     (pair.along * pair.sigma_z).template cast<double>() / sigma_px, moved, sums);
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
