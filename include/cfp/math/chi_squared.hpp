/// @file chi_squared.hpp
/// Density and survival function (upper tail) of the chi-squared distribution, for the object static probability (paper
/// eq. for O_m). k: degrees of freedom, real, in (0, 1e8]; any other k gives 0.
///
/// x is a squared, normalised residual, no unit. NaN gives 0 for both functions: the safe side of a static probability.
/// k = 1 and k = 2 are closed forms in the given scalar; other k are computed in double for float, and the tail never
/// as 1 - cdf where that would cancel. Relative error about 1e-13 for double (tests: a table from an independent
/// library). All functions also take dual numbers such as ceres::Jet. Nothing allocates.
#pragma once

#include <cmath>
#include <limits>
#include <type_traits>

#include "cfp/core/numeric.hpp"
#include "cfp/math/chi_squared_impl.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// x^(k/2-1) exp(-x/2) / (2^(k/2) Γ(k/2)). 0 for x < 0; at x = 0 the limit from the right: 0 for k > 2, 1/2 for k = 2,
/// and for k < 2, where it is infinite, the largest finite number, which is also the cap for tiny x.
template <typename Scalar>
[[nodiscard]] Scalar chi_squared_density(const Scalar& x, double k) noexcept {
  using std::exp;
  using std::sqrt;
  if (!(x >= Scalar(0) && x <= Scalar((std::numeric_limits<Scalar>::max)())) || !detail::is_degrees_of_freedom(k))
    return Scalar(0);
  if (k == 2) return Scalar(0.5) * exp(Scalar(-0.5) * x);
  if (!(x > Scalar(0))) return k > 2 ? Scalar(0) : Scalar((std::numeric_limits<Scalar>::max)());
  if (k == 1) return exp(Scalar(-0.5) * x) / (sqrt(x) * Scalar(2.50662827463100050242));  // sqrt(2 pi)
  using Wide = detail::at_least_double<Scalar>;
  const Wide density = Wide(0.5) * detail::gamma_density(Wide(0.5) * Wide(x), 0.5 * k);
  return density < Wide((std::numeric_limits<Scalar>::max)()) ? Scalar(density)
                                                              : Scalar((std::numeric_limits<Scalar>::max)());
}

/// Q(x; k) = Γ(k/2, x/2) / Γ(k/2): the probability of a value above x. 1 for x <= 0, 0 at +inf, non-increasing;
/// erfc(sqrt(x/2)) for k = 1, exp(-x/2) for k = 2.
template <typename Scalar>
[[nodiscard]] Scalar chi_squared_survival(const Scalar& x, double k) noexcept {
  using std::erfc;
  using std::exp;
  using std::sqrt;
  if (!(x <= Scalar((std::numeric_limits<Scalar>::max)())) || !detail::is_degrees_of_freedom(k)) return Scalar(0);
  if (!(x > Scalar(0))) return Scalar(1);
  if (k == 2) return exp(Scalar(-0.5) * x);
  if (k == 1) return erfc(sqrt(Scalar(0.5) * x));
  using Wide = detail::at_least_double<Scalar>;
  return clamp_probability(Scalar(detail::gamma_upper_tail(Wide(0.5) * Wide(x), 0.5 * k)));
}

/// The density at its mode x = k - 2, for k >= 2: 1/2 for k = 2. +inf for k < 2, where the density has no maximum; so a
/// score "density over its mode" is possible for k >= 2 only. 0 for a k out of range.
[[nodiscard]] inline double chi_squared_mode_density(double k) noexcept {
  if (!detail::is_degrees_of_freedom(k)) return 0.0;
  return k < 2 ? std::numeric_limits<double>::infinity() : chi_squared_density(k - 2, k);
}

}  // namespace CFP_ISA
}  // namespace cfp
