/// @file rate_filter.hpp
/// Kalman filter of one value that changes at a nearly constant rate: x <- x + dt x', white noise on the acceleration
/// of spectral density q^2, so Q = q^2 [dt^3/3, dt^2/2; dt^2/2, dt], and one step of 2 dt equals two steps of dt.
#pragma once

#include "cfp/core/numeric.hpp"
#include "cfp/version.hpp"

namespace cfp {

/// A value, its rate per second, and their covariance.
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

}  // namespace cfp
