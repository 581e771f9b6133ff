// What hostile input looks like, and how two numbers are compared.
#pragma once

#include <cmath>
#include <limits>

#include "cfp_testing/numbers.hpp"

namespace cfp_test {

using cfp_testing::hostile_numbers;

constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();

/// |a - b| over the larger of the two magnitudes; 0 for equal numbers (also infinite ones).
template <typename Scalar>
Scalar relative_difference(Scalar a, Scalar b) {
  return a == b ? Scalar(0) : std::abs(a - b) / std::fmax(std::abs(a), std::abs(b));
}

}  // namespace cfp_test
