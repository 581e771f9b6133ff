/// @file kannala_brandt_camera.hpp
/// Fisheye camera of Kannala and Brandt with four coefficients: OpenCV's fisheye model, Kalibr's "equidistant",
/// ORB-SLAM3's KannalaBrandt8. Source: Kannala and Brandt, "A generic camera model and calibration method for
/// conventional, wide-angle, and fish-eye lenses", PAMI 2006.
#pragma once

#include <cmath>
#include <limits>

#include "cfp/core/numeric.hpp"
#include "cfp/geometry/camera.hpp"

namespace cfp {

/// With the angle t of a ray from the axis, and x, y = X/Z, Y/Z:
///   r(t) = t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8)
///   u = fx r(t) x / |(x, y)| + cx, v = fy r(t) y / |(x, y)| + cy.
///
/// The polynomial is a model of the lens only as far as it rises; its slope is asked at the angle and at fifteen
/// before it. A ray is scaled to z = 1, so that what is 90 degrees and more from the axis has none.
template <typename Scalar>
struct KannalaBrandtCamera {
  using ScalarType = Scalar;
  Scalar fx = Scalar(1);  ///< focal length in pixels, > 0
  Scalar fy = Scalar(1);  ///< focal length in pixels, > 0
  Scalar cx = Scalar(0);  ///< principal point in pixels
  Scalar cy = Scalar(0);
  Scalar k1 = Scalar(0);
  Scalar k2 = Scalar(0);
  Scalar k3 = Scalar(0);
  Scalar k4 = Scalar(0);

  /// The camera that looks along the same axis and sees the same there.
  [[nodiscard]] CFP_INLINE PinholeCamera<Scalar> pinhole() const noexcept { return {fx, fy, cx, cy}; }

  /// r(t) / t.
  [[nodiscard]] CFP_INLINE Scalar stretch(const Scalar& angle) const noexcept {
    const Scalar s = angle * angle;
    return Scalar(1) + s * (k1 + s * (k2 + s * (k3 + s * k4)));
  }
  /// d r / d t.
  [[nodiscard]] CFP_INLINE Scalar slope(const Scalar& angle) const noexcept {
    const Scalar s = angle * angle;
    return Scalar(1) + s * (Scalar(3) * k1 + s * (Scalar(5) * k2 + s * (Scalar(7) * k3 + s * Scalar(9) * k4)));
  }
  /// Whether r rises up to there.
  [[nodiscard]] CFP_INLINE bool rises_to(const Scalar& angle) const noexcept {
    constexpr int angles = 16;
    for (int k = angles; k > 0; --k) {
      if (!(slope(Scalar(angle * Scalar(k) / Scalar(angles))) > Scalar(0))) return false;
    }
    return true;
  }

  /// Whether r has this length at the angle, to `most`, and rises up to there.
  [[nodiscard]] CFP_INLINE bool solves(const Scalar& angle, const Scalar& radius, const Scalar& most) const noexcept {
    const Scalar error = angle * stretch(angle) - radius;
    return error <= most && -error <= most && rises_to(angle);
  }

