// What hostile input looks like, and how two numbers are compared.
#pragma once

#include <array>
#include <cmath>
#include <limits>

namespace cfp_test {

/// NaN, infinities, zeros, denormals, the extremes of the type and, last, ordinary numbers.
template <typename Scalar>
constexpr std::array<Scalar, 16> hostile_numbers() {
  using limits = std::numeric_limits<Scalar>;
  return {limits::quiet_NaN(), limits::infinity(),   -limits::infinity(),
          (limits::max)(),     limits::lowest(),     (limits::min)(),
          -(limits::min)(),    limits::denorm_min(), -limits::denorm_min(),
          Scalar(0),           Scalar(-0.0),         limits::epsilon(),
          Scalar(1),           Scalar(-1),           Scalar(0.5),
          Scalar(640)};
}

/// |a - b| over the larger of the two magnitudes; 0 for equal numbers (also infinite ones).
template <typename Scalar>
Scalar relative_difference(Scalar a, Scalar b) {
  return a == b ? Scalar(0) : std::abs(a - b) / std::fmax(std::abs(a), std::abs(b));
}

}  // namespace cfp_test
