/// @file p3p.hpp
/// Camera pose from three points: the minimal absolute pose problem, all real solutions.
/// Source: Ding, Yang, Larsson, Olsson, Astrom: "Revisiting the P3P problem", CVPR 2023 (degenerate conic, pair of
/// lines); Persson, Nordberg: "Lambda Twist: an accurate fast robust perspective three point (P3P) solver", ECCV 2018
/// (polish of the depths). Departure: unknowns in which a small triangle far away is as regular as any other.
#pragma once

#include <array>
#include <cmath>

#include "cfp/core/status.hpp"
#include "cfp/core/types.hpp"
#include "cfp/geometry/p3p_impl.hpp"
#include "cfp/math/matrix3.hpp"
#include "cfp/math/se3.hpp"

namespace cfp {

/// Three points and the rays on which a camera sees them.
template <typename Scalar>
struct P3PProblem {
  std::array<Vector3<Scalar>, 3> world;  ///< in metres or any other unit
  std::array<Vector3<Scalar>, 3> rays;   ///< in the camera frame, of any length (PinholeCamera::unproject)
};

/// Up to four poses.
template <typename Scalar>
struct P3PSolutions {
  std::array<SE3<Scalar>, 4> T_cam_world;  ///< the first `count` are set
  int count = 0;
  /// ok: count > 0. degenerate: the points are collinear or coincide, or no pose puts such a triangle on these rays.
  /// invalid_input: a coordinate is not finite or beyond 1e100.
  Status status = Status::degenerate;
};

inline namespace CFP_ISA {

/// Every pose with rotation * world[i] + translation on ray[i], in front of the camera, i = 0, 1, 2. The same pose may
/// be listed twice where two solutions meet. Rotations are so to 1e-6. A triangle counts as collinear when its height
/// is below 5e-8 of its longest edge; rays may coincide or lie in one plane. Computes in double; allocates nothing.
template <typename Scalar>
[[nodiscard]] P3PSolutions<Scalar> p3p(const P3PProblem<Scalar>& problem) noexcept {
  using Real = decltype(Scalar() + double());
  P3PSolutions<Scalar> result;
  Vector3<Real> x[3], y[3];
  Real magnitude = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    x[i] = problem.world[i].template cast<Real>();
    y[i] = problem.rays[i].template cast<Real>();
    const Real square = y[i].squaredNorm();
    magnitude += square + x[i].squaredNorm();
    y[i] *= Real(1) / std::sqrt(square);  // not finite for a ray without direction: that one has no solution
  }
  if (!(magnitude < Real(1e200))) {
    result.status = Status::invalid_input;
    return result;
  }
  // Number k belongs to the edge opposite to point k; point i0 is opposite to the longest.
  const Real edges[3] = {(x[2] - x[1]).squaredNorm(), (x[0] - x[2]).squaredNorm(), (x[1] - x[0]).squaredNorm()};
  const Real chords[3] = {(y[2] - y[1]).squaredNorm(), (y[0] - y[2]).squaredNorm(), (y[1] - y[0]).squaredNorm()};
  int i0 = edges[1] > edges[0] ? 1 : 0;
  i0 = edges[2] > edges[i0] ? 2 : i0;
  const int i1 = i0 == 2 ? 0 : i0 + 1, i2 = i0 == 0 ? 2 : i0 - 1;
  const Real inverse = Real(1) / edges[i0], a = edges[i2] * inverse, b = edges[i1] * inverse;
  // By Heron, the squared height over the longest edge in units of it.
  const Real excess = a + b - Real(1), height_sq = a * b - Real(0.25) * excess * excess;
  if (!(height_sq > Real(2.5e-15))) return result;
  detail::Triple<Real> solutions[4];
  const int count = detail::p3p_depths<Real>({a, b, chords[i2], chords[i1], chords[i0]}, solutions);

  // Orthonormal axes of the triangle: along the longest edge, across it, normal.
  const Real length = std::sqrt(edges[i0]), inverse_length = Real(1) / length;
  const Vector3<Real> x01 = x[i1] - x[i0], along = inverse_length * (x[i2] - x[i1]);
  const Real offset = along.dot(x01);
  Vector3<Real> across = x01 - offset * along;
  const Real inverse_height = Real(1) / std::sqrt(across.squaredNorm());
  across *= inverse_height;
  Matrix3<Real> world_axes;
  world_axes.col(0) = along, world_axes.col(1) = across, world_axes.col(2) = cross(along, across);
  const Vector3<Real> y01 = y[i1] - y[i0], y02 = y[i2] - y[i0];
  for (int k = 0; k < count; ++k) {
    const detail::Triple<Real>& p = solutions[k];
    const Real d0 = length * p.w;
    const Vector3<Real> edge01 = (length * p.u) * y[i1] + d0 * y01, edge02 = (length * p.v) * y[i2] + d0 * y02;
    // The same axes in the camera's frame, and what rounding left of their products.
    const Vector3<Real> X = inverse_length * (edge02 - edge01), Y = inverse_height * (edge01 - offset * X);
    const Real XX = X.squaredNorm(), YY = Y.squaredNorm(), XY = X.dot(Y);
    // A thin triangle enlarges what the depths leave open: half a thousandth is mended below, more is no solution.
    if (!(std::abs(XX - Real(1)) + std::abs(YY - Real(1)) + std::abs(XY) < Real(5e-4))) continue;
    const Vector3<Real> axis_x = (Real(1.5) - Real(0.5) * XX) * X, axis_y = (Real(1.5) - Real(0.5) * YY) * Y - XY * X;
    Matrix3<Real> axes;
    axes.col(0) = axis_x, axes.col(1) = axis_y, axes.col(2) = cross(axis_x, axis_y);
    const Matrix3<Real> R = axes * world_axes.transpose();
    const Vector3<Real> t = d0 * y[i0] - R * x[i0];
    if (!t.template cast<Scalar>().allFinite()) continue;
    SE3<Scalar>& T = result.T_cam_world[static_cast<std::size_t>(result.count++)];
    T.rotation = R.template cast<Scalar>();
    T.translation = t.template cast<Scalar>();
  }
  if (result.count > 0) result.status = Status::ok;
  return result;
}

}  // namespace CFP_ISA
}  // namespace cfp
