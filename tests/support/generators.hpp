// RapidCheck generators that all property tests share.
#pragma once

#include "support/catch.hpp"
// RapidCheck names Catch2's header itself; the shim above has included it.
#include <rapidcheck/catch.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

namespace cfp_test {

/// Uniform in [0, 1], both ends included and over-represented.
inline rc::Gen<double> probability() {
  return rc::gen::map(rc::gen::inRange<std::int64_t>(-1000, 1001001),
                      [](std::int64_t i) { return i < 0 ? 0.0 : (i > 1000000 ? 1.0 : static_cast<double>(i) * 1e-6); });
}

/// Any double: RapidCheck's own plus the ones that break formulas.
inline rc::Gen<double> any_double() {
  using Limits = std::numeric_limits<double>;
  return rc::gen::weightedOneOf<double>(
      {{3, rc::gen::arbitrary<double>()},
       {3, rc::gen::map(rc::gen::inRange<std::int64_t>(-1000000, 1000001),
                        [](std::int64_t i) { return static_cast<double>(i) * 1e-5; })},
       {2, rc::gen::element(0.0, -0.0, 1.0, -1.0, 1e300, -1e300, Limits::denorm_min(), (Limits::min)(), (Limits::max)(),
                            Limits::infinity(), -Limits::infinity(), Limits::quiet_NaN())}});
}

/// A number of any bit pattern whatever, NaN, infinities and denormals included.
template <typename Scalar = double, typename Bits = std::uint64_t>
Scalar any_number() {
  const Bits bits = *rc::gen::arbitrary<Bits>();
  Scalar value;
  static_assert(sizeof(value) == sizeof(bits));
  std::memcpy(&value, &bits, sizeof(bits));
  return value;
}

/// A real number in [low, high] with 1/1000 of the interval as its grain, so that shrinking reads well.
inline double real(double low, double high) { return low + (high - low) * *rc::gen::inRange(0, 1001) / 1000.0; }

/// At least `least` distances in [0, 10] px, ties included, distinct enough that no sum is near a rounding edge.
inline rc::Gen<std::vector<double>> distances(std::size_t least) {
  const auto one = rc::gen::map(rc::gen::inRange<std::int64_t>(0, 10001),
                                [](std::int64_t i) { return static_cast<double>(i) * 1e-3; });
  return rc::gen::mapcat(rc::gen::inRange<std::size_t>(least, least + 120),
                         [one](std::size_t n) { return rc::gen::container<std::vector<double>>(n, one); });
}

}  // namespace cfp_test
