/// @file radial_tangential_camera.hpp
/// Pinhole camera with radial and tangential (Brown-Conrady) distortion, coefficients in OpenCV's order and meaning.
#pragma once

#include <cmath>
#include <limits>

#include <Eigen/Core>

#include "cfp/core/numeric.hpp"
#include "cfp/geometry/camera.hpp"

namespace cfp {

namespace detail {

/// Whether 1 + a s + b s^2 + c s^3 > 0 for every s in [0, end].
template <typename Scalar>
[[nodiscard]] bool stays_positive(const Scalar& a, const Scalar& b, const Scalar& c, const Scalar& end) noexcept {
  using std::sqrt;
  const Scalar zero(0);
  const auto value = [&](const Scalar& s) { return Scalar(1) + s * (a + s * (b + s * c)); };
  const auto negative = [&](const Scalar& x) { return x < zero ? x : zero; };
  // The sum of the negative terms at the end is a lower bound over the interval; it settles all but extreme pixels.
  if (Scalar(1) + end * (negative(a) + end * (negative(b) + end * negative(c))) > zero) return true;
  if (!(value(end) > zero)) return false;
  // Else the minimum may lie inside, where the derivative a + 2 b s + 3 c s^2 vanishes.
  const Scalar discriminant = b * b - Scalar(3) * a * c;
  if (!(discriminant >= zero)) return true;
  const Scalar q = b < zero ? Scalar(sqrt(discriminant) - b) : Scalar(-b - sqrt(discriminant));  // the sum without cancellation
  for (const Scalar& s : {Scalar(q / (Scalar(3) * c)), Scalar(a / q)}) {
    if (s > zero && s < end && !(value(s) > zero)) return false;
  }
  return true;
}

}  // namespace detail

/// With x, y = X/Z, Y/Z and s = x^2 + y^2:
///   x' = x (1 + k1 s + k2 s^2 + k3 s^3) + 2 p1 x y + p2 (s + 2 x^2)
///   y' = y (1 + k1 s + k2 s^2 + k3 s^3) + p1 (s + 2 y^2) + 2 p2 x y
///   u = fx x' + cx, v = fy y' + cy.
///
/// The polynomial is a model of the lens only up to its fold, where a larger angle begins to give a smaller radius: beyond
/// it several rays share a pixel. Points beyond the fold (the radial derivative 1 + 3 k1 s + 5 k2 s^2 + 7 k3 s^3 has met
/// zero between the axis and s, or the full Jacobian has no positive determinant) are not projected.
template <typename Scalar>
struct RadialTangentialCamera {
  using ScalarType = Scalar;
  Scalar fx = Scalar(1);  ///< focal length in pixels, > 0
  Scalar fy = Scalar(1);  ///< focal length in pixels, > 0
  Scalar cx = Scalar(0);  ///< principal point in pixels
  Scalar cy = Scalar(0);
  Scalar k1 = Scalar(0);  ///< radial
  Scalar k2 = Scalar(0);
  Scalar p1 = Scalar(0);  ///< tangential
  Scalar p2 = Scalar(0);
  Scalar k3 = Scalar(0);  ///< radial, sixth order; last, as in OpenCV

  /// The same camera without its distortion: where the pixels of an undistorted image belong, as epipolar lines need them.
  [[nodiscard]] PinholeCamera<Scalar> pinhole() const noexcept { return {fx, fy, cx, cy}; }

  /// Distorts a point of the plane z = 1. Returns false, and touches nothing, beyond the fold or when not finite.
  bool distort(const Vector2<Scalar>& plane, Vector2<Scalar>& distorted, Matrix2<Scalar>& jacobian) const noexcept {
    const Scalar x = plane.x();
    const Scalar y = plane.y();
    const Scalar s = x * x + y * y;
    const Scalar radial = Scalar(1) + s * (k1 + s * (k2 + s * k3));
    const Scalar twice_slope = Scalar(2) * (k1 + s * (Scalar(2) * k2 + s * Scalar(3) * k3));  // of `radial` along x is x times this
    const Scalar xd = x * radial + Scalar(2) * p1 * x * y + p2 * (s + Scalar(2) * x * x);
    const Scalar yd = y * radial + p1 * (s + Scalar(2) * y * y) + Scalar(2) * p2 * x * y;
    const Scalar j00 = radial + x * x * twice_slope + Scalar(2) * p1 * y + Scalar(6) * p2 * x;
    const Scalar j01 = x * y * twice_slope + Scalar(2) * p1 * x + Scalar(2) * p2 * y;
    const Scalar j11 = radial + y * y * twice_slope + Scalar(6) * p1 * y + Scalar(2) * p2 * x;
    if (!is_finite(xd) || !is_finite(yd) || !(j00 * j11 - j01 * j01 > Scalar(0))) return false;
    if (!detail::stays_positive(Scalar(3) * k1, Scalar(5) * k2, Scalar(7) * k3, s)) return false;
    distorted << xd, yd;
    jacobian << j00, j01, j01, j11;
    return true;
  }

