/// @file epipolar.hpp
/// Epipolar geometry of two views: F from a pose, epipolar lines and the distances of correspondences to them (paper
/// sections IV-B and IV-D). Convention: x_cur^T F x_prev = 0, with pixels of an undistorted image.
///
/// A distance is >= 0 and finite, or `no_distance` (-1) where there is none: the line is undefined (A = B = 0 up to
/// rounding: the point is at the epipole, F is zero or not finite), or a coordinate is not finite. No distance depends
/// on the scale of F.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>

#include <Eigen/Core>
#include <Eigen/LU>

#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/geometry/distance.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/simd/chunk.hpp"

namespace cfp {

/// E = [t]x R of T_cur_prev = (R, t): y_cur^T E y_prev = 0 for rays y = K^-1 x. Zero when t is zero.
template <typename Scalar>
[[nodiscard]] Matrix3<Scalar> essential_from_pose(const SE3<Scalar>& T_cur_prev) noexcept {
  return hat(T_cur_prev.translation) * T_cur_prev.rotation;
}

/// F = K_cur^-T [t]x R K_prev^-1. The scale is that of t in metres; zero when t is zero, which every distance then
/// reports.
template <typename Scalar>
[[nodiscard]] Matrix3<Scalar> fundamental_from_pose(const Matrix3<Scalar>& K_prev, const Matrix3<Scalar>& K_cur,
                                                    const SE3<Scalar>& T_cur_prev) noexcept {
  return K_cur.inverse().transpose() * essential_from_pose(T_cur_prev) * K_prev.inverse();
}
template <typename Scalar>
[[nodiscard]] Matrix3<Scalar> fundamental_from_pose(const PinholeCamera<Scalar>& camera_prev,
                                                    const PinholeCamera<Scalar>& camera_cur,
                                                    const SE3<Scalar>& T_cur_prev) noexcept {
  return fundamental_from_pose(camera_prev.matrix(), camera_cur.matrix(), T_cur_prev);
}
template <typename Scalar>
[[nodiscard]] Matrix3<Scalar> fundamental_from_pose(const PinholeCamera<Scalar>& camera,
                                                    const SE3<Scalar>& T_cur_prev) noexcept {
  return fundamental_from_pose(camera, camera, T_cur_prev);
}

/// The line (A, B, C) = F x_prev in the current image: A u + B v + C = 0.
template <typename Scalar>
[[nodiscard]] Vector3<Scalar> epipolar_line(const Matrix3<Scalar>& F, const Vector2<Scalar>& x_prev) noexcept {
  return F.col(0) * x_prev.x() + F.col(1) * x_prev.y() + F.col(2);
}

/// |A u + B v + C| / sqrt(A^2 + B^2) in pixels; no_distance when A = B = 0 or the result is not finite.
template <typename Scalar>
[[nodiscard]] Scalar point_line_distance(const Vector3<Scalar>& line, const Vector2<Scalar>& point) noexcept {
  const Scalar numerator = line.x() * point.x() + line.y() * point.y() + line.z();
  return detail::ratio_distance(numerator, line.x() * line.x() + line.y() * line.y(), Scalar(0));
}

/// The paper's d = |x_cur^T F x_prev| / sqrt(A^2 + B^2), (A, B, C) = F x_prev: distance in pixels of the current point
/// to the line of the previous one. no_distance where sqrt(A^2 + B^2) is below Tolerance::degenerate times the size of
/// the terms it is summed from: such a line is rounding noise.
template <typename Scalar>
[[nodiscard]] Scalar epipolar_distance(const Matrix3<Scalar>& F, const Vector2<Scalar>& x_prev,
                                       const Vector2<Scalar>& x_cur) noexcept {
  const Matrix3<Scalar> G = detail::unit_scale(F);
  const Vector3<Scalar> line = epipolar_line(G, x_prev);
  const Scalar noise = detail::line_noise(G) * (x_prev.squaredNorm() + Scalar(1));
  return detail::ratio_distance(line.x() * x_cur.x() + line.y() * x_cur.y() + line.z(),
                                line.x() * line.x() + line.y() * line.y(), noise);
}

/// Mean of the distances in both images, in pixels: invariant when the two views change roles (F becomes F^T).
/// no_distance when either has none.
template <typename Scalar>
[[nodiscard]] Scalar symmetric_epipolar_distance(const Matrix3<Scalar>& F, const Vector2<Scalar>& x_prev,
                                                 const Vector2<Scalar>& x_cur) noexcept {
  const Scalar in_cur = epipolar_distance(F, x_prev, x_cur);
  const Scalar in_prev = epipolar_distance(Matrix3<Scalar>(F.transpose()), x_cur, x_prev);
  return has_distance(in_cur) && has_distance(in_prev) ? Scalar(0.5) * in_cur + Scalar(0.5) * in_prev
                                                       : Scalar(no_distance<double>);
}

/// |x_cur^T F x_prev| / sqrt(A^2 + B^2 + A'^2 + B'^2), (A', B', C') = F^T x_cur: to first order the distance in pixels
/// of the pair to the nearest pair that fulfils the constraint (Sampson). Hartley, Zisserman, 2nd ed., eq. (11.9).
template <typename Scalar>
[[nodiscard]] Scalar sampson_distance(const Matrix3<Scalar>& F, const Vector2<Scalar>& x_prev,
                                      const Vector2<Scalar>& x_cur) noexcept {
  const Matrix3<Scalar> G = detail::unit_scale(F);
  const Matrix3<Scalar> G_transposed = G.transpose();
  const Vector3<Scalar> line = epipolar_line(G, x_prev);
  const Vector3<Scalar> line_prev = epipolar_line(G_transposed, x_cur);
  const Scalar norm_sq =
      line.x() * line.x() + line.y() * line.y() + line_prev.x() * line_prev.x() + line_prev.y() * line_prev.y();
  const Scalar noise = detail::line_noise(G) * (x_prev.squaredNorm() + Scalar(1)) +
                       detail::line_noise(G_transposed) * (x_cur.squaredNorm() + Scalar(1));
  return detail::ratio_distance(line.x() * x_cur.x() + line.y() * x_cur.y() + line.z(), norm_sq, noise);
}

/// epipolar_distance of every correspondence; equal to the scalar function up to a few roundings. Vectorised; allocates
/// nothing; the result of a pair does not depend on its place in the arrays.
template <typename Scalar>
void epipolar_distances(const Matrix3<Scalar>& F, const PointSpan<non_deduced<Scalar>, 2>& prev,
                        const PointSpan<non_deduced<Scalar>, 2>& cur, span<non_deduced<Scalar>> out) noexcept {
  CFP_ASSERT(prev.size() == cur.size() && prev.size() == out.size());
  const Matrix3<Scalar> G = detail::unit_scale(F);
  const Scalar noise = detail::line_noise(G);
  using Chunk = detail::Chunk<Scalar>;
  detail::for_each_chunk(out.size(), [&](std::size_t first, std::size_t count) {
    Chunk u_prev, v_prev, u, v;
    detail::load_chunk(prev, first, count, u_prev, v_prev);
    detail::load_chunk(cur, first, count, u, v);
    const Chunk a = G(0, 0) * u_prev + G(0, 1) * v_prev + G(0, 2);
    const Chunk b = G(1, 0) * u_prev + G(1, 1) * v_prev + G(1, 2);
    const Chunk numerator = a * u + b * v + (G(2, 0) * u_prev + G(2, 1) * v_prev + G(2, 2));
    const Chunk norm_sq = a * a + b * b;
    const Chunk threshold = noise * (u_prev * u_prev + v_prev * v_prev + Scalar(1));
    Chunk distance = numerator.abs() / norm_sq.sqrt();
    for (Eigen::Index i = 0; i < distance.size(); ++i) {
      const Scalar d = distance[i] <= (std::numeric_limits<Scalar>::max)() ? distance[i] : no_distance<Scalar>;
      distance[i] = norm_sq[i] > threshold[i] ? d : no_distance<Scalar>;
    }
    detail::store_chunk(distance, first, count, out);
  });
}

}  // namespace cfp
