/// @file epipolar.hpp
/// Epipolar geometry of two views: F from a pose, epipolar lines and the distances of correspondences to them (paper
/// sections IV-B and IV-D), and the homography that remains if the camera only turns. Convention: x_cur^T F x_prev = 0,
/// with pixels of an undistorted image.
///
/// A distance is >= 0 and finite, or `no_distance` (-1) where there is none: the line is undefined (A = B = 0 up to
/// rounding: the point is at the epipole, F is zero or not finite), or a coordinate is not finite. No distance depends
/// on the scale of F.
#pragma once

#include <cmath>

#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/geometry/distance.hpp"
#include "cfp/geometry/flow_pairs.hpp"
#include "cfp/math/matrix3.hpp"
#include "cfp/math/se3.hpp"

namespace cfp {

/// Of the entries of a fundamental matrix of unit norm, row by row, in pixels; zero: it is exact.
using FundamentalCovariance = Eigen::Matrix<double, 9, 9, Eigen::DontAlign>;

inline namespace CFP_ISA {

/// The line (A, B, C) = F x_prev in the current image: A u + B v + C = 0.
template <typename Scalar>
[[nodiscard]] CFP_INLINE Vector3<Scalar> epipolar_line(const Matrix3<Scalar>& F,
                                                       const Vector2<Scalar>& x_prev) noexcept {
  return F.col(0) * x_prev.x() + F.col(1) * x_prev.y() + F.col(2);
}

}  // namespace CFP_ISA

namespace detail {
inline namespace CFP_ISA {

/// F over its largest coefficient, so that squares neither over- nor underflow; zero when F is zero or not finite.
template <typename Scalar>
[[nodiscard]] Matrix3<Scalar> unit_scale(const Matrix3<Scalar>& F) noexcept {
  const Scalar largest = F.cwiseAbs().maxCoeff();
  if (!F.allFinite() || !(largest > Scalar(0))) return Matrix3<Scalar>::Zero();
  return F / largest;
}

/// Per column of F and unit of u, v and 1: the square of the size below which what it adds to the normal of the line
/// F (u, v, 1) is rounding noise.
template <typename Scalar>
[[nodiscard]] Vector3<Scalar> line_noise(const Matrix3<Scalar>& F) noexcept {
  const Scalar tolerance(Tolerance<Scalar>::degenerate);
  return (tolerance * F.template topRows<2>()).colwise().squaredNorm().transpose();
}

/// epipolar_distance for an F of unit_scale, whose line_noise is given.
template <typename Scalar>
[[nodiscard]] CFP_INLINE Scalar scaled_epipolar_distance(const Matrix3<Scalar>& F, const Vector3<Scalar>& noise,
                                                         const Vector2<Scalar>& x_prev,
                                                         const Vector2<Scalar>& x_cur) noexcept {
  using std::abs;
  using std::sqrt;
  const Vector3<Scalar> line = epipolar_line(F, x_prev);
  const Scalar norm_sq = line.x() * line.x() + line.y() * line.y();
  const Scalar noise_sq = noise.x() * x_prev.x() * x_prev.x() + noise.y() * x_prev.y() * x_prev.y() + noise.z();
  if (!(norm_sq > noise_sq)) return Scalar(no_distance<double>);
  const Scalar distance = abs(line.x() * x_cur.x() + line.y() * x_cur.y() + line.z()) / sqrt(norm_sq);
  return has_distance(distance) ? distance : Scalar(no_distance<double>);
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// F = K_cur^-T [t]x R K_prev^-1. The scale is that of t in metres; zero when t is zero, which every distance then
/// reports.
template <typename Scalar>
[[nodiscard]] Matrix3<Scalar> fundamental_from_pose(const PinholeCamera<Scalar>& camera_prev,
                                                    const PinholeCamera<Scalar>& camera_cur,
                                                    const SE3<Scalar>& T_cur_prev) noexcept {
  const Matrix3<Scalar> E = hat(T_cur_prev.translation) * T_cur_prev.rotation;
  return inverse(camera_cur.matrix()).transpose() * E * inverse(camera_prev.matrix());
}
template <typename Scalar>
[[nodiscard]] Matrix3<Scalar> fundamental_from_pose(const PinholeCamera<Scalar>& camera,
                                                    const SE3<Scalar>& T_cur_prev) noexcept {
  return fundamental_from_pose(camera, camera, T_cur_prev);
}

/// The motion of the whole image when the camera turns by R (of T_cur_prev), where there is no F: K R K^-1 with the
/// camera matrix K. For the box tracker, which knows nothing of the camera.
template <typename Scalar>
[[nodiscard]] Matrix3<Scalar> rotation_homography(const PinholeCamera<Scalar>& camera,
                                                  const Matrix3<non_deduced<Scalar>>& R) noexcept {
  return camera.matrix() * R * inverse(camera.matrix());
}

/// The paper's d = |x_cur^T F x_prev| / sqrt(A^2 + B^2), (A, B, C) = F x_prev: distance in pixels of the current point
/// to the line of the previous one. no_distance where sqrt(A^2 + B^2) is below Tolerance::degenerate times the size of
/// the terms it is summed from: such a line is rounding noise.
template <typename Scalar>
[[nodiscard]] Scalar epipolar_distance(const Matrix3<Scalar>& F, const Vector2<Scalar>& x_prev,
                                       const Vector2<Scalar>& x_cur) noexcept {
  const Matrix3<Scalar> G = detail::unit_scale(F);
  return detail::scaled_epipolar_distance(G, detail::line_noise(G), x_prev, x_cur);
}

/// epipolar_distance of every correspondence. Allocates nothing.
template <typename Scalar>
void epipolar_distances(const Matrix3<Scalar>& F, const PointSpan<non_deduced<Scalar>, 2>& prev,
                        const PointSpan<non_deduced<Scalar>, 2>& cur, span<non_deduced<Scalar>> out) noexcept {
  CFP_ASSERT(prev.size() == cur.size() && prev.size() == out.size());
  const Matrix3<Scalar> G = detail::unit_scale(F);
  const Vector3<Scalar> noise = detail::line_noise(G);
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = detail::scaled_epipolar_distance(G, noise, prev[i], cur[i]);
}

/// The same of pairs, each over its relative_sigma: the distances of all pairs are on one scale.
template <typename Scalar>
void epipolar_distances(const Matrix3<Scalar>& F, const FlowPairs<non_deduced<Scalar>>& pairs,
                        span<non_deduced<Scalar>> out) noexcept {
  CFP_ASSERT(detail::fits(out.size(), pairs.relative_sigmas));
  epipolar_distances(F, pairs.previous, pairs.current, out);
  for (std::size_t i = 0; i < pairs.relative_sigmas.size(); ++i) out[i] /= pairs.relative_sigmas[i];
}

/// The same under an F of unit norm with a covariance: a deviation within the error of the line does not count,
///
///   d / sqrt(1 + a^T C a / (sigma^2 (A^2 + B^2))),
///
/// a the entries of x_cur x_prev^T row by row, C the covariance of F, sigma = sigma_px relative_sigma > 0. F is
/// uncertain where it had no pairs: for points nearer than all of them, or beside them. Not in the paper.
template <typename Scalar>
void epipolar_distances(const Matrix3<Scalar>& F, const FundamentalCovariance& covariance,
                        const non_deduced<Scalar>& sigma_px, const FlowPairs<non_deduced<Scalar>>& pairs,
                        span<non_deduced<Scalar>> out) noexcept {
  epipolar_distances(F, pairs, out);
  if (covariance.isZero(0)) return;
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (!has_distance(out[i])) continue;
    const Vector2<Scalar> previous = pairs.previous[i], current = pairs.current[i];
    const Vector3<double> p(static_cast<double>(previous[0]), static_cast<double>(previous[1]), 1),
        q(static_cast<double>(current[0]), static_cast<double>(current[1]), 1);
    const Matrix3<double> transposed = p * q.transpose();
    const Eigen::Map<const Eigen::Matrix<double, 9, 1>> a(transposed.data());
    const double sigma = static_cast<double>(sigma_px * pairs.relative_sigma(i)),
                 normal_sq = static_cast<double>(epipolar_line(F, previous).template head<2>().squaredNorm()),
                 variance = a.dot(covariance.lazyProduct(a)) / (sigma * sigma * normal_sq);
    out[i] /= static_cast<Scalar>(std::sqrt(1 + variance));
  }
}

}  // namespace CFP_ISA
}  // namespace cfp
