/// @file bundle_adjustment_impl.hpp
/// Inside bundle_adjustment.hpp: the Levenberg-Marquardt loop and the way between the caller's arrays and the solver's.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include "cfp/optimization/bundle/block_cholesky.hpp"
#include "cfp/optimization/bundle/bundle_pose_elimination_impl.hpp"
#include "cfp/optimization/bundle/bundle_problem.hpp"
#include "cfp/optimization/bundle/bundle_schur_impl.hpp"

namespace cfp {

/// Scratch memory of adjust_bundle; keeps what it has grown to. One per thread that calls.
class BundleWorkspace {
 public:
  BundleWorkspace() = default;

  // Internal: the stages of adjust_bundle work on these.
  detail::BundleIndex index;
  detail::BundleState state, next_state;
  detail::BundleLinearization linear, next_linear;
  detail::BundleSchur schur;
  detail::BundlePoseElimination pose_elimination;
  std::vector<double> pose_steps;
  BlockCholesky cholesky;
};

}  // namespace cfp

namespace cfp::detail {

template <typename Camera, typename Scalar>
void assert_shapes([[maybe_unused]] const BundleProblem<Camera, Scalar>& problem) noexcept {
  [[maybe_unused]] const auto& o = problem.observations;
  [[maybe_unused]] const std::size_t n = o.pose.size();
  CFP_ASSERT(o.point.size() == n && o.pixels.size() == n);
  CFP_ASSERT(o.u_right.empty() || o.u_right.size() == n);
  CFP_ASSERT(o.sigmas.empty() || o.sigmas.size() == n);
  CFP_ASSERT(o.weights.empty() || o.weights.size() == n);
  CFP_ASSERT(problem.fixed_poses.empty() || problem.fixed_poses.size() == problem.poses.size());
  CFP_ASSERT(n == 0 || problem.cameras.size() == 1 || problem.cameras.size() == problem.poses.size());
}

/// Sizes every array and copies the poses and points that take part.
template <typename Camera, typename Scalar>
void prepare(const BundleProblem<Camera, Scalar>& problem, BundleWorkspace& work, BundleResult& result) {
  const BundleIndex& index = work.index;
  const std::size_t ranks = index.pose_of_rank.size(), points = index.point_of.size(),
                    free_poses = to_index(index.free_poses);
  result.free_poses = free_poses;
  result.adjusted_points = points;
  result.reduced_blocks = index.block_row.size();
  work.cholesky.analyze(index.eliminate_poses ? 0 : index.free_poses, index.block_row, index.block_column);
  if (index.eliminate_poses) work.pose_elimination.resize(index);
  result.factor_blocks = work.cholesky.factor_blocks();
  for (BundleState* state : {&work.state, &work.next_state}) {
    state->poses.resize(ranks);
    state->points.resize(3 * points);
  }
  for (BundleLinearization* linear : {&work.linear, &work.next_linear}) {
    linear->slots.resize(BundleLinearization::slot_doubles * index.slot_rank.size());
    linear->poses.resize(BundleLinearization::pose_doubles * free_poses);
    linear->costs.resize(ranks);
  }
  for (std::size_t part = 0; part < to_index(ba_parts); ++part) {
    work.schur.blocks[part].resize(36 * index.block_row.size());
    work.schur.right_side[part].resize(6 * free_poses);
    work.schur.scratch[part].resize(to_index(ba_slot_scratch * index.max_free_slots));
  }
  work.schur.points.resize(BundleSchur::point_doubles * points);
  work.pose_steps.resize(6 * free_poses);

  for (std::size_t r = 0; r < ranks; ++r) {
    const SE3<double>& pose = problem.poses[to_index(index.pose_of_rank[r])];
    const Vector3<double> center = pose.inverse().translation;
    for (int e = 0; e < 9; ++e) work.state.poses[r].rotation[e] = pose.rotation(e / 3, e % 3);
    for (int e = 0; e < 3; ++e) work.state.poses[r].center[e] = center[e];
  }
  for (std::size_t j = 0; j < points; ++j) {
    for (int e = 0; e < 3; ++e) work.state.points[3 * j + to_index(e)] = problem.points[to_index(index.point_of[j])][e];
  }
}

/// The normal equations at a state; returns the cost, NaN when a point is behind a camera that used to see it.
template <typename Camera, typename Scalar, typename MonoLoss, typename StereoLoss, typename Executor>
double linearize(const BundleProblem<Camera, Scalar>& problem, const MonoLoss& mono, const StereoLoss& stereo,
                 const BundleIndex& index, const BundleState& state, BundleLinearization& linear, Executor& executor) {
  executor(ba_parts, [&](int part) {
    for (int r = index.rank_part[to_index(part)]; r < index.rank_part[to_index(part) + 1]; ++r) {
      const Camera& camera = camera_of(problem.cameras, index.pose_of_rank[to_index(r)]);
      linearize_pose(index, r, camera, problem.baseline_fx, mono, stereo, state, linear);
    }
  });
  double cost = 0;
  for (const double c : linear.costs) cost += c;
  return cost;
}

/// The poses' steps by elimination of the points.
template <typename Executor>
[[nodiscard]] bool solve_for_poses(BundleWorkspace& work, double lambda, Executor& executor) {
  bool definite[ba_parts];
  executor(ba_parts, [&](int part) {
    definite[part] = eliminate_points(work.index, work.state, work.linear, lambda, part, work.schur);
  });
  for (const bool part : definite) {
    if (!part) return false;
  }
  auto& blocks = work.schur.blocks;
  auto& right_side = work.schur.right_side;
  for (std::size_t part = 1; part < to_index(ba_parts); ++part) {
    for (std::size_t i = 0; i < blocks[0].size(); ++i) blocks[0][i] += blocks[part][i];
    for (std::size_t i = 0; i < right_side[0].size(); ++i) right_side[0][i] += right_side[part][i];
  }
  if (!work.cholesky.factorize(blocks[0])) return false;
  std::copy(right_side[0].begin(), right_side[0].end(), work.pose_steps.begin());
  work.cholesky.solve(work.pose_steps);
  return true;
}

/// Solves the damped normal equations and fills next_state. False when they are not positive definite.
template <typename Executor>
[[nodiscard]] bool take_step(BundleWorkspace& work, double lambda, Executor& executor, double& promised) {
  const bool solved = work.index.eliminate_poses
                          ? eliminate_poses(work.index, work.state, work.linear, lambda, work.schur,
                                            work.pose_elimination, work.pose_steps.data())
                          : solve_for_poses(work, lambda, executor);
  if (!solved) return false;
  double by_points[ba_parts];
  executor(ba_parts, [&](int part) {
    by_points[part] = move_points(work.index, work.state, work.linear, work.schur, lambda, work.pose_steps.data(), part,
                                  work.next_state);
  });
  promised = move_poses(work.index, work.state, work.linear, lambda, work.pose_steps.data(), work.next_state);
  for (const double p : by_points) promised += p;
  return is_finite(promised);
}

/// Bundle adjustment as minimize_least_squares wants it.
template <typename Linearize, typename Executor>
struct BundleLeastSquares {
  BundleWorkspace& work;
  const Linearize& linearize_at;  // (state, linear) -> cost
  Executor& executor;

