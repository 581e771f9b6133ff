/// @file numeric.hpp
/// Per-scalar tolerances and the few numeric helpers that every module needs. All work for float, double and dual
/// numbers such as ceres::Jet (through argument-dependent lookup), and NaN always takes the failing branch.
#pragma once

#include <cmath>
#include <limits>

#include "cfp/version.hpp"

namespace cfp {

/// Tolerances by scalar type. Dual numbers take those of double.
template <typename Scalar>
struct Tolerance {
  static constexpr double small_angle = 1e-5;  ///< rad; below it SO(3) formulas use their Taylor expansion
  static constexpr double min_depth = 1e-6;    ///< m; points nearer to the camera plane are not projected
  static constexpr double degenerate = 1e-12;  ///< relative; below it a denominator counts as zero
};
template <>
struct Tolerance<float> {
  static constexpr float small_angle = 1e-2F;
  static constexpr float min_depth = 1e-6F;
  static constexpr float degenerate = 1e-6F;
};

template <typename Scalar>
inline constexpr Scalar pi = Scalar(3.14159265358979323846264338327950288L);

inline namespace CFP_ISA {

/// True for neither NaN nor infinite. A comparison, so that it holds for dual numbers, too.
template <typename Scalar>
[[nodiscard]] constexpr bool is_finite(const Scalar& x) noexcept {
  return x >= Scalar((std::numeric_limits<Scalar>::lowest)()) && x <= Scalar((std::numeric_limits<Scalar>::max)());
}

/// x clamped to [0, 1]; NaN becomes 0, the safe side of a static probability.
template <typename Scalar>
[[nodiscard]] constexpr Scalar clamp_probability(const Scalar& x) noexcept {
  if (!(x > Scalar(0))) return Scalar(0);
  return x < Scalar(1) ? x : Scalar(1);
}

/// The number of frames after `count`, for ages and runs: stays at 10^9, three years of frames at 10 Hz.
[[nodiscard]] constexpr int next_count(int count) noexcept { return count < 1000000000 ? count + 1 : count; }

/// What is left of a memory after dt_s, exp(-dt / tau), tau > 0; all of it where no time has passed.
[[nodiscard]] inline double kept_share(double dt_s, double time_constant_s) noexcept {
  return std::exp(-(dt_s > 0 ? dt_s : 0.0) / time_constant_s);
}

/// A depth measurement that can be used: finite and positive (ORB-SLAM2 marks missing depth with -1, sensors with 0 or
/// NaN).
template <typename Scalar>
[[nodiscard]] constexpr bool is_valid_depth(const Scalar& depth_m) noexcept {
  return depth_m > Scalar(0) && depth_m <= Scalar((std::numeric_limits<Scalar>::max)());
}

}  // namespace CFP_ISA
}  // namespace cfp
