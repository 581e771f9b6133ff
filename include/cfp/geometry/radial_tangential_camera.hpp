/// @file radial_tangential_camera.hpp
/// Pinhole camera with radial and tangential (Brown-Conrady) distortion, coefficients in OpenCV's order and meaning.
#pragma once

#include <cmath>

#include "cfp/core/numeric.hpp"
#include "cfp/geometry/camera.hpp"

namespace cfp {

/// With x, y = X/Z, Y/Z and s = x^2 + y^2:
///   x' = x (1 + k1 s + k2 s^2 + k3 s^3) + 2 p1 x y + p2 (s + 2 x^2)
///   y' = y (1 + k1 s + k2 s^2 + k3 s^3) + p1 (s + 2 y^2) + 2 p2 x y
///   u = fx x' + cx, v = fy y' + cy.
///
/// The polynomial is a model of the lens only up to its fold, where a larger angle begins to give a smaller radius:
/// beyond it several rays share a pixel. Points beyond the fold (the radial derivative 1 + 3 k1 s + 5 k2 s^2 + 7 k3 s^3
/// has met zero between the axis and s, or the full Jacobian has no positive determinant) are not projected.
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

  /// The same camera without its distortion: where the pixels of an undistorted image belong, as epipolar lines need
  /// them.
  [[nodiscard]] CFP_INLINE PinholeCamera<Scalar> pinhole() const noexcept { return {fx, fy, cx, cy}; }

  /// Whether 1 + 3 k1 t + 5 k2 t^2 + 7 k3 t^3 > 0 for every t in [0, s], s finite.
  [[nodiscard]] CFP_INLINE bool rises_to(const Scalar& s) const noexcept {
    using std::sqrt;
    const Scalar zero(0), a = Scalar(3) * k1, b = Scalar(5) * k2, c = Scalar(7) * k3;
    const auto negative = [&](const Scalar& x) { return x < zero ? x : zero; };
    // The sum of the negative terms at the end is a lower bound over the interval; it settles all but extreme pixels.
    if (Scalar(1) + s * (negative(a) + s * (negative(b) + s * negative(c))) > zero) return true;
    // Else the end tells, or the minimum inside, where the derivative a + 2 b t + 3 c t^2 vanishes; NaN if nowhere.
    const Scalar root = sqrt(Scalar(b * b - Scalar(3) * a * c));
    const Scalar q = b < zero ? Scalar(root - b) : Scalar(-b - root);  // the sum without cancellation
    for (const Scalar& t : {s, Scalar(q / (Scalar(3) * c)), Scalar(a / q)}) {
      if (t >= zero && t <= s && !(Scalar(1) + t * (a + t * (b + t * c)) > zero)) return false;
    }
    return true;
  }

  /// Distorts the point (x, y) of the plane z = 1; false beyond the fold or when not finite.
  [[nodiscard]] CFP_INLINE bool distort(const Scalar& x, const Scalar& y,
                                        detail::DistortedPoint<Scalar>& d) const noexcept {
    const Scalar s = x * x + y * y;
    const Scalar radial = Scalar(1) + s * (k1 + s * (k2 + s * k3));
    // The slope of `radial` along x is x times this, along y y times this.
    const Scalar twice_slope = Scalar(2) * (k1 + s * (Scalar(2) * k2 + s * Scalar(3) * k3));
    d.x = x * radial + Scalar(2) * p1 * x * y + p2 * (s + Scalar(2) * x * x);
    d.y = y * radial + p1 * (s + Scalar(2) * y * y) + Scalar(2) * p2 * x * y;
    d.xx = radial + x * x * twice_slope + Scalar(2) * p1 * y + Scalar(6) * p2 * x;
    d.xy = x * y * twice_slope + Scalar(2) * p1 * x + Scalar(2) * p2 * y;
    d.yy = radial + y * y * twice_slope + Scalar(6) * p1 * y + Scalar(2) * p2 * x;
    return is_finite(d.x) && is_finite(d.y) && d.xx * d.yy - d.xy * d.xy > Scalar(0) && rises_to(s);
  }

  /// Projects a point of the camera frame. Returns whether the projection is valid: a finite z >
  /// Tolerance::min_depth, before the fold, a finite pixel; otherwise pixel and jacobian are left as they were.
  /// jacobian: d pixel / d point.
  [[nodiscard]] CFP_INLINE bool project(const Vector3<Scalar>& point, Vector2<Scalar>& pixel,
                                        Matrix23<Scalar>* jacobian = nullptr) const noexcept {
    return detail::project_distorted(*this, point, pixel, jacobian);
  }

  /// The ray through a pixel, scaled to z = 1, by Newton's method from the axis with step halving. False, and ray
  /// untouched, when no ray before the fold gives the pixel, or pixel, principal point, a coefficient or the
  /// result is not finite. At most 40 evaluations of the
  /// model.
  [[nodiscard]] CFP_INLINE bool unproject(const Vector2<Scalar>& pixel, Vector3<Scalar>& ray) const noexcept {
    const Vector2<Scalar> target((pixel.x() - cx) / fx, (pixel.y() - cy) / fy);
    Scalar error_sq = target.squaredNorm();
    // With the factors they have in the polynomial of the fold: where that is not finite, nothing is projected.
    const Scalar radial = Scalar(3) * k1 + Scalar(5) * k2 + Scalar(7) * k3;
    if (!is_finite(error_sq) || !is_finite(Scalar(radial + p1 + p2))) return false;
    const Scalar unit_roundoff(std::numeric_limits<Scalar>::epsilon());
    const Scalar enough_sq = Scalar(256) * unit_roundoff * unit_roundoff * (Scalar(1) + error_sq);
    // On the axis the distortion is 0 and its Jacobian the identity: the first step is the target itself.
    Vector2<Scalar> found = Vector2<Scalar>::Zero(), step = target;
    for (int evaluation = 0; evaluation < 40 && !(error_sq <= enough_sq); ++evaluation) {
      detail::DistortedPoint<Scalar> d;
      const Vector2<Scalar> candidate = found + step;
      const bool valid = distort(candidate.x(), candidate.y(), d);
      const Vector2<Scalar> error = target - Vector2<Scalar>(d.x, d.y);
      const Scalar candidate_error_sq = error.squaredNorm();
      if (!valid || !(candidate_error_sq < error_sq)) {
        step *= Scalar(0.5);
        continue;
      }
      found = candidate;
      error_sq = candidate_error_sq;
      const Scalar inv_determinant = Scalar(1) / (d.xx * d.yy - d.xy * d.xy);
      step =
          Vector2<Scalar>(d.yy * error.x() - d.xy * error.y(), d.xx * error.y() - d.xy * error.x()) * inv_determinant;
    }
    if (!(error_sq <= enough_sq)) return false;
    ray = {found.x(), found.y(), Scalar(1)};
    return true;
  }

  template <typename Other>
  [[nodiscard]] CFP_INLINE RadialTangentialCamera<Other> cast() const noexcept {
    const auto to = [](const Scalar& x) { return static_cast<Other>(x); };
    return {to(fx), to(fy), to(cx), to(cy), to(k1), to(k2), to(p1), to(p2), to(k3)};
  }
};

}  // namespace cfp