  double linearize() { return linearize_at(work.state, work.linear); }
  double propose(double damping) {
    double promised = 0;
    return take_step(work, damping, executor, promised) ? promised : std::numeric_limits<double>::quiet_NaN();
  }
  double linearize_trial() { return linearize_at(work.next_state, work.next_linear); }
  void accept() {
    std::swap(work.state, work.next_state);
    std::swap(work.linear, work.next_linear);
  }
};

template <typename Camera, typename Scalar, typename MonoLoss, typename StereoLoss, typename Executor>
void minimize(const BundleProblem<Camera, Scalar>& problem, const LevenbergMarquardtOptions& options,
              const MonoLoss& mono, const StereoLoss& stereo, BundleWorkspace& work, Executor& executor,
              BundleResult& result) {
  const auto linearize_at = [&](const BundleState& state, BundleLinearization& linear) {
    return linearize(problem, mono, stereo, work.index, state, linear, executor);
  };
  BundleLeastSquares<decltype(linearize_at), Executor> least_squares{work, linearize_at, executor};
  const LeastSquaresResult solved = minimize_least_squares(least_squares, options);
  result.status = solved.status;
  result.initial_cost = solved.initial_cost, result.final_cost = solved.final_cost;
  result.iterations = solved.iterations, result.accepted = solved.accepted;
}

template <typename Camera, typename Scalar>
void write_back(const BundleProblem<Camera, Scalar>& problem, const BundleWorkspace& work) noexcept {
  const BundleIndex& index = work.index;
  for (std::size_t r = 0; r < to_index(index.free_poses); ++r) {
    const BundlePose& from = work.state.poses[r];
    Matrix3<double> rotation;
    for (int e = 0; e < 9; ++e) rotation(e / 3, e % 3) = from.rotation[e];
    SE3<double>& pose = problem.poses[to_index(index.pose_of_rank[r])];
    pose.rotation = normalized_rotation(rotation);
    pose.translation = -(pose.rotation * Vector3<double>(from.center[0], from.center[1], from.center[2]));
  }
  for (std::size_t j = 0; j < index.point_of.size(); ++j) {
    const double* x = work.state.points.data() + 3 * j;
    problem.points[to_index(index.point_of[j])] = Vector3<double>(x[0], x[1], x[2]);
  }
}

template <typename Camera, typename Scalar>
void write_squared_errors(const BundleProblem<Camera, Scalar>& problem, span<double> squared_errors) noexcept {
  const auto& observations = problem.observations;
  CFP_ASSERT(squared_errors.size() == observations.pose.size());
  for (std::size_t i = 0; i < squared_errors.size(); ++i) {
    const int k = observations.pose[i], j = observations.point[i];
    BundleMeasurement m;
    double error = -1;
    const bool judged = k >= 0 && to_index(k) < problem.poses.size() && j >= 0 && to_index(j) < problem.points.size() &&
                        read_measurement(observations, i, problem.baseline_fx, m) &&
                        squared_error(camera_of(problem.cameras, k), problem.poses[to_index(k)],
                                      problem.points[to_index(j)], m, problem.baseline_fx, error);
    squared_errors[i] = judged && is_finite(error) ? error : -1;
  }
}

}  // namespace cfp::detail
