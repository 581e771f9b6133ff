/// @file box_motion_impl.hpp
/// The machinery behind box_motion.hpp; include that one.
#pragma once

#include "cfp/detection/box_motion.hpp"

namespace cfp {
namespace detail {

inline constexpr double box_largest_px = 1e7;         // centres and velocities are kept below, far outside any image
inline constexpr double box_largest_variance = 1e14;  // its square
inline constexpr double box_largest_size_px = 1e5;
inline constexpr double box_largest_log_size =
    11.512925464970229;  // log of the line above; log of the smallest, 1 px, is 0
inline constexpr double box_largest_log_rate = 1e3;

/// x in [low, high]; NaN becomes low.
template <typename Scalar>
[[nodiscard]] constexpr Scalar bounded(Scalar x, Scalar low, Scalar high) noexcept {
  if (!(x > low)) return low;
  return x < high ? x : high;
}

/// Keeps a value in its range (at the border it stops), and its rate and covariance finite.
template <typename Scalar>
void confine(RateFilter<Scalar>& f, Scalar low, Scalar high, Scalar largest_rate) noexcept {
  f.rate = f.value >= low && f.value <= high ? bounded(f.rate, -largest_rate, largest_rate) : Scalar(0);
  f.value = bounded(f.value, low, high);
  const Scalar limit = Scalar(box_largest_variance);
  if (f.var_value <= limit && f.var_rate <= limit && is_finite(f.covariance)) return;
  f.var_value = f.var_value <= limit ? f.var_value : limit;
  f.var_rate = f.var_rate <= limit ? f.var_rate : limit;
  f.covariance = Scalar(0);
}

template <typename Scalar>
void confine(BoxFilter<Scalar>& filter) noexcept {
  const Scalar far = Scalar(box_largest_px);
  confine(filter.u, -far, far, far);
  confine(filter.v, -far, far, far);
  confine(filter.log_width, Scalar(0), Scalar(box_largest_log_size), Scalar(box_largest_log_rate));
  confine(filter.log_height, Scalar(0), Scalar(box_largest_log_size), Scalar(box_largest_log_rate));
}

template <typename Scalar>
[[nodiscard]] RateFilter<Scalar> at_rest(Scalar value, Scalar variance, Scalar rate) noexcept {
  return {value, Scalar(0), variance, Scalar(0), rate * rate};
}

}  // namespace detail

template <typename Scalar>
BoxFilter<Scalar> make_box_filter(const Box<Scalar>& box, const BoxMotionOptions& options) noexcept {
  using std::log;
  const Scalar w = box.width(), h = box.height();
  const Scalar noise = Scalar(options.edge_noise), rate = Scalar(options.initial_centre_rate),
               size_rate = Scalar(options.initial_size_rate);
  BoxFilter<Scalar> filter;
  filter.u = detail::at_rest(Scalar(0.5) * (box.x1 + box.x2), noise * noise * w * w / Scalar(2), rate * w);
  filter.v = detail::at_rest(Scalar(0.5) * (box.y1 + box.y2), noise * noise * h * h / Scalar(2), rate * h);
  filter.log_width = detail::at_rest(Scalar(log(w)), Scalar(2) * noise * noise, size_rate);
  filter.log_height = detail::at_rest(Scalar(log(h)), Scalar(2) * noise * noise, size_rate);
  detail::confine(filter);
  return filter;
}

template <typename Scalar>
void predict(BoxFilter<Scalar>& filter, Scalar dt_s, const BoxMotionOptions& options) noexcept {
  using std::exp;
  const Scalar q = Scalar(options.centre_acceleration), q_size = Scalar(options.size_acceleration);
  filter.u.predict(dt_s, q * exp(filter.log_width.value));
  filter.v.predict(dt_s, q * exp(filter.log_height.value));
  filter.log_width.predict(dt_s, q_size);
  filter.log_height.predict(dt_s, q_size);
  detail::confine(filter);
}

template <typename Scalar>
void update(BoxFilter<Scalar>& filter, const Box<Scalar>& measured, const BoxMotionOptions& options) noexcept {
  using std::exp;
  if (!is_proper(measured)) return;
  const Scalar w = exp(filter.log_width.value), h = exp(filter.log_height.value);
  const Scalar noise = Scalar(options.edge_noise) * Scalar(options.edge_noise);
  filter.u.update(Scalar(0.5) * (measured.x1 + measured.x2) - filter.u.value, noise * w * w / Scalar(2));
  filter.v.update(Scalar(0.5) * (measured.y1 + measured.y2) - filter.v.value, noise * h * h / Scalar(2));
  filter.log_width.update((measured.width() - w) / w, Scalar(2) * noise);
  filter.log_height.update((measured.height() - h) / h, Scalar(2) * noise);
  detail::confine(filter);
}

template <typename Scalar>
bool warp(BoxFilter<Scalar>& filter, const Eigen::Matrix<Scalar, 3, 3>& H) noexcept {
  using std::exp;
  using std::log;
  using std::sqrt;
  const Scalar u = filter.u.value, v = filter.v.value;
  const Scalar s = H(2, 0) * u + H(2, 1) * v + H(2, 2);
  if (!H.allFinite() || !(s * H(2, 2) > Scalar(0)) || !is_finite(s)) return false;
  const Scalar x = (H(0, 0) * u + H(0, 1) * v + H(0, 2)) / s, y = (H(1, 0) * u + H(1, 1) * v + H(1, 2)) / s;
  const Scalar a = (H(0, 0) - x * H(2, 0)) / s, b = (H(0, 1) - x * H(2, 1)) / s;
  const Scalar c = (H(1, 0) - y * H(2, 0)) / s, d = (H(1, 1) - y * H(2, 1)) / s;
  const Scalar w = exp(filter.log_width.value), h = exp(filter.log_height.value);
  const Scalar width = sqrt(a * a * w * w + b * b * h * h), height = sqrt(c * c * w * w + d * d * h * h);
  const Scalar far = Scalar(detail::box_largest_px), low = Scalar(1), high = Scalar(detail::box_largest_size_px);
  if (!(x >= -far && x <= far && y >= -far && y <= far && width >= low && width <= high && height >= low &&
        height <= high))
    return false;
  const RateFilter<Scalar> fu = filter.u, fv = filter.v;
  const auto mix = [](Scalar p, Scalar q, const RateFilter<Scalar>& f, const RateFilter<Scalar>& g, Scalar value) {
    return RateFilter<Scalar>{value, p * f.rate + q * g.rate, p * p * f.var_value + q * q * g.var_value,
                              p * p * f.covariance + q * q * g.covariance, p * p * f.var_rate + q * q * g.var_rate};
  };
  filter.u = mix(a, b, fu, fv, x);
  filter.v = mix(c, d, fu, fv, y);
  filter.log_width.value = log(width);
  filter.log_height.value = log(height);
  detail::confine(filter);
  return true;
}

}  // namespace cfp
