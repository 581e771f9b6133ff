/// @file solver_status.hpp
/// How a least-squares solve ended: pose refinement, bundle adjustment and whatever else runs least_squares.hpp.
#pragma once

#include <cstdint>

#include "cfp/version.hpp"

namespace cfp {

/// The solution was computed for the first three; for the others the caller's values are untouched.
enum class SolverStatus : std::uint8_t {
  converged,           ///< a step promised, or the last one brought, less than the options ask for
  no_decrease,         ///< no step, however short, lowers the cost: the minimum within rounding
  iteration_limit,     ///< the allowed number of steps was tried
  not_enough_data,     ///< fewer usable observations than needed, or nothing free that an observation touches
  no_weight,           ///< observations, but all weights are 0
  not_enough_inliers,  ///< too few observations agree with the solution
  degenerate,          ///< the observations do not determine the solution: collinear points, all behind the camera
  not_finite,          ///< the cost at the start overflows
  invalid_input        ///< a start, camera or combination of arrays that has no meaning
};

/// Whether there is a solution.
[[nodiscard]] constexpr bool is_solved(SolverStatus status) noexcept { return status <= SolverStatus::iteration_limit; }

/// The enumerator's name, for reports.
[[nodiscard]] constexpr const char* to_string(SolverStatus status) noexcept {
  constexpr const char* names[] = {"converged",       "no decrease", "iteration limit",
                                   "not enough data", "no weight",   "not enough inliers",
                                   "degenerate",      "not finite",  "invalid input"};
  return status <= SolverStatus::invalid_input ? names[static_cast<int>(status)] : "unknown";
}

}  // namespace cfp
