/// @file box_motion.hpp
/// How a detected box moves: centre u, v (px) and log width, log height, each with its rate per second. Log sizes keep
/// width and height positive however long a box is predicted. The paper (IV-A) names an EKF and leaves state, noise and
/// time open.
///
/// Motion: constant rates, white noise on the accelerations (RateFilter), as large across as up and down: a box that is
/// higher than wide does not move faster up and down for that.
/// Measurement: the four edges, h = (u - w/2, u + w/2, v - h/2, v + h/2) with w = exp(log width): not linear, hence an
/// EKF. The noise of an edge is proportional to the box, s_x = edge_noise * w for the vertical edges and s_y =
/// edge_noise * h for the horizontal ones, w and h of the prediction.
///
/// The split. Centre (x1 + x2)/2 and width x2 - x1 of two edges with equal independent noise s^2 have independent
/// noises s^2/2 and 2 s^2, and the EKF's measurement matrix at the prediction becomes diagonal: 1 for the centre, w for
/// log width. So when the prior covariance has no terms between the four pairs (value, rate), neither has the
/// posterior, and the 8-state filter *is* four 2-state filters, with innovations centre - u and (width - w)/w (not
/// log(width/w): it is the EKF, linearised at the prediction) of variance s^2/2 and 2 edge_noise^2. Exact but for
/// rounding; a test holds the two forms equal.
#pragma once

#include <algorithm>
#include <cmath>

#include "cfp/core/options.hpp"
#include "cfp/core/span.hpp"
#include "cfp/core/types.hpp"
#include "cfp/geometry/box.hpp"

namespace cfp {

/// Defaults from benchmarks/studies/tracker_study.cpp (TUD-Stadtmitte and simulated walkers).
struct BoxMotionOptions {
  double edge_noise = 0.07;          ///< standard deviation of an edge / size of the box, in (0, 1]
  double centre_acceleration = 1.0;  ///< q of the centre, both ways, / width of the box, s^-1.5, >= 0
  double size_acceleration = 0.2;    ///< q of the log size, s^-1.5, >= 0
  double initial_centre_rate = 2.0;  ///< standard deviation of a new box's velocity / width, per second, > 0
  double initial_size_rate = 0.2;    ///< the same of the log size rate, per second, > 0
};

/// Kalman filter of a value that changes at a nearly constant rate (per second): x <- x + dt x', white noise on the
/// acceleration of spectral density q^2, so Q = q^2 [dt^3/3, dt^2/2; dt^2/2, dt]; one step of 2 dt equals two of dt.
template <typename Scalar>
struct RateFilter {
  Scalar value{}, rate{};
  Scalar var_value{}, covariance{}, var_rate{};

  /// dt >= 0 seconds ahead; q: square root of the spectral density of the acceleration.
  CFP_INLINE constexpr void predict(Scalar dt_s, Scalar q) noexcept {
    const Scalar noise = q * q * dt_s;
    value += dt_s * rate;
    var_value += dt_s * (Scalar(2) * covariance + dt_s * (var_rate + noise / Scalar(3)));
    covariance += dt_s * (var_rate + noise / Scalar(2));
    var_rate += noise;
  }
  /// Takes in a measurement of the value by its innovation. Joseph's form, written out. Ignored when not finite.
  CFP_INLINE constexpr void correct(Scalar innovation, Scalar variance) noexcept {
    const Scalar s = var_value + variance;
    if (!(s > Scalar(0)) || !is_finite(innovation) || !is_finite(s)) return;
    const Scalar k = var_value / s, k_rate = covariance / s, rest = variance / s;  // rest = 1 - k, without cancellation
    value += k * innovation;
    rate += k_rate * innovation;
    var_rate = var_rate - Scalar(2) * k_rate * covariance + k_rate * k_rate * s;
    covariance *= rest;
    var_value *= rest;
    if (!(var_rate > Scalar(0))) var_rate = Scalar(0);
  }
};

/// The box filter in its split form.
template <typename Scalar>
struct BoxFilter {
  RateFilter<Scalar> u, v, log_width, log_height;

