/// @file pose_refinement_impl.hpp
/// The machinery of pose_refinement.hpp: the model that the least-squares loop minimises, and the rounds.
#pragma once

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "cfp/geometry/camera.hpp"
#include "cfp/optimization/least_squares.hpp"
#include "cfp/optimization/pose/pose_columns_impl.hpp"
#include "cfp/optimization/pose/pose_kernel_impl.hpp"
#include "cfp/optimization/pose/pose_problem.hpp"
#include "cfp/simd/packet.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

template <typename Camera>
[[nodiscard]] bool is_usable_camera(const Camera& camera) noexcept {
  const PinholeCamera<double> c = undistorted_camera(camera).template cast<double>();
  return c.fx >= 1e-3 && c.fx <= 1e6 && c.fy >= 1e-3 && c.fy <= 1e6 && std::abs(c.cx) <= 1e7 && std::abs(c.cy) <= 1e7;
}

/// What the loop minimises: the pose relative to the start position, so that float serves wherever the origin is.
template <typename Scalar, typename Camera>
struct PoseModel {
  using Number = std::conditional_t<is_pinhole<Camera>, simd::Packet<Scalar>, double>;
  const Camera& camera;
  const PoseOptions& options;
  PoseColumns<Scalar> columns;  // errors are those at last_pose
  PoseRound round;
  SE3<double> last_pose;
  double influence = 0;  // at last_pose: sum of w rho'(s)
  int evaluations = 0;

  double linearize(const SE3<double>& T, NormalEquations<6>& equations) noexcept {
    PoseSystem system;
    for_each_kind(columns, options, [&](std::size_t begin, std::size_t end, double chi2, auto stereo) {
      const double delta = round.scale * std::sqrt(chi2);
      with_loss<Number>(round.loss, static_cast<simd::scalar_of<Number>>(delta), [&](const auto& loss) {
        add_observations<decltype(stereo)::value>(columns, begin, end, camera, T, loss, system);
      });
    });
    equations = system.equations;
    influence = system.influence;
    last_pose = T;
    ++evaluations;
    return system.cost;
  }
  [[nodiscard]] SE3<double> moved(const SE3<double>& T, const Vector6<double>& step) const noexcept {
    return se3_exp(step) * T;
  }
};

/// Leaves out the outliers by the stored errors; returns how many observations stay.
template <typename Scalar>
int keep_inliers(const PoseOptions& options, PoseColumns<Scalar>& columns, bool& changed) noexcept {
  int count = 0;
  changed = false;
  for_each_observation(columns, options, [&](std::size_t i, bool inlier) {
    const Scalar active = inlier ? columns.weight[i] : Scalar(0);
    count += inlier ? 1 : 0;
    changed = changed || active != columns.active[i];
    columns.active[i] = active;
  });
  return count;
}

struct PoseInliers {
  int rows = 0;       // two of a pixel, three with a depth
  double weight = 0;  // in the last round
};

/// Counts and marks the inliers by the stored errors, and sums their w s.
template <typename Scalar>
PoseInliers count_inliers(const PoseOptions& options, const PoseColumns<Scalar>& columns, PoseResult& result,
                          span<char> inliers) noexcept {
  PoseInliers found;
  for_each_observation(columns, options, [&](std::size_t i, bool inlier) {
    if (!inlier) return;
    ++result.inliers;
    found.rows += i < columns.stereo_begin ? 2 : 3;
    found.weight += static_cast<double>(columns.active[i]);
    result.chi2 += static_cast<double>(columns.weight[i] * columns.error[i]);
    if (!inliers.empty()) inliers[columns.index[i]] = 1;
  });
  result.chi2 *= columns.mean_weight;
  return found;
}

/// Runs the rounds from a start at the origin; afterwards model and equations belong to the pose.
template <typename Scalar, typename Camera>
SolverStatus run_rounds(PoseModel<Scalar, Camera>& model, const SE3<double>& start, PoseResult& result,
                        SE3<double>& pose, NormalEquations<6>& equations) noexcept {
  const PoseOptions& options = model.options;
  constexpr double min_pivot =
      (std::max)(static_cast<double>(std::numeric_limits<Scalar>::epsilon()), Tolerance<double>::degenerate);
  LevenbergMarquardtOptions steps;  // Gauss-Newton until a step fails
  steps.max_iterations = options.max_iterations;
  steps.initial_damping = steps.min_damping = 0;
  steps.rejected_damping = 1e-3;
  steps.max_damping = 1e8;
  steps.min_relative_decrease = static_cast<double>(std::numeric_limits<Scalar>::epsilon());
  SolverStatus status = SolverStatus::not_enough_data;
  pose = start;
  for (std::size_t r = 0; r < options.round_count; ++r) {
    bool changed = false;
    if (r > 0 && options.inliers_only && keep_inliers(options, model.columns, changed) < options.min_observations)
      return SolverStatus::not_enough_inliers;
    if (r > 0 && options.from_start && !changed && options.rounds[r] == model.round) continue;
    model.round = options.rounds[r];
    const bool hands_over = !options.from_start && r + 1 < options.round_count;
    steps.min_absolute_decrease =
        hands_over ? (std::max)(options.min_decrease, options.handover_decrease * result.used) : options.min_decrease;
    DenseLeastSquares<6, SE3<double>, PoseModel<Scalar, Camera>> problem(model, options.from_start ? start : pose,
                                                                         min_pivot);
    const LeastSquaresResult solved = minimize_least_squares(problem, steps);
    ++result.rounds;
    status = solved.status;
    if (!is_solved(status)) return status;
    pose = problem.state();
    equations = problem.equations();
    result.cost = solved.final_cost * model.columns.mean_weight;
    if (model.last_pose.rotation != pose.rotation || model.last_pose.translation != pose.translation)
      (void)model.linearize(pose, equations);  // the last trial was refused
  }
  return status;
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
