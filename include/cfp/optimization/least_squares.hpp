/// @file least_squares.hpp
/// The one Gauss-Newton/Levenberg-Marquardt loop of cfp, for a handful of unknowns and for bundle adjustment alike.
///
/// The loop knows a *problem* by four functions. Costs are sums of w rho(s), s in units of sigma^2:
///   double linearize()              cost and normal equations at the start
///   double propose(double damping)  solves (H + damping D) h = -g, keeps the trial it leads to, and returns what the
///                                   quadratic model promises, h^T (damping D h - g); NaN: not positive definite; 0:
///                                   ends
///   double linearize_trial()        cost and normal equations at the trial; NaN: the trial is refused
///   void accept()                   the trial is the solution from now on
/// detail::DenseLeastSquares makes such a problem from two functions of a model. Nothing allocates but the problem.
/// Sources: Nielsen: "Damping parameter in Marquardt's method", 1999; Madsen, Nielsen, Tingleff 2004, section 3.2.
#pragma once

#include <algorithm>
#include <utility>

#include "cfp/core/options.hpp"
#include "cfp/math/normal_equations.hpp"

namespace cfp {

/// Costs are sums of squares in units of sigma^2, so the absolute limit has a meaning of its own.
struct LevenbergMarquardtOptions {
  int max_iterations = 10;              ///< steps tried, accepted or not, >= 0
  double initial_damping = 1e-4;        ///< relative to the scale of the Hessian's diagonal, >= 0; 0: Gauss-Newton
  double min_damping = 1e-8;            ///< >= 0: below it rounding would make an undetermined system singular
  double rejected_damping = 1e-8;       ///< a refused step raises the damping at least to this; > 0
  double max_damping = 1e10;            ///< >= min_damping, > 0; beyond it no step helps
  double min_relative_decrease = 1e-6;  ///< stop when a step promises or brings less than this share of the cost, >= 0
  double min_absolute_decrease = 1e-9;  ///< stop when a step promises less than this, >= 0
};

/// How a solve ended: pose refinement, bundle adjustment and whatever else runs the loop. There is a solution for the
/// first three; for the others the caller's values are untouched.
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

[[nodiscard]] constexpr const char* to_string(SolverStatus status) noexcept {
  constexpr const char* names[] = {"converged",       "no decrease", "iteration limit",
                                   "not enough data", "no weight",   "not enough inliers",
                                   "degenerate",      "not finite",  "invalid input"};
  return status <= SolverStatus::invalid_input ? names[static_cast<int>(status)] : "unknown";
}

struct LeastSquaresResult {
  SolverStatus status = SolverStatus::not_enough_data;
  double initial_cost = 0;
  double final_cost = 0;  ///< <= initial_cost
  int iterations = 0;     ///< steps tried
  int accepted = 0;       ///< steps taken
};

inline namespace CFP_ISA {

[[nodiscard]] inline OptionPath invalid_field(const LevenbergMarquardtOptions& options) noexcept {
  if (!(options.max_iterations >= 0)) return "max_iterations";
  if (!detail::non_negative(options.initial_damping)) return "initial_damping";
  if (!detail::non_negative(options.min_damping)) return "min_damping";
  if (!detail::positive(options.rejected_damping)) return "rejected_damping";
  if (!(options.max_damping >= options.min_damping && options.max_damping > 0) || !is_finite(options.max_damping))
    return "max_damping";
  if (!detail::non_negative(options.min_relative_decrease)) return "min_relative_decrease";
  if (!detail::non_negative(options.min_absolute_decrease)) return "min_absolute_decrease";
  return {};
}

/// Runs the loop. The cost never rises; what the problem holds at the end belongs to the last accepted step. A system
/// that is not positive definite is damped, or, with damping 0, ends as degenerate.
///
/// A small predicted or actual decrease indicates a minimum only if the step was hardly damped.
///
/// A step is judged by its gain = (cost before - cost after) / (predicted decrease); NaN is refused. Accepted (gain
/// above 1e-3): the damping shrinks by max(1/3, 1 - (2 gain - 1)^3), and does not grow for gain >= 1/2; below
/// rejected_damping it falls to min_damping at once. Refused: it grows 2, 4, 8, … times.
template <typename Problem>
LeastSquaresResult minimize_least_squares(Problem& problem, const LevenbergMarquardtOptions& options) {
  LeastSquaresResult result;
  double cost = problem.linearize();
  result.status = SolverStatus::not_finite;
  if (!is_finite(cost)) return result;
  result.initial_cost = cost;
  const auto ended = [&](SolverStatus status) {
    result.status = status;
    result.final_cost = cost;
    return result;
  };
  const auto clamped = [&](double damping) { return std::clamp(damping, options.min_damping, options.max_damping); };
  const double rejected_damping = (std::min)(options.rejected_damping, options.max_damping);
  double damping = clamped(options.initial_damping), growth = 2;
  while (result.iterations < options.max_iterations) {
    ++result.iterations;
    const double promised = problem.propose(damping);
    if (is_finite(promised)) {
      // Little promised or won says something about the minimum only where the damping is small, too.
      const bool damped = damping > (std::max)(options.initial_damping, options.rejected_damping);
      const double enough = (std::max)(options.min_absolute_decrease, options.min_relative_decrease * cost);
      // After a refusal a short step promises little, and not an optimum alone.
      if (!(promised > (damped ? 0 : enough)))
        return ended(growth > 2 ? SolverStatus::no_decrease : SolverStatus::converged);
      const double next = problem.linearize_trial(), decrease = cost - next, gain = decrease / promised;
      if (gain > 1e-3) {
        const double t = 2 * (std::min)(gain, 1.0) - 1;
        damping = clamped(damping * (std::max)(1.0 / 3, 1 - t * t * t));
        if (damping < rejected_damping) damping = options.min_damping;
        growth = 2;
        problem.accept();
        ++result.accepted;
        cost = next;
        if (!damped && !(decrease > options.min_relative_decrease * cost)) return ended(SolverStatus::converged);
        continue;
      }
    } else if (!(damping > 0)) {
      return ended(SolverStatus::degenerate);
    }
    if (damping >= options.max_damping) return ended(SolverStatus::no_decrease);
    damping = clamped((std::max)(damping * growth, rejected_damping));
    growth *= 2;
  }
  return ended(SolverStatus::iteration_limit);
}

}  // namespace CFP_ISA
}  // namespace cfp