  /// Projects a point of the camera frame. Returns whether the projection is valid: z > Tolerance::min_depth, before the
  /// fold, a finite pixel; otherwise pixel and jacobian are left as they were. jacobian: d pixel / d point.
  bool project(const Vector3<Scalar>& point, Vector2<Scalar>& pixel, Matrix23<Scalar>* jacobian = nullptr) const noexcept {
    if (!(point.z() > Scalar(Tolerance<Scalar>::min_depth))) return false;
    const Scalar inv_z = Scalar(1) / point.z();
    const Vector2<Scalar> plane(point.x() * inv_z, point.y() * inv_z);
    Vector2<Scalar> distorted;
    Matrix2<Scalar> D;
    if (!distort(plane, distorted, D)) return false;
    const Scalar u = fx * distorted.x() + cx;
    const Scalar v = fy * distorted.y() + cy;
    if (!is_finite(u) || !is_finite(v)) return false;
    // Not a comma initialiser: g++ 12.2 at -O3 -DNDEBUG loses the second coordinate of one inlined into a loop.
    pixel[0] = u;
    pixel[1] = v;
    if (jacobian != nullptr) {
      D.row(0) *= fx * inv_z;
      D.row(1) *= fy * inv_z;
      jacobian->template leftCols<2>() = D;
      jacobian->col(2) = -D.col(0) * plane.x() - D.col(1) * plane.y();
    }
    return true;
  }

  /// The ray through a pixel, scaled to z = 1, by Newton's method with step halving. False, and ray untouched, when no ray
  /// before the fold gives the pixel, or anything is not finite. At most 40 evaluations of the model.
  bool unproject(const Vector2<Scalar>& pixel, Vector3<Scalar>& ray) const noexcept {
    using std::sqrt;
    const Vector2<Scalar> target((pixel.x() - cx) / fx, (pixel.y() - cy) / fy);
    if (!is_finite(target.x()) || !is_finite(target.y())) return false;
    const Scalar tolerance = Scalar(16) * Scalar(std::numeric_limits<Scalar>::epsilon()) * (Scalar(1) + sqrt(target.squaredNorm()));
    Vector2<Scalar> plane = target;
    Vector2<Scalar> distorted;
    Matrix2<Scalar> D;
    int evaluations = 1;
    // The pixel's own position can lie beyond the fold; some point towards the axis does not.
    while (!distort(plane, distorted, D)) {
      if (++evaluations > 20) return false;
      plane *= Scalar(0.5);
    }
    Vector2<Scalar> residual = target - distorted;
    Scalar error_sq = residual.squaredNorm();
    while (!(error_sq <= tolerance * tolerance)) {
      const Scalar inv_determinant = Scalar(1) / (D(0, 0) * D(1, 1) - D(0, 1) * D(1, 0));
      Vector2<Scalar> step((D(1, 1) * residual.x() - D(0, 1) * residual.y()) * inv_determinant,
                           (D(0, 0) * residual.y() - D(1, 0) * residual.x()) * inv_determinant);
      for (;;) {
        if (++evaluations > 40) return false;
        const Vector2<Scalar> candidate = plane + step;
        if (distort(candidate, distorted, D)) {
          const Vector2<Scalar> left = target - distorted;
          if (left.squaredNorm() < error_sq) {
            plane = candidate;
            residual = left;
            error_sq = left.squaredNorm();
            break;
          }
        }
        step *= Scalar(0.5);
      }
    }
    ray << plane.x(), plane.y(), Scalar(1);
    return true;
  }
};

}  // namespace cfp