  /// Whether a squared radius of the plane z = 1 is so small that sqrt, which has no slope at 0 for a dual number, is
  /// to be avoided.
  [[nodiscard]] CFP_INLINE static bool is_on_axis(const Scalar& radius_sq) noexcept {
    return radius_sq < Scalar(std::numeric_limits<Scalar>::epsilon());
  }
  /// Distorts the point (x, y) of the plane z = 1; false beyond the angle to which r rises, or where x^2 + y^2 is not
  /// finite.
  [[nodiscard]] CFP_INLINE bool distort(const Scalar& x, const Scalar& y,
                                        detail::DistortedPoint<Scalar>& d) const noexcept {
    using std::atan;
    using std::sqrt;
    const Scalar s = x * x + y * y, third = Scalar(1) / Scalar(3);
    const bool on_axis = is_on_axis(s);
    const Scalar radius = on_axis ? Scalar(0) : Scalar(sqrt(s)), angle = on_axis ? Scalar(0) : Scalar(atan(radius));
    if (!is_finite(s) || !rises_to(angle)) return false;
    // r / |(x, y)|; its slope along x is x times twice_slope, along y y times that.
    const Scalar ratio = on_axis ? Scalar(Scalar(1) + (k1 - third) * s) : Scalar(angle * stretch(angle) / radius);
    const Scalar twice_slope =
        on_axis ? Scalar(Scalar(2) * (k1 - third)) : Scalar((slope(angle) / (Scalar(1) + s) - ratio) / s);
    d = {x * ratio, y * ratio, ratio + x * x * twice_slope, x * y * twice_slope, ratio + y * y * twice_slope};
    return true;
  }

  /// Projects a point of the camera frame. Returns whether the projection is valid: a finite z >
  /// Tolerance::min_depth, an angle up to which r rises, a finite pixel; otherwise pixel and jacobian are left as they
  /// were. jacobian: d pixel / d point.
  [[nodiscard]] CFP_INLINE bool project(const Vector3<Scalar>& point, Vector2<Scalar>& pixel,
                                        Matrix23<Scalar>* jacobian = nullptr) const noexcept {
    return detail::project_distorted(*this, point, pixel, jacobian);
  }

  /// The ray through a pixel, scaled to z = 1, by Newton's method on the angle, by bisection where that fails. False,
  /// and ray untouched, when no ray before 90 degrees and up to which r rises gives the pixel, or anything is not
  /// finite.
  [[nodiscard]] CFP_INLINE bool unproject(const Vector2<Scalar>& pixel, Vector3<Scalar>& ray) const noexcept {
    using std::sqrt;
    using std::tan;
    const Scalar x = (pixel.x() - cx) / fx, y = (pixel.y() - cy) / fy, s = x * x + y * y;
    if (!is_finite(s)) return false;
    if (is_on_axis(s)) {
      if (!is_finite(Scalar(k1 + k2 + k3 + k4))) return false;
      const Scalar ratio = Scalar(1) - (k1 - Scalar(1) / Scalar(3)) * s;
      ray = {x * ratio, y * ratio, Scalar(1)};
      return true;
    }
    const Scalar radius = sqrt(s), last = Scalar(0.4999) * Scalar(pi<double>);
    const Scalar most = Scalar(8) * Scalar(std::numeric_limits<Scalar>::epsilon()) * (Scalar(1) + radius);
    Scalar angle = radius < last ? radius : last;
    for (int step = 0; step < 20; ++step) {
      const Scalar error = angle * stretch(angle) - radius;
      if (error <= most && -error <= most) break;
      const Scalar next = angle - error / slope(angle);
      angle = !(next > Scalar(0)) ? Scalar(0.5) * angle : next < last ? next : last;
    }
    if (!solves(angle, radius, most)) {  // no ray, or it began, or went, beyond where r ceases to rise
      if (last * stretch(last) < radius && rises_to(last)) return false;
      Scalar low = Scalar(0), high = last;
      for (int halving = 0; halving < 60; ++halving) {
        angle = Scalar(0.5) * (low + high);
        (angle * stretch(angle) < radius && rises_to(angle) ? low : high) = angle;
      }
      if (!solves(angle, radius, most)) return false;
    }
    const Scalar ratio = tan(angle) / radius;
    ray = {x * ratio, y * ratio, Scalar(1)};
    return true;
  }

  template <typename Other>
  [[nodiscard]] CFP_INLINE KannalaBrandtCamera<Other> cast() const noexcept {
    const auto to = [](const Scalar& value) { return static_cast<Other>(value); };
    return {to(fx), to(fy), to(cx), to(cy), to(k1), to(k2), to(k3), to(k4)};
  }
};

}  // namespace cfp
