/// @file numbers.hpp
/// Numbers that break formulas, and probabilities, for property-based tests.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>

#include "cfp/core/random.hpp"

namespace cfp_testing {

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

/// Any number at all: one of hostile_numbers, any bits, or an ordinary one in [-1000, 1000].
template <typename Scalar>
[[nodiscard]] Scalar any_number(cfp::Random& random) {
  const std::uint32_t kind = random.index(3);
  if (kind == 0) return hostile_numbers<Scalar>()[random.index(16)];
  if (kind == 1) return static_cast<Scalar>(random.uniform(-1000, 1000));
  const auto bits = static_cast<std::conditional_t<sizeof(Scalar) == 4, std::uint32_t, std::uint64_t>>(random());
  Scalar value;
  static_assert(sizeof(value) == sizeof(bits), "float or double");
  std::memcpy(&value, &bits, sizeof(value));
  return value;
}

/// In [0, 1]; each end in one case of ten.
[[nodiscard]] inline double probability(cfp::Random& random) noexcept {
  const std::uint32_t kind = random.index(10);
  return kind == 0 ? 0 : kind == 1 ? 1 : random.uniform();
}

}  // namespace cfp_testing
