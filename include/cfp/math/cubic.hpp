/// @file cubic.hpp
/// Real roots of a cubic, for the minimal solvers (seven-point fundamental matrix, P3P).
#pragma once

#include <algorithm>
#include <cmath>

#include "cfp/core/numeric.hpp"

namespace cfp {

/// Real roots of x^3 + a x^2 + b x + c, in roots[0 .. count); returns the count, 1 or 3 (a double root counts twice),
/// or 0 when a coefficient is not finite or the roots overflow. Closed form (Cardano for one real root, Viete for
/// three), then Newton steps on the polynomial itself; a root separated from the others by d is exact to rounding / d.
/// Allocates nothing.
template <typename Scalar>
[[nodiscard]] int real_cubic_roots(Scalar a, Scalar b, Scalar c, Scalar (&roots)[3]) noexcept {
  using std::abs;
  const Scalar third = a / Scalar(3);
  const Scalar q = third * third - b / Scalar(3);
  const Scalar r = third * (third * third - b / Scalar(2)) + c / Scalar(2);
  const Scalar q3 = q * q * q;
  if (!is_finite(q3) || !is_finite(r * r)) return 0;
  int count = 1;
  // The margin keeps a double root that rounding would otherwise turn into a pair of complex ones.
  if (r * r <= q3 * (Scalar(1) + Scalar(16) * std::numeric_limits<Scalar>::epsilon())) {
    const Scalar angle =
        std::acos((std::max)(Scalar(-1), (std::min)(Scalar(1), q3 > Scalar(0) ? r / std::sqrt(q3) : Scalar(0)))) /
        Scalar(3);
    const Scalar radius = Scalar(-2) * std::sqrt((std::max)(q, Scalar(0)));
    const Scalar step = Scalar(2) / Scalar(3) * pi<Scalar>;
    for (int i = 0; i < 3; ++i) roots[i] = radius * std::cos(angle + Scalar(i - 1) * step) - third;
    count = 3;
  } else {
    const Scalar magnitude = std::cbrt(abs(r) + std::sqrt(r * r - q3));
    const Scalar u = r > Scalar(0) ? -magnitude : magnitude;
    roots[0] = u + (magnitude > Scalar(0) ? q / u : Scalar(0)) - third;
  }
  for (int i = 0; i < count; ++i) {
    for (int step = 0; step < 2; ++step) {
      const Scalar x = roots[i];
      const Scalar value = ((x + a) * x + b) * x + c;
      const Scalar slope = (Scalar(3) * x + Scalar(2) * a) * x + b;
      const Scalar next = x - value / slope;
      // At a double root the slope vanishes with the value: keep a step only when it lowers the polynomial.
      if (abs(((next + a) * next + b) * next + c) < abs(value)) roots[i] = next;
    }
  }
  return count;
}

}  // namespace cfp
