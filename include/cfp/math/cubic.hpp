/// @file cubic.hpp
/// Real roots of a cubic, for the minimal solvers (seven-point fundamental matrix, P3P).
#pragma once

#include <cmath>

#include "cfp/core/numeric.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// The real root of x^3 + a x^2 + b x + c farthest from the other two: never a double one, and exact to rounding unless
/// all three coincide. Any value when a coefficient is not finite or their cubes overflow, and a rough one where the
/// sixth power of the root underflows.
template <typename Scalar>
[[nodiscard]] Scalar isolated_cubic_root(Scalar a, Scalar b, Scalar c) noexcept {
  // x = t - a / 3: t^3 - 3 q t + 2 r = 0. The root sought lies beyond both turning points, t = +-sqrt(q), on the side
  // of -r.
  const Scalar third = a / Scalar(3), q = third * third - b / Scalar(3);
  const Scalar r = third * (third * third - b / Scalar(2)) + c / Scalar(2);
  const Scalar size = std::abs(r), square = size * size - q * q * q;
  Scalar t = 0;
  if (square > Scalar(0)) {  // one real root: Cardano
    const Scalar sum = std::cbrt(size + std::sqrt(square));
    t = sum + q / sum;
  } else if (q > Scalar(0)) {  // three: t = 2 sqrt(q) cos(acos(ratio) / 3), the cosine to 3e-4
    const Scalar root = std::sqrt(q), ratio = size / (q * root);
    t = root * (Scalar(1.7323) + ratio * (Scalar(0.3296) - Scalar(0.0622) * ratio));
  }
  // Householder steps of third order, each of which makes four digits of one.
  Scalar x = -std::copysign(t, r) - third;
  const Scalar spread = std::abs(t) + std::abs(third);
  for (int step = 0; step < 8; ++step) {
    const Scalar value = ((x + a) * x + b) * x + c, slope = (Scalar(3) * x + Scalar(2) * a) * x + b;
    const Scalar square_slope = slope * slope, bend = value * (Scalar(3) * x + a);
    const Scalar change = value * (square_slope - bend) / (slope * (square_slope - Scalar(2) * bend) + value * value);
    if (!(std::abs(change) <= spread)) break;
    x -= change;
    if (std::abs(change) <= Scalar(1e-4) * std::abs(x)) break;
  }
  return x;
}

/// Real roots of x^3 + a x^2 + b x + c in roots[0 .. count), the isolated one first; returns the count, 1 or 3 (a
/// double root counts twice), or 0 when a coefficient is not finite or their cubes overflow. The other two come
/// from the quadratic that is left, then a Newton step on the cubic itself; a root at distance d from the next is exact
/// to rounding / d. Allocates nothing.
template <typename Scalar>
[[nodiscard]] int real_cubic_roots(Scalar a, Scalar b, Scalar c, Scalar (&roots)[3]) noexcept {
  const Scalar first = isolated_cubic_root(a, b, c), size = std::abs(a) + std::abs(b) + std::abs(c);
  if (!is_finite(size * size * size) || !is_finite(first)) return 0;
  roots[0] = first;
  // x^2 + (a + first) x + (a + first) first + b, and the discriminant by what the roots are: (a + first) / -2 +- root.
  Scalar middle = Scalar(-0.5) * (a + first), product = b - Scalar(2) * middle * first;
  // Where the first root is the largest its rounding error would be most of the others.
  if (std::abs(first) > std::abs(middle)) product = -c / first, middle = Scalar(0.5) * (b - product) / first;
  const Scalar square = middle * middle, discriminant = square - product;
  // The margin keeps a double root that rounding would otherwise turn into a pair of complex ones.
  const Scalar margin = Scalar(32) * std::numeric_limits<Scalar>::epsilon() * (square + std::abs(product));
  if (!(discriminant >= -margin)) return 1;
  const Scalar root = discriminant > Scalar(0) ? std::sqrt(discriminant) : Scalar(0);
  // At a double root the slope vanishes with the value: keep a step only when it stays by its root and lowers the
  // polynomial.
  const auto polished = [&](Scalar x) {
    const Scalar value = ((x + a) * x + b) * x + c, slope = (Scalar(3) * x + Scalar(2) * a) * x + b;
    const Scalar step = value / slope, next = x - step;
    return std::abs(step) < root && std::abs(((next + a) * next + b) * next + c) < std::abs(value) ? next : x;
  };
  roots[1] = polished(middle - root), roots[2] = polished(middle + root);
  return 3;
}

}  // namespace CFP_ISA
}  // namespace cfp
