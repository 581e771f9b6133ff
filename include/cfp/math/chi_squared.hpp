/// @file chi_squared.hpp
/// Density and survival function (upper tail) of the chi-squared distribution, for the object static probability (paper
/// eq. for O_m). k: degrees of freedom, real, in (0, 1e8]; any other k gives 0.
///
/// x is a squared, normalised residual, no unit. NaN gives 0 for both functions: the safe side of a static probability.
/// k = 1 and k = 2 are closed forms in the given scalar; other k are computed in double for float, and the tail never
/// as 1 - cdf where that would cancel. Relative error about 1e-13 for double (tests: a table from an independent
/// library). All functions also take dual numbers such as ceres::Jet. Nothing allocates.
/// Sources: Loader, "Fast and accurate computation of binomial probabilities", 2000 (saddle-point form of the density);
/// DLMF 8.7.1, 8.9.2, 8.11.4 (series and continued fraction); Didonato and Morris, ACM TOMS 12(4), 1986 (small a).
#pragma once

#include <cmath>
#include <type_traits>

#include "cfp/core/numeric.hpp"

namespace cfp {

namespace detail {
inline namespace CFP_ISA {

template <typename Scalar>
using at_least_double = std::conditional_t<std::is_same_v<Scalar, float>, double, Scalar>;

[[nodiscard]] constexpr bool is_degrees_of_freedom(double k) noexcept { return k > 0 && k <= 1e8; }

/// n log(n/y) + y - n >= 0, without the cancellation near y = n.
template <typename T>
[[nodiscard]] T deviance(double n, const T& y) noexcept {
  using std::log;
  using std::log1p;
  const T excess = (y - T(n)) / T(n);
  return excess > T(-0.5) && excess < T(1) ? T(n) * (excess - log1p(excess)) : T(n) * log(T(n) / y) + y - T(n);
}

/// log Γ(n+1) - (n + 1/2) log n + n - log(2 pi)/2 for n >= 15.
[[nodiscard]] inline double stirling_error(double n) noexcept {
  const double s = 1.0 / (n * n);
  return (1.0 / 12 - s * (1.0 / 360 - s * (1.0 / 1260 - s * (1.0 / 1680 - s / 1188)))) / n;
}

/// y^(a-1) exp(-y) / Γ(a) for finite y > 0.
template <typename T>
[[nodiscard]] T gamma_density(const T& y, double a) noexcept {
  using std::exp;
  using std::pow;
  if (a < 16) {
    if (y > T(1500)) return T(0);  // below the smallest number, while the power may overflow
    const T root = exp(T(-0.5) * y);
    return pow(y, a - 1) * root * root / T(std::tgamma(a));
  }
  const double n = a - 1;
  return exp(-deviance(n, y) - T(stirling_error(n))) / T(std::sqrt(2 * pi<double> * n));
}

/// Γ(1+a) - 1 for a in (0, 1).
[[nodiscard]] inline double gamma_1p_minus_1(double a) noexcept {
  if (a >= 0.1) return std::tgamma(1 + a) - 1;
  // log Γ(1+a) = -γ a + ζ(2) a^2/2 - ζ(3) a^3/3 + ...; std::lgamma writes a global variable, so it is no choice here.
  constexpr double c[] = {-0.57721566490153286061, 0.82246703342411321824,  -0.40068563438653142847,
                          0.27058080842778454788,  -0.20738555102867398527, 0.16955717699740818995,
                          -0.14404989676884611812, 0.12550966952474304242,  -0.11133426586956469049,
                          0.10009945751278180853,  -0.09095401714582904223, 0.08335384054610900402,
                          -0.07693251641135219148, 0.07143294629536133607};
  double sum = 0;
  for (int i = 13; i >= 0; --i) sum = (sum + c[i]) * a;
  return std::expm1(sum);
}

/// Q(a, y) for a < 1, y < 1: [Γ(1+a) - y^a (1 + a sum_(n>=1) (-y)^n / (n! (a+n)))] / Γ(1+a), by differences from 1.
template <typename T>
[[nodiscard]] T gamma_upper_tail_small(const T& y, double a) noexcept {
  using std::expm1;
  using std::log;
  const double g = gamma_1p_minus_1(a);
  const T p = expm1(T(a) * log(y));
  T term = T(1), sum = T(0);
  for (int n = 1; n < 30; ++n) {
    term *= -y / T(n);
    sum += term / T(a + n);
  }
  return (T(g) - p - T(a) * (T(1) + p) * sum) / T(1 + g);
}

/// Q(a, y) = Γ(a, y) / Γ(a) for finite y > 0, a > 0. The number of terms grows as sqrt(a).
template <typename T>
[[nodiscard]] T gamma_upper_tail(const T& y, double a) noexcept {
  if (a < 1 && y < T(1)) return gamma_upper_tail_small(y, a);
  const T epsilon = T(1e-17);
  const int limit = 500 + static_cast<int>(16 * std::sqrt(a));
  if (y < T(a)) {  // the cdf is below 0.64 here: 1 - cdf does not cancel
    T term = T(1), sum = T(1);
    for (int n = 1; n < limit && term > epsilon * sum; ++n) {
      term *= y / T(a + n);
      sum += term;
    }
    return T(1) - gamma_density(y, a + 1) * sum;
  }
  const T density = gamma_density(y, a);
  if (!(density > T(0))) return T(0);
  // Continued fraction y / (y+1-a - 1(1-a) / (y+3-a - ...)) by the modified Lentz method.
  T b = y + T(1 - a);
  T d = T(1) / b;
  T c = T(1e300);
  T h = d;
  for (int i = 1; i < limit; ++i) {
    const double an = -i * (i - a);
    b += T(2);
    d = T(1) / (T(an) * d + b);
    c = b + T(an) / c;
    const T factor = c * d;
    h *= factor;
    if (!(factor < T(1 - 2e-16) || factor > T(1 + 3e-16))) break;
  }
  return y * density * h;
}

}  // namespace CFP_ISA
}  // namespace detail

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

}  // namespace CFP_ISA
}  // namespace cfp
