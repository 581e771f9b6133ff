/// @file bundle_adjustment.hpp
/// Weighted bundle adjustment: camera poses and points that minimise
///   cost = sum over observations of w rho(|r|^2 / sigma^2),
/// r = projection - (u, v), or - (u, v, u_right) for a stereo observation, or (u, v, disparity) for a depth. The weight
/// stands outside the loss, for the reason given in pose_refinement.hpp.
///
/// Levenberg-Marquardt on the normal equations, points eliminated (Schur complement), the reduced camera system
/// factorised by block Cholesky within its envelope. Time and memory per iteration are linear in the observations, in
/// the pairs of observations of one point and in the poses along a film; more than 64 free poses are ordered by their
/// common points first. With fewer than a quarter as many points as free poses the poses are eliminated instead, and
/// the points' system is factorised. Sources: Triggs et al.: "Bundle adjustment - a modern synthesis", 2000; Lourakis,
/// Argyros: SBA, 2009.
#pragma once

#include <algorithm>
#include <type_traits>

#include "cfp/optimization/bundle/bundle_adjustment_impl.hpp"
#include "cfp/optimization/bundle/bundle_problem.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// Adjusts the free poses and all points of the problem, in place.
///
/// - Stops as LevenbergMarquardtOptions says; status, costs and counts are in the result. The cost never rises.
/// - Rotations are normalised before the first evaluation, and the cameras' centres stay; one that is off by more than
///   1e-2 is no rotation, and its observations are invalid.
/// - Observations whose point the camera does not see at the start (behind it, say, or within 2 um) are left out of
///   the whole solve; a step that brings a used observation behind its camera is refused and the damping raised. Call
///   again to readmit.
/// - Gauge: nothing is added to the cost. With no pose (mono: or only one) fixed, the damping alone holds the free
///   directions, and the solution stays near the start along them.
/// - A fixed pose, a free pose or a point without a used observation keeps its bits. When no step was accepted, or
///   there is no solution (is_solved), everything does.
/// - The same input gives the same bits with any executor. Parts of less than 4000 observations stay on this thread.
/// - What the executor or an allocation throws passes through; poses and points are then as they were.
/// - Allocates only in the workspace, before the first iteration; not at all when it has seen a problem of this size.
/// - squared_errors, when not empty: one per observation, |r|^2 / sigma^2 at the solution, for the caller's outlier
///   test (against 5.991 mono, 7.815 RGB-D; the weight has no part in it); -1 when the camera does not see the point or
///   the observation is invalid. Observations of weight 0 are judged, too.
/// - u_right and depths at once: invalid_input.
/// Preconditions (asserted): arrays of one length where they are parallel; cameras: one, or one per pose.
template <typename Camera, typename Scalar, typename Executor = SingleThread>
[[nodiscard]] BundleResult adjust_bundle(const BundleProblem<Camera, Scalar>& problem, const BundleOptions& options,
                                         BundleWorkspace& workspace, span<double> squared_errors = {},
                                         Executor&& executor = Executor()) {
  BundleResult result;
  if (!problem.observations.u_right.empty() && !problem.observations.depths.empty()) {
    std::fill(squared_errors.begin(), squared_errors.end(), -1.0);
    result.status = SolverStatus::invalid_input;
    return result;
  }
  detail::build_index(problem, workspace.index, result);
  detail::prepare(problem, workspace, result);
  if (result.used > 0) {
    detail::BundleLeastSquares<BundleProblem<Camera, Scalar>, std::remove_reference_t<Executor>> least_squares{
        problem, options, workspace, executor};
    static_cast<LeastSquaresResult&>(result) = minimize_least_squares(least_squares, options.levenberg_marquardt);
    if (!is_solved(result.status)) result.accepted = 0, result.final_cost = result.initial_cost;
    if (result.accepted > 0) detail::write_back(problem, workspace);
  } else if (result.behind > 0) {
    result.status = SolverStatus::degenerate;
  } else if (result.zero_weight > 0 && result.invalid == 0) {
    result.status = SolverStatus::no_weight;
  }
  if (!squared_errors.empty()) detail::write_squared_errors(problem, workspace.index, squared_errors);
  return result;
}

}  // namespace CFP_ISA
}  // namespace cfp