  [[nodiscard]] CFP_INLINE Box<Scalar> box() const noexcept {
    const Scalar w = Scalar(0.5) * std::exp(log_width.value), h = Scalar(0.5) * std::exp(log_height.value);
    return {u.value - w, v.value - h, u.value + w, v.value + h};
  }
};

namespace detail {
inline namespace CFP_ISA {

inline constexpr double box_farthest_px = 1e6;  // of centres and velocities; a box of 1 px there has a width in float
inline constexpr double box_largest_px = 1e5;   // sizes lie between 1 px and this
inline constexpr double box_largest_log = 11.512925464970229;  // log of the line above

// Keeps a value in its range, where it stops at the border, and its rate and covariance finite.
template <typename Scalar>
void confine(RateFilter<Scalar>& f, Scalar low, Scalar high, Scalar largest_rate) noexcept {
  const auto bounded = [](Scalar x, Scalar least, Scalar most) { return (std::min)(most, (std::max)(least, x)); };
  f.rate = f.value >= low && f.value <= high ? bounded(f.rate, -largest_rate, largest_rate) : Scalar(0);
  f.value = bounded(f.value, low, high);
  const Scalar limit = Scalar(box_farthest_px * box_farthest_px);
  if (f.var_value <= limit && f.var_rate <= limit && is_finite(f.covariance)) return;
  f.var_value = (std::min)(limit, f.var_value);  // NaN becomes the limit
  f.var_rate = (std::min)(limit, f.var_rate);
  f.covariance = Scalar(0);
}

template <typename Scalar>
void confine(BoxFilter<Scalar>& filter) noexcept {
  const Scalar far = Scalar(box_farthest_px);
  confine(filter.u, -far, far, far);
  confine(filter.v, -far, far, far);
  confine(filter.log_width, Scalar(0), Scalar(box_largest_log), Scalar(1e3));
  confine(filter.log_height, Scalar(0), Scalar(box_largest_log), Scalar(1e3));
}

// Calls visit(part, innovation, variance of its measurement) for each of the four filters.
template <typename Filter, typename Scalar, typename Visit>
CFP_INLINE void for_each_innovation(Filter& filter, const Box<Scalar>& measured, const BoxMotionOptions& options,
                                    const Visit& visit) noexcept {
  const Scalar w = std::exp(filter.log_width.value), h = std::exp(filter.log_height.value);
  const Scalar noise = Scalar(options.edge_noise) * Scalar(options.edge_noise);
  visit(filter.u, Scalar(0.5) * (measured.x1 + measured.x2) - filter.u.value, noise * w * w / Scalar(2));
  visit(filter.v, Scalar(0.5) * (measured.y1 + measured.y2) - filter.v.value, noise * h * h / Scalar(2));
  visit(filter.log_width, (measured.width() - w) / w, Scalar(2) * noise);
  visit(filter.log_height, (measured.height() - h) / h, Scalar(2) * noise);
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

[[nodiscard]] inline OptionPath invalid_field(const BoxMotionOptions& o) noexcept {
  if (!(o.edge_noise > 0 && o.edge_noise <= 1)) return "edge_noise";
  if (!(o.centre_acceleration >= 0 && o.centre_acceleration <= 1e6)) return "centre_acceleration";
  if (!(o.size_acceleration >= 0 && o.size_acceleration <= 1e6)) return "size_acceleration";
  if (!(o.initial_centre_rate > 0 && o.initial_centre_rate <= 1e6)) return "initial_centre_rate";
  if (!(o.initial_size_rate > 0 && o.initial_size_rate <= 1e6)) return "initial_size_rate";
  return {};
}

/// A filter at rest on a detected box, which has to be proper (is_proper) with edges below 1e6 px in magnitude.
template <typename Scalar>
[[nodiscard]] BoxFilter<Scalar> make_box_filter(const Box<Scalar>& box, const BoxMotionOptions& options) noexcept {
  const Scalar w = box.width(), h = box.height(), zero(0);
  const Scalar noise = Scalar(options.edge_noise) * Scalar(options.edge_noise);
  const Scalar centre_rate = Scalar(options.initial_centre_rate) * w, size_rate = Scalar(options.initial_size_rate);
  BoxFilter<Scalar> filter;
  filter.u = {Scalar(0.5) * (box.x1 + box.x2), zero, noise * w * w / Scalar(2), zero, centre_rate * centre_rate};
  filter.v = {Scalar(0.5) * (box.y1 + box.y2), zero, noise * h * h / Scalar(2), zero, centre_rate * centre_rate};
  filter.log_width = {Scalar(std::log(w)), zero, Scalar(2) * noise, zero, size_rate * size_rate};
  filter.log_height = {Scalar(std::log(h)), zero, Scalar(2) * noise, zero, size_rate * size_rate};
  detail::confine(filter);
  return filter;
}

/// Moves the filter dt seconds ahead (finite, >= 0). Sizes stay within [1, 1e5] px, where their rate becomes 0 (so they
/// are positive after any number of predictions), and the centre within +-1e6 px: nothing overflows. Equal to the EKF
/// up to there.
template <typename Scalar>
void predict_box(BoxFilter<Scalar>& filter, non_deduced<Scalar> dt_s, const BoxMotionOptions& options) noexcept {
  const Scalar q = Scalar(options.centre_acceleration) * std::exp(filter.log_width.value);
  const Scalar q_size = Scalar(options.size_acceleration);
  filter.u.predict(dt_s, q);
  filter.v.predict(dt_s, q);
  filter.log_width.predict(dt_s, q_size);
  filter.log_height.predict(dt_s, q_size);
  detail::confine(filter);
}

/// Takes in a detected box (proper, else ignored).
template <typename Scalar>
void correct_box(BoxFilter<Scalar>& filter, const Box<Scalar>& measured, const BoxMotionOptions& options) noexcept {
  if (!is_proper(measured)) return;
  detail::for_each_innovation(
      filter, measured, options,
      [](RateFilter<Scalar>& part, Scalar innovation, Scalar variance) { part.correct(innovation, variance); });
  detail::confine(filter);
}

/// Squared Mahalanobis distance of a detected box (proper) from the predicted one, >= 0: chi-squared with four degrees
/// of freedom if it is the same object. Not finite where numbers overflow.
template <typename Scalar>
[[nodiscard]] Scalar box_distance_sq(const BoxFilter<Scalar>& filter, const Box<Scalar>& measured,
                                     const BoxMotionOptions& options) noexcept {
  Scalar sum(0);
  detail::for_each_innovation(filter, measured, options,
                              [&](const RateFilter<Scalar>& part, Scalar innovation, Scalar variance) {
                                sum += innovation * innovation / (part.var_value + variance);
                              });
  return sum;
}

/// Where an image motion takes the filter: `H` (homography; affine when its last row is 0 0 1) maps pixels of the frame
/// before to this one. With J its Jacobian at the centre: centre by H, velocity by J, and sizes to the bounding box of
/// the mapped inscribed ellipse, w' = |(J00 w, J01 h)|, so that small rotations there and back do not inflate a box
/// (bounding the corners does). The variances of the centre follow J; its cross terms between u and v are dropped, as
/// the split form needs. Returns false, and leaves the filter, when H is not finite, the centre falls behind the
/// camera, or the centre or a size leaves the limits of predict_box.
template <typename Scalar>
[[nodiscard]] bool warp_box(BoxFilter<Scalar>& filter, const Matrix3<Scalar>& H) noexcept {
  const Scalar u = filter.u.value, v = filter.v.value;
  const Scalar s = H(2, 0) * u + H(2, 1) * v + H(2, 2);
  if (!H.allFinite() || !(s * H(2, 2) > Scalar(0)) || !is_finite(s)) return false;
  const Scalar x = (H(0, 0) * u + H(0, 1) * v + H(0, 2)) / s, y = (H(1, 0) * u + H(1, 1) * v + H(1, 2)) / s;
  const Scalar a = (H(0, 0) - x * H(2, 0)) / s, b = (H(0, 1) - x * H(2, 1)) / s;
  const Scalar c = (H(1, 0) - y * H(2, 0)) / s, d = (H(1, 1) - y * H(2, 1)) / s;
  const Scalar w = std::exp(filter.log_width.value), h = std::exp(filter.log_height.value);
  const Scalar width = std::sqrt(a * a * w * w + b * b * h * h), height = std::sqrt(c * c * w * w + d * d * h * h);
  const Scalar far = Scalar(detail::box_farthest_px), largest = Scalar(detail::box_largest_px);
  const auto within = [](Scalar value, Scalar low, Scalar high) { return value >= low && value <= high; };
  if (!within(x, -far, far) || !within(y, -far, far)) return false;
  if (!within(width, Scalar(1), largest) || !within(height, Scalar(1), largest)) return false;
  const RateFilter<Scalar> fu = filter.u, fv = filter.v;
  const auto mix = [&](Scalar p, Scalar q, Scalar value) {
    return RateFilter<Scalar>{value, p * fu.rate + q * fv.rate, p * p * fu.var_value + q * q * fv.var_value,
                              p * p * fu.covariance + q * q * fv.covariance, p * p * fu.var_rate + q * q * fv.var_rate};
  };
  filter.u = mix(a, b, x);
  filter.v = mix(c, d, y);
  filter.log_width.value = std::log(width);
  filter.log_height.value = std::log(height);
  detail::confine(filter);
  return true;
}

}  // namespace CFP_ISA
}  // namespace cfp
