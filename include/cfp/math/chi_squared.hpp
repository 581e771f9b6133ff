/// @file chi_squared.hpp
/// Density and survival function (upper tail) of the chi-squared distribution, for the object static probability (paper
/// eq. for O_m). k: degrees of freedom, in [1, 100]; any other k gives 0.
///
/// x is a squared, normalised residual, no unit. NaN gives 0 for both functions: the safe side of a static probability.
/// Closed forms, the density in double for float where k > 2; the tail is a sum of positive terms and never 1 - cdf, so
/// nothing cancels: relative error about 1e-13 for double (tests: a table from an independent library), as far as
/// exp(-x/2) is a normal number, x < 1416; from 1490 on it is 0, and both functions with it. Both also take dual
/// numbers such as ceres::Jet. Nothing allocates. Source: Abramowitz, Stegun: "Handbook of mathematical
/// functions", 26.4.4, 26.4.5.
#pragma once

#include <cmath>
#include <type_traits>

#include "cfp/core/numeric.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// Whether the functions below know k.
[[nodiscard]] constexpr bool is_degrees_of_freedom(int k) noexcept { return k >= 1 && k <= 100; }

/// x^(k/2-1) exp(-x/2) / (2^(k/2) Γ(k/2)). 0 for x < 0; at x = 0 the limit from the right: 0 for k > 2, 1/2 for k = 2,
/// and for k = 1, where it is infinite, the largest finite number.
template <typename Scalar>
[[nodiscard]] Scalar chi_squared_density(const Scalar& x, int k) noexcept {
  using std::exp;
  using std::sqrt;
  const Scalar largest = Scalar((std::numeric_limits<Scalar>::max)());
  if (!(x >= Scalar(0) && x <= largest) || !is_degrees_of_freedom(k)) return Scalar(0);
  if (!(x > Scalar(0))) return k > 2 ? Scalar(0) : k == 2 ? Scalar(0.5) : largest;
  if constexpr (std::is_same_v<Scalar, float>) {
    if (k > 2) return static_cast<float>(chi_squared_density(static_cast<double>(x), k));
  }
  const Scalar decay = exp(Scalar(-0.5) * x);
  Scalar density = k % 2 == 0 ? Scalar(0.5) * decay : decay / (sqrt(x) * Scalar(2.50662827463100050242));  // sqrt(2 pi)
  for (int n = k % 2 == 0 ? 2 : 1; n < k; n += 2) density *= x / Scalar(n);  // from n to n + 2
  return density;
}

/// Q(x; k) = Γ(k/2, x/2) / Γ(k/2): the probability of a value above x. 1 for x <= 0, 0 at +inf, non-increasing but for
/// rounding; erfc(sqrt(x/2)) for k = 1, exp(-x/2) for k = 2, and two more degrees of freedom add twice their density.
template <typename Scalar>
[[nodiscard]] Scalar chi_squared_survival(const Scalar& x, int k) noexcept {
  using std::erfc;
  using std::exp;
  using std::sqrt;
  if (!(x <= Scalar((std::numeric_limits<Scalar>::max)())) || !is_degrees_of_freedom(k)) return Scalar(0);
  if (!(x > Scalar(0))) return Scalar(1);
  Scalar tail = k % 2 == 0 ? exp(Scalar(-0.5) * x) : erfc(sqrt(Scalar(0.5) * x));
  for (int n = k % 2 == 0 ? 4 : 3; n <= k; n += 2) tail += Scalar(2) * chi_squared_density(x, n);
  return clamp_probability(tail);
}

}  // namespace CFP_ISA
}  // namespace cfp
