/// @file levenberg_marquardt.hpp
/// What every Levenberg-Marquardt loop of cfp shares: when it stops, why it stopped, and how the damping follows the
/// gain ratio. The loop itself (linearise, solve, try) belongs to the problem. Source: Nielsen: "Damping parameter in
/// Marquardt's method", 1999; Madsen, Nielsen, Tingleff 2004, section 3.2.
#pragma once

#include <algorithm>
#include <cstdint>

#include "cfp/core/numeric.hpp"

namespace cfp {

/// Costs are sums of squares in units of sigma^2, so the absolute limit has a meaning of its own.
struct LevenbergMarquardtOptions {
  int max_iterations = 10;              ///< steps tried, accepted or not, >= 0
  double initial_damping = 1e-4;        ///< relative to the scale of the Hessian's diagonal, > 0
  double min_damping = 1e-8;            ///< > 0: below it rounding would make an undetermined system singular
  double max_damping = 1e10;            ///< >= min_damping; beyond it no step helps
  double min_relative_decrease = 1e-6;  ///< stop when a step promises or brings less than this share of the cost, >= 0
  double min_absolute_decrease = 1e-9;  ///< stop when a step promises less than this, >= 0
};

/// The first field outside its range, or nullptr.
[[nodiscard]] inline const char* invalid_field(const LevenbergMarquardtOptions& options) noexcept {
  if (!(options.max_iterations >= 0)) return "max_iterations";
  if (!(options.initial_damping > 0) || !is_finite(options.initial_damping)) return "initial_damping";
  if (!(options.min_damping > 0) || !is_finite(options.min_damping)) return "min_damping";
  if (!(options.max_damping >= options.min_damping) || !is_finite(options.max_damping)) return "max_damping";
  if (!(options.min_relative_decrease >= 0) || !is_finite(options.min_relative_decrease))
    return "min_relative_decrease";
  if (!(options.min_absolute_decrease >= 0) || !is_finite(options.min_absolute_decrease))
    return "min_absolute_decrease";
  return nullptr;
}

/// Why an optimiser stopped.
enum class StopReason : std::uint8_t {
  converged,        ///< a step promised, or the last one brought, less than the options ask for
  no_progress,      ///< steps were rejected until the damping reached its limit or nothing more was promised
  max_iterations,   ///< the allowed number of steps was tried
  not_enough_data,  ///< nothing to optimise: no usable observation, or nothing free that an observation touches
  not_finite        ///< the cost or its derivative at the start overflows: everything is left as it was
};

/// The enumerator's name, for reports.
[[nodiscard]] constexpr const char* to_string(StopReason reason) noexcept {
  switch (reason) {
    case StopReason::converged:
      return "converged";
    case StopReason::no_progress:
      return "no progress";
    case StopReason::max_iterations:
      return "max iterations";
    case StopReason::not_enough_data:
      return "not enough data";
    case StopReason::not_finite:
      return "not finite";
  }
  return "unknown";
}

/// The damping factor lambda of (H + lambda D) h = -g, and the decision about each step.
class Damping {
 public:
  explicit Damping(const LevenbergMarquardtOptions& options) noexcept
      : min_(options.min_damping), max_(options.max_damping), value_(clamped(options.initial_damping)) {}

  [[nodiscard]] double value() const noexcept { return value_; }
  /// Whether the last step was refused; then a small promise means a short step, not an optimum.
  [[nodiscard]] bool last_step_rejected() const noexcept { return growth_ > 2; }
  /// True once the damping was at its limit and the step was refused there, too.
  [[nodiscard]] bool exhausted() const noexcept { return exhausted_; }

  /// Judges a step by gain = (cost before - cost after) / (predicted decrease); NaN is refused. Accepted (gain above
  /// 1e-3): lambda shrinks by max(1/3, 1 - (2 gain - 1)^3), and does not grow for gain >= 1/2. Refused: lambda grows 2,
  /// 4, 8, … times.
  bool accept(double gain) noexcept {
    if (!(gain > 1e-3)) {
      reject();
      return false;
    }
    const double t = 2 * (std::min)(gain, 1.0) - 1;
    value_ = clamped(value_ * (std::max)(1.0 / 3, 1 - t * t * t));
    growth_ = 2;
    return true;
  }
  /// The step could not be computed or evaluated.
  void reject() noexcept {
    exhausted_ = value_ >= max_;
    value_ = clamped(value_ * growth_);
    growth_ *= 2;
  }

 private:
  [[nodiscard]] double clamped(double value) const noexcept { return (std::min)((std::max)(value, min_), max_); }

  double min_, max_;
  double value_;
  double growth_ = 2;
  bool exhausted_ = false;
};

}  // namespace cfp
