/// @file bundle_adjustment_impl.hpp
/// Inside bundle_adjustment.hpp: the problem that the least-squares loop minimises, and the way between the caller's
/// arrays and the solver's.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include "cfp/optimization/bundle/bundle_order_impl.hpp"
#include "cfp/optimization/bundle/bundle_pose_elimination_impl.hpp"
#include "cfp/optimization/bundle/bundle_problem.hpp"
#include "cfp/optimization/bundle/bundle_schur_impl.hpp"
#include "cfp/optimization/least_squares.hpp"

namespace cfp {

/// Scratch memory of adjust_bundle; keeps what it has grown to. One per thread that calls.
struct BundleWorkspace {
  CFP_INLINE BundleWorkspace() = default;  // sets members by vector instructions
  // Internal: the stages of adjust_bundle work on these.
  detail::BundleIndex index;
  detail::BundleState state, next_state;
  detail::BundleLinearization linear, next_linear;
  detail::BundleSchur schur;
};

}  // namespace cfp

namespace cfp::detail {
inline namespace CFP_ISA {

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
void prepare(const BundleProblem<Camera, Scalar>& problem, BundleWorkspace& workspace, BundleResult& result) {
  const BundleIndex& index = workspace.index;
  BundleSchur& schur = workspace.schur;
  const std::size_t poses = index.caller_pose.size(), points = index.caller_point.size(),
                    free_poses = to_index(index.free_poses), links = index.link_pose.size(),
                    blocks = index.block_row.size();
  result.free_poses = free_poses;
  result.adjusted_points = points;
  result.reduced_blocks = blocks;
  if (index.eliminate_poses) {
    analyze_blocks<3>(static_cast<int>(points), index.block_row, index.block_column, schur.factor);
    schur.blocks[0].resize(9 * blocks);
    schur.right_side[0].resize(3 * points);
    schur.triangles.resize(42 * free_poses);
    schur.couplings.resize(BundleSchur::coupling_doubles * links);
  } else {
    analyze_blocks<6>(index.free_poses, index.block_row, index.block_column, schur.factor);
    for (std::size_t part = 0; part < to_index(bundle_parts); ++part) {
      schur.blocks[part].resize(36 * blocks);
      schur.right_side[part].resize(6 * free_poses);
      schur.pairs[part].resize(BundleSchur::pair_doubles * to_index(index.most_free_links));
    }
  }
  result.factor_blocks = schur.factor.row.size();
  schur.points.resize(BundleSchur::point_doubles * points);
  schur.pose_steps.resize(6 * free_poses);
  for (BundleState* state : {&workspace.state, &workspace.next_state}) {
    state->poses.resize(poses);
    state->points.resize(3 * points);
  }
  for (BundleLinearization* linear : {&workspace.linear, &workspace.next_linear}) {
    linear->links.resize(BundleLinearization::link_doubles * links);
    linear->poses.resize(BundleLinearization::pose_doubles * free_poses);
    linear->costs.resize(poses);
  }
  for (std::size_t k = 0; k < poses; ++k) {
    const SE3<double>& pose = problem.poses[to_index(index.caller_pose[k])];
    const Matrix3<double> rotation = normalized_rotation(pose.rotation);
    const Vector3<double> center = -(rotation.transpose() * pose.translation);
    for (int e = 0; e < 9; ++e) workspace.state.poses[k].rotation[e] = rotation(e / 3, e % 3);
    for (int e = 0; e < 3; ++e) workspace.state.poses[k].center[e] = center[e];
  }
  for (std::size_t j = 0; j < points; ++j) {
    const Vector3<double>& x = problem.points[to_index(index.caller_point[j])];
    std::copy(x.data(), x.data() + 3, workspace.state.points.data() + 3 * j);
  }
}

/// Bundle adjustment as minimize_least_squares wants it.
template <typename Problem, typename MonoLoss, typename StereoLoss, typename Executor>
struct BundleLeastSquares {
  // Below so many observations a phase is over before another thread has woken up.
  static constexpr std::size_t worth_sharing = 4000;
  const Problem& problem;
  const MonoLoss& mono;
  const StereoLoss& stereo;
  BundleWorkspace& workspace;
  Executor& executor;

  double linearize() { return linearize_at(workspace.state, workspace.linear); }
  /// NaN when a point is behind a camera that used to see it.
  double linearize_trial() { return linearize_at(workspace.next_state, workspace.next_linear); }
  void accept() {
    std::swap(workspace.state, workspace.next_state);
    std::swap(workspace.linear, workspace.next_linear);
  }
  double propose(double damping) {
    const BundleIndex& index = workspace.index;
    BundleSchur& schur = workspace.schur;
    if (!(index.eliminate_poses ? eliminate_poses(index, workspace.state, workspace.linear, damping, schur)
                                : solve_for_poses(damping)))
      return std::numeric_limits<double>::quiet_NaN();
    return move_points(index, workspace.state, workspace.linear, schur, damping, workspace.next_state) +
           move_poses(index, workspace.state, workspace.linear, schur, damping, workspace.next_state);
  }

 private:
  template <typename Task>
  void run(const Task& task) {
    if (workspace.index.kept.size() >= worth_sharing) {
      executor(bundle_parts, task);
    } else {
      for (int part = 0; part < bundle_parts; ++part) task(part);
    }
  }

  double linearize_at(const BundleState& state, BundleLinearization& linear) {
    const BundleIndex& index = workspace.index;
    run([&](int part) {
      for (int k = index.pose_part[to_index(part)]; k < index.pose_part[to_index(part) + 1]; ++k)
        linearize_pose(index, to_index(k), camera_of(problem.cameras, index.caller_pose[to_index(k)]),
                       problem.baseline_fx, mono, stereo, state, linear);
    });
    double cost = 0;
    for (const double c : linear.costs) cost += c;
    return cost;
  }

  /// The poses' steps by elimination of the points.
  [[nodiscard]] bool solve_for_poses(double damping) {
    BundleSchur& schur = workspace.schur;
    bool definite[bundle_parts];
    run([&](int part) {
      definite[part] =
          eliminate_points(workspace.index, workspace.state, workspace.linear, damping, to_index(part), schur);
    });
    for (const bool part : definite) {
      if (!part) return false;
    }
    for (std::size_t part = 1; part < to_index(bundle_parts); ++part) {
      for (std::size_t i = 0; i < schur.blocks[0].size(); ++i) schur.blocks[0][i] += schur.blocks[part][i];
      for (std::size_t i = 0; i < schur.right_side[0].size(); ++i) schur.right_side[0][i] += schur.right_side[part][i];
    }
    if (!factorize_blocks<6>(schur.blocks[0], schur.factor)) return false;
    std::copy(schur.right_side[0].begin(), schur.right_side[0].end(), schur.pose_steps.begin());
    solve_blocks<6>(schur.pose_steps, schur.factor);
    return true;
  }
};

template <typename Camera, typename Scalar>
void write_back(const BundleProblem<Camera, Scalar>& problem, const BundleWorkspace& workspace) noexcept {
  const BundleIndex& index = workspace.index;
  for (std::size_t k = 0; k < to_index(index.free_poses); ++k) {
    const BundlePose& from = workspace.state.poses[k];
    Matrix3<double> rotation;
    for (int e = 0; e < 9; ++e) rotation(e / 3, e % 3) = from.rotation[e];
    SE3<double>& pose = problem.poses[to_index(index.caller_pose[k])];
    pose.rotation = normalized_rotation(rotation);
    pose.translation = -(pose.rotation * Vector3<double>(from.center[0], from.center[1], from.center[2]));
  }
  for (std::size_t j = 0; j < index.caller_point.size(); ++j) {
    const double* x = workspace.state.points.data() + 3 * j;
    problem.points[to_index(index.caller_point[j])] = Vector3<double>(x[0], x[1], x[2]);
  }
}

template <typename Camera, typename Scalar>
void write_squared_errors(const BundleProblem<Camera, Scalar>& problem, span<double> squared_errors) noexcept {
  const auto& observations = problem.observations;
  CFP_ASSERT(squared_errors.size() == observations.pose.size());
  for (std::size_t i = 0; i < squared_errors.size(); ++i) {
    BundleMeasurement m;
    double error = -1;
    const bool readable = read_measurement(observations, i, problem.baseline_fx, m);
    const std::size_t k = static_cast<std::size_t>(m.pose), j = static_cast<std::size_t>(m.point);
    const bool judged = readable && m.pose >= 0 && k < problem.poses.size() && m.point >= 0 &&
                        j < problem.points.size() &&
                        squared_error(camera_of(problem.cameras, m.pose), problem.poses[k], problem.points[j], m,
                                      problem.baseline_fx, error);
    squared_errors[i] = judged && is_finite(error) ? error : -1;
  }
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
