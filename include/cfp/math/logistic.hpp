/// @file logistic.hpp
/// The logistic function, the sigmoid of every constraint and confidence of the paper (sections IV-C and IV-D).
#pragma once

#include <cmath>

#include "cfp/version.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// 1 / (1 + exp(-x)), in [0, 1], non-decreasing, logistic(x) + logistic(-x) = 1 up to rounding. Only ever takes the
/// exponential of a number <= 0, so nothing overflows: exactly 0 at -inf and 1 at +inf. NaN gives 0, the safe side of a
/// static probability. For float, double and dual numbers.
template <typename Scalar>
[[nodiscard]] Scalar logistic(const Scalar& x) noexcept {
  using std::exp;
  if (x >= Scalar(0)) return Scalar(1) / (Scalar(1) + exp(-x));
  if (!(x < Scalar(0))) return Scalar(0);
  const Scalar e = exp(x);
  return e / (Scalar(1) + e);
}

}  // namespace CFP_ISA
}  // namespace cfp
