/// @file bundle_adjustment_impl.hpp
/// Inside bundle_adjustment.hpp: the problem that the least-squares loop minimises, and the way between the caller's
/// arrays and the solver's.
#pragma once

#include <algorithm>
#include <utility>

#include "cfp/math/so3.hpp"
#include "cfp/optimization/bundle/bundle_elimination_impl.hpp"
#include "cfp/optimization/bundle/bundle_order_impl.hpp"
#include "cfp/optimization/bundle/bundle_problem.hpp"
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

/// Sizes the arrays; the envelope holds the blocks of the reduced system that some eliminated pose or point fills.
template <int E, int K = 9 - E>
void reserve_schur(const BundleIndex& index, BundleSchur& schur) {
  BlockEnvelope& envelope = schur.envelope;
  const std::size_t kept = K == 6 ? index.free_poses : index.points, eliminated = index.eliminated_part.back();
  envelope.first.resize(kept);
  for (std::size_t row = 0; row < kept; ++row) envelope.first[row] = row;
  for (std::size_t i = 0; i < eliminated; ++i) {
    const std::size_t begin = index.slot_begin[i];
    for (std::size_t s = begin; s < index.slot_begin[i + 1]; ++s) {
      const std::size_t row = BundleKind<K>::slot(index, s);
      if (row < kept) envelope.first[row] = (std::min)(envelope.first[row], BundleKind<K>::slot(index, begin));
    }
  }
  number_blocks(envelope);
  for (std::vector<double>& blocks : schur.blocks) blocks.resize(BundleKind<K>::block * envelope.blocks);
  for (std::vector<double>& side : schur.right_side) side.resize(BundleKind<K>::size * kept);
  schur.triangles.resize(BundleKind<E>::system * eliminated);
  schur.couplings.resize(18 * index.slots.size());
  schur.coupled.resize(index.slots.size());
  schur.coupled_end.resize(eliminated);
  schur.pose_steps.resize(6 * index.free_poses);
  schur.point_steps.resize(3 * index.points);
}

/// Sizes every array and copies the poses and points that take part.
template <typename Camera, typename Scalar>
void prepare(const BundleProblem<Camera, Scalar>& problem, BundleWorkspace& workspace, BundleResult& result) {
  const BundleIndex& index = workspace.index;
  const std::size_t poses = index.caller_pose.size();
  if (index.eliminate_poses)
    reserve_schur<6>(index, workspace.schur);
  else
    reserve_schur<3>(index, workspace.schur);
  result.free_poses = index.free_poses;
  result.adjusted_points = index.points;
  result.factor_blocks = workspace.schur.envelope.blocks;
  workspace.state.poses.resize(poses);
  workspace.state.points.resize(index.points);
  for (BundleLinearization* linear : {&workspace.linear, &workspace.next_linear}) {
    linear->slots.resize(BundleLinearization::slot_doubles * index.slots.size());
    linear->points.resize(BundleKind<3>::system * index.points);
    linear->poses.resize(BundleKind<6>::system * index.free_poses);
    linear->costs.resize(poses);
  }
  for (std::size_t k = 0; k < poses; ++k) workspace.state.poses[k] = index.caller_poses[to_index(index.caller_pose[k])];
  for (std::size_t j = 0; j < index.points; ++j)
    workspace.state.points[j] = problem.points[to_index(index.caller_point[j])];
  workspace.next_state = workspace.state;
}

/// The steps applied; fixed poses are the same in both. State: BundleState; a template, so that it is compiled where it
/// is called.
template <typename State>
void move(const BundleIndex& index, const State& state, const BundleSchur& schur, State& next) noexcept {
  for (std::size_t k = 0; k < index.free_poses; ++k) {
    const Eigen::Map<const Vector6<double>> xi(schur.pose_steps.data() + 6 * k);
    next.poses[k] = {state.poses[k].rotation * so3_exp<double>(xi.tail<3>()), state.poses[k].center - xi.head<3>()};
  }
  for (std::size_t j = 0; j < index.points; ++j)
    next.points[j] = state.points[j] + Eigen::Map<const Vector3<double>>(schur.point_steps.data() + 3 * j);
}

/// Bundle adjustment as minimize_least_squares wants it.
template <typename Problem, typename Executor>
struct BundleLeastSquares {
  // Below so many observations a phase is over before another thread has woken up.
  static constexpr std::size_t worth_sharing = 4000;
  const Problem& problem;
  const BundleOptions& options;
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
    if (!(workspace.index.eliminate_poses ? solve<6>(damping) : solve<3>(damping)))
      return std::numeric_limits<double>::quiet_NaN();
    const BundleSchur& schur = workspace.schur;
    move(workspace.index, workspace.state, schur, workspace.next_state);
    return promised_by<3>(workspace.linear, schur.point_steps, damping) +
           promised_by<6>(workspace.linear, schur.pose_steps, damping);
  }

 private:
  template <typename Task>
  void run(const Task& task) {
    const int parts = static_cast<int>(bundle_parts);
    if (workspace.index.observations.size() >= worth_sharing)
      executor(parts, task);
    else
      SingleThread()(parts, task);
  }

  double linearize_at(const BundleState& state, BundleLinearization& linear) {
    const BundleIndex& index = workspace.index;
    run([&](int part) {
      for (std::size_t k = index.pose_part[to_index(part)]; k < index.pose_part[to_index(part) + 1]; ++k)
        linearize_pose(problem, index, k, options, state, linear);
    });
    linearize_points(index, linear);
    double cost = 0;
    for (const double c : linear.costs) cost += c;
    return cost;
  }

  template <int E>
  [[nodiscard]] bool solve(double damping) {
    bool definite[bundle_parts];
    run([&](int part) {
      definite[part] =
          eliminate<E>(workspace.index, workspace.state, workspace.linear, damping, to_index(part), workspace.schur);
    });
    return std::all_of(definite, definite + bundle_parts, [](bool part) { return part; }) &&
           solve_reduced<E>(workspace.index, workspace.schur);
  }
};

template <typename Camera, typename Scalar>
void write_back(const BundleProblem<Camera, Scalar>& problem, const BundleWorkspace& workspace) noexcept {
  const BundleIndex& index = workspace.index;
  for (std::size_t k = 0; k < index.free_poses; ++k) {
    const BundlePose& from = workspace.state.poses[k];
    SE3<double>& pose = problem.poses[to_index(index.caller_pose[k])];
    pose.rotation = normalized_rotation(from.rotation);
    pose.translation = -(pose.rotation * from.center);
  }
  for (std::size_t j = 0; j < index.points; ++j)
    problem.points[to_index(index.caller_point[j])] = workspace.state.points[j];
}

template <typename Camera, typename Scalar>
void write_squared_errors(const BundleProblem<Camera, Scalar>& problem, BundleIndex& index,
                          span<double> squared_errors) noexcept {
  CFP_ASSERT(squared_errors.size() == problem.observations.pose.size());
  read_poses(problem, index);
  for (std::size_t i = 0; i < squared_errors.size(); ++i) {
    BundleMeasurement m;
    const bool valid = read_measurement(problem, i, m) && index.is_rigid[to_index(m.pose)] != 0;
    const double error = valid ? squared_error(problem, index, m) : -1;
    squared_errors[i] = is_finite(error) && is_finite(error * m.weight) ? error : -1;
  }
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