namespace cfp::detail {
inline namespace CFP_ISA {

/// A problem of N unknowns from a model with
///   double linearize(const State& state, NormalEquations<N>& equations)   writes H (upper triangle) = sum of
///                                   w rho'(s) J^T J, g = sum of w rho'(s) J^T r and returns the cost
///   State moved(const State& state, const Eigen::Matrix<double, N, 1>& step)
/// For local use: alignment depends on flags.
template <int N, typename State, typename Model>
struct DenseLeastSquares {
  Model& model;
  State state;
  double min_pivot = 1e-12;
  NormalEquations<N> equations = {};  // at the state
  State trial = state;
  NormalEquations<N> trial_equations = {};

  double linearize() { return model.linearize(state, equations); }
  double propose(double damping) {
    Eigen::Matrix<double, N, 1> step;
    if (!solve_normal_equations<N>(equations.H, equations.g, damping, min_pivot, step))
      return std::numeric_limits<double>::quiet_NaN();
    trial = model.moved(state, step);
    double promised = 0;
    for (int r = 0; r < N; ++r) promised += step[r] * (damping * equations.H(r, r) * step[r] - equations.g[r]);
    return promised;
  }
  double linearize_trial() { return model.linearize(trial, trial_equations); }
  void accept() {
    std::swap(state, trial);
    std::swap(equations, trial_equations);
  }
};

}  // namespace CFP_ISA
}  // namespace cfp::detail
