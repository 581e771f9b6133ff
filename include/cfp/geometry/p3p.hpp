/// @file p3p.hpp
/// Camera pose from three points: the minimal absolute pose problem, all real solutions.
/// Source: Persson and Nordberg: "Lambda Twist: an accurate fast robust perspective three point (P3P) solver", ECCV
/// 2018.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include <Eigen/Core>
#include <Eigen/LU>

#include "cfp/core/span.hpp"
#include "cfp/core/status.hpp"
#include "cfp/math/cubic.hpp"
#include "cfp/math/se3.hpp"

namespace cfp {

/// Up to four poses.
template <typename Scalar>
struct P3PSolutions {
  std::array<SE3<Scalar>, 4> T_cam_world;  ///< the first `count` are set
  int count = 0;
  Status status =
      Status::degenerate;  ///< ok, degenerate (collinear or coincident points or rays) or invalid_input (not finite)
};

}  // namespace cfp

#include "cfp/geometry/p3p_impl.hpp"

namespace cfp {

/// Every pose with rotation * world[i] + translation on ray[i], in front of the camera, i = 0, 1, 2. Rays of any length
/// > 0, in the camera frame (PinholeCamera::unproject), points in metres or any other unit. Depths solve three
/// quadrics; their pencil holds a pair of planes, which leaves two quadratic equations; the depths are then polished by
/// Newton steps. Solutions of the same pose (a double root) may be listed twice. Status::ok with count 0: the three
/// rays fit no such triangle. Works in double; allocates nothing; one to three microseconds.
template <typename Scalar>
[[nodiscard]] P3PSolutions<Scalar> p3p(span<const Vector3<Scalar>> rays, span<const Vector3<Scalar>> world) noexcept {
  CFP_ASSERT(rays.size() == 3 && world.size() == 3);
  P3PSolutions<Scalar> result;
  Vector3<double> y[3], x[3];
  double size = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    y[i] = rays[i].template cast<double>();
    x[i] = world[i].template cast<double>();
    const double largest = y[i].cwiseAbs().maxCoeff();
    size = (std::max)(size, (x[i] - x[0]).cwiseAbs().maxCoeff());
    if (!y[i].allFinite() || !x[i].allFinite() || !is_finite(size)) {
      result.status = Status::invalid_input;
      return result;
    }
    if (!(largest > 0)) return result;
    y[i] = (y[i] / largest).normalized();
  }
  const Vector3<double> origin = x[0];
  // Relative coordinates of unit size: squares neither overflow nor vanish, and the thresholds have no unit.
  for (Vector3<double>& point : x) point = (point - origin) / size;
  if (!(size > 0) || !(x[1].cross(x[2]).norm() > 1e-10) || !(std::abs(y[0].dot(y[1].cross(y[2]))) > 1e-12))
    return result;

  result.status = Status::ok;
  double depths[4][3];
  const int count = detail::p3p_depths(y, x, depths);
  const Matrix3<double> inverse_frame = detail::triangle_frame(x[1], x[2]).inverse();
  for (int k = 0; k < count; ++k) {
    const Vector3<double> first = depths[k][0] * y[0];
    const Matrix3<double> R =
        detail::triangle_frame(depths[k][1] * y[1] - first, depths[k][2] * y[2] - first) * inverse_frame;
    const Vector3<double> t = size * first - R * origin;
    if (!R.allFinite() || !t.template cast<Scalar>().allFinite()) continue;
    SE3<Scalar>& T = result.T_cam_world[static_cast<std::size_t>(result.count++)];
    T.rotation = normalized_rotation<double>(R).template cast<Scalar>();
    T.translation = t.template cast<Scalar>();
  }
  return result;
}

}  // namespace cfp
