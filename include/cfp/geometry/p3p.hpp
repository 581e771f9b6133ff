/// @file p3p.hpp
/// Camera pose from three points: the minimal absolute pose problem, all real solutions.
/// Source: Ding, Yang, Larsson, Olsson, Astrom: "Revisiting the P3P problem", CVPR 2023 (degenerate conic, pair of
/// lines); Persson, Nordberg: "Lambda Twist: an accurate fast robust perspective three point (P3P) solver", ECCV 2018
/// (polish of the depths). Departure: unknowns in which a small triangle far away is as regular as any other.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "cfp/core/status.hpp"
#include "cfp/core/types.hpp"
#include "cfp/geometry/p3p_impl.hpp"
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
/// be listed twice where two solutions meet. A triangle counts as collinear when its height is below 5e-8 of its
/// longest edge; rays may coincide or lie in one plane. Computes in double; allocates nothing.
template <typename Scalar>
[[nodiscard]] P3PSolutions<Scalar> p3p(const P3PProblem<Scalar>& problem) noexcept {
  using Real = decltype(Scalar() + double());
  P3PSolutions<Scalar> result;
  Vector3<Real> x[3], y[3];
  for (std::size_t i = 0; i < 3; ++i) {
    x[i] = problem.world[i].template cast<Real>();
    y[i] = problem.rays[i].template cast<Real>();
    const Real length_sq = y[i].squaredNorm();
    if (!(length_sq < Real(1e200) && x[i].squaredNorm() < Real(1e200))) {
      result.status = Status::invalid_input;
      return result;
    }
    y[i] *= Real(1) / std::sqrt(length_sq);  // not finite for a ray without direction: that has no solution
  }
  Real l01 = (x[1] - x[0]).squaredNorm(), l02 = (x[2] - x[0]).squaredNorm(), l12 = (x[2] - x[1]).squaredNorm();
  if (l01 > l02 && l01 > l12) {
    std::swap(x[0], x[2]), std::swap(y[0], y[2]), std::swap(l01, l12);
  } else if (l02 > l12) {
    std::swap(x[0], x[1]), std::swap(y[0], y[1]), std::swap(l02, l12);
  }
  // The edge 12 is the longest now; its height squared in units of it is, by Heron, at least:
  const Real inverse_l12 = Real(1) / l12, a = l01 * inverse_l12, b = l02 * inverse_l12, excess = a + b - Real(1);
  if (!(a * b - Real(0.25) * excess * excess > Real(2.5e-15))) return result;
  const Vector3<Real> x01 = x[1] - x[0], x02 = x[2] - x[0], y01 = y[1] - y[0], y02 = y[2] - y[0];
  const Real chord = (y01.cwiseAbs() + y02.cwiseAbs()).sum(), inverse_chord = Real(1) / chord;
  if (!(chord > Real(1e-12))) return result;
  const Real square = inverse_chord * inverse_chord;
  const detail::P3PEquations<Real> equations{
      a, b, chord, square * y01.squaredNorm(), square * y02.squaredNorm(), square * (y[2] - y[1]).squaredNorm()};

  Vector3<Real> solutions[4];
  const int count = detail::p3p_depths(equations, solutions);
  const Real length = std::sqrt(l12), inverse_length = Real(1) / length;
  const Matrix3<Real> world_frame = detail::triangle_frame<Real>(x02 - x01, inverse_length, x01).transpose();
  for (int k = 0; k < count; ++k) {
    const Vector3<Real> p = length * solutions[k];
    const Real d0 = p[2] * inverse_chord;
    const Vector3<Real> edge01 = p[0] * y[1] + d0 * y01, edge02 = p[1] * y[2] + d0 * y02;
    const Matrix3<Real> R = detail::triangle_frame<Real>(edge02 - edge01, inverse_length, edge01) * world_frame;
    const Vector3<Real> t = d0 * y[0] - R * x[0];
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
