/// @file robust_loss.hpp
/// Robust losses rho(s) of the squared normalised residual s = |r|^2 / sigma^2 >= 0, with rho(0) = 0 and rho'(0) = 1,
/// so that every loss is least squares near the truth. All are non-decreasing, concave and finite for finite s; rho'
/// lies in [0, 1]. `delta` > 0 is the scale in units of |r| / sigma, for example sqrt(5.991), the 95 % bound of a
/// pixel's noise. A weight belongs outside: cost = sum of w rho(s), gradient weight w rho'(s). Scalar is float, double,
/// a dual number such as ceres::Jet, or a Packet (simd/packet.hpp: many residuals at once). s = +inf gives the limit
/// (rho' = 0); a negative or NaN s is the caller's to exclude. Nothing allocates. Sources: Huber 1964;
/// Cauchy/Lorentzian and Geman, McClure 1985 as in Zhang: "Parameter estimation techniques", 1997, table 1, rescaled to
/// rho'(0) = 1; truncated least squares as in Yang, Antonante, Tzoumas, Carlone 2020.
#pragma once

#include <cmath>

#include "cfp/core/numeric.hpp"
#include "cfp/simd/packet.hpp"

namespace cfp {

/// Least squares: rho = s.
template <typename Scalar>
struct Trivial {
  Scalar delta = Scalar(1);  ///< not used

  [[nodiscard]] CFP_INLINE Scalar value(const Scalar& s) const noexcept { return s; }
  [[nodiscard]] CFP_INLINE Scalar first(const Scalar&) const noexcept { return Scalar(1); }
};

/// rho = s up to delta^2, 2 delta sqrt(s) - delta^2 beyond; rho and rho' are continuous.
template <typename Scalar>
struct Huber {
  Scalar delta = Scalar(1);

  [[nodiscard]] CFP_INLINE Scalar value(const Scalar& s) const noexcept {
    // s / sqrt(s): no second root beside that of first(). The smallest number keeps infinity from meeting 0.
    const Scalar root = s * (simd::reciprocal_sqrt(s) + Scalar((std::numeric_limits<simd::scalar_of<Scalar>>::min)()));
    return simd::select(s <= delta * delta, s, Scalar(2) * delta * root - delta * delta);
  }
  [[nodiscard]] CFP_INLINE Scalar first(const Scalar& s) const noexcept {
    return simd::select(s <= delta * delta, Scalar(1), delta * simd::reciprocal_sqrt(s));
  }
};

/// rho = delta^2 log(1 + s / delta^2), rho' = 1 / (1 + s / delta^2).
template <typename Scalar>
struct Cauchy {
  Scalar delta = Scalar(1);

  [[nodiscard]] CFP_INLINE Scalar value(const Scalar& s) const noexcept {
    using std::log1p;
    return delta * delta * log1p(s / (delta * delta));
  }
  [[nodiscard]] CFP_INLINE Scalar first(const Scalar& s) const noexcept { return delta * delta / (delta * delta + s); }
};

/// rho = s / (1 + s / delta^2), bounded by delta^2; rho' = 1 / (1 + s / delta^2)^2.
template <typename Scalar>
struct GemanMcClure {
  Scalar delta = Scalar(1);

  [[nodiscard]] CFP_INLINE Scalar value(const Scalar& s) const noexcept {
    // Two forms of one quotient: the first is exact at 0, the second at infinity.
    return simd::select(s <= delta * delta, s * share(s), delta * delta * (Scalar(1) - share(s)));
  }
  [[nodiscard]] CFP_INLINE Scalar first(const Scalar& s) const noexcept { return share(s) * share(s); }

 private:
  [[nodiscard]] CFP_INLINE Scalar share(const Scalar& s) const noexcept { return delta * delta / (delta * delta + s); }
};

/// rho = min(s, delta^2); rho' = 1 up to and at delta^2, 0 beyond. A hard cut: only for a nearby start.
template <typename Scalar>
struct Truncated {
  Scalar delta = Scalar(1);

  [[nodiscard]] CFP_INLINE Scalar value(const Scalar& s) const noexcept {
    return simd::select(s <= delta * delta, s, Scalar(delta * delta));
  }
  [[nodiscard]] CFP_INLINE Scalar first(const Scalar& s) const noexcept {
    return simd::select(s <= delta * delta, Scalar(1), Scalar(0));
  }
};

/// The losses by name, for options.
enum class LossType : std::uint8_t { trivial, huber, cauchy, geman_mcclure, truncated };

inline namespace CFP_ISA {

/// Calls `work` with the loss of that name and scale, so that a loop over residuals is compiled once per loss and never
/// asks inside: `with_loss<double>(type, delta, [&](const auto& loss) { … loss.first(s) … });`. Returns what work
/// returns.
template <typename Scalar, typename Work>
auto with_loss(LossType type, const Scalar& delta, Work&& work) {
  if (type == LossType::huber) return work(Huber<Scalar>{delta});
  if (type == LossType::cauchy) return work(Cauchy<Scalar>{delta});
  if (type == LossType::geman_mcclure) return work(GemanMcClure<Scalar>{delta});
  if (type == LossType::truncated) return work(Truncated<Scalar>{delta});
  return work(Trivial<Scalar>{delta});
}

/// The loss of that name and scale, asked at every call: where what surrounds the call costs more than the question.
template <typename Scalar>
struct NamedLoss {
  LossType type = LossType::trivial;
  Scalar delta = Scalar(1);

  [[nodiscard]] Scalar value(const Scalar& s) const noexcept {
    return with_loss<Scalar>(type, delta, [&](const auto& loss) { return loss.value(s); });
  }
  [[nodiscard]] Scalar first(const Scalar& s) const noexcept {
    return with_loss<Scalar>(type, delta, [&](const auto& loss) { return loss.first(s); });
  }
};

[[nodiscard]] constexpr bool is_loss(LossType type) noexcept { return type <= LossType::truncated; }

}  // namespace CFP_ISA
}  // namespace cfp
