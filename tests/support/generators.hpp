// RapidCheck generators that all property tests share.
#pragma once

#include "support/catch.hpp"
// RapidCheck names Catch2's header itself; the shim above has included it.
#include <rapidcheck/catch.h>

#include <cmath>
#include <cstdint>
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

/// At least `least` distances in [0, 10] px, ties included, distinct enough that no sum is near a rounding edge.
inline rc::Gen<std::vector<double>> distances(std::size_t least) {
  const auto one = rc::gen::map(rc::gen::inRange<std::int64_t>(0, 10001),
                                [](std::int64_t i) { return static_cast<double>(i) * 1e-3; });
  return rc::gen::mapcat(rc::gen::inRange<std::size_t>(least, least + 120),
                         [one](std::size_t n) { return rc::gen::container<std::vector<double>>(n, one); });
}

}  // namespace cfp_test
