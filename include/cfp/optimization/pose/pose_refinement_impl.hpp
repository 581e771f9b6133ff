/// @file pose_refinement_impl.hpp
/// The machinery of pose_refinement.hpp: rounds, damped Gauss-Newton, drafts in float.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "cfp/math/normal_equations.hpp"
#include "cfp/optimization/pose/pose_passes_impl.hpp"
#include "cfp/optimization/pose/pose_refinement_types.hpp"

namespace cfp::detail {

inline bool is_rigid_motion(const SE3<double>& T) noexcept {
  bool finite = true;
  for (int i = 0; i < 3; ++i) {
    finite = finite && std::abs(T.translation[i]) <= 1e9;
    for (int j = 0; j < 3; ++j) finite = finite && std::abs(T.rotation(i, j)) <= 2;
  }
  // A float rotation from a host is off by 1e-7 or, after many products, more; a scaled or mirrored matrix is a
  // mistake.
  return finite && (T.rotation.transpose() * T.rotation - Matrix3<double>::Identity()).cwiseAbs().maxCoeff() < 1e-2 &&
         determinant(T.rotation) > 0;
}

template <typename Camera>
bool is_usable_camera(const Camera& camera) noexcept {
  if constexpr (is_pinhole<Camera>::value) {
    return camera.fx >= 1e-3 && camera.fx <= 1e6 && camera.fy >= 1e-3 && camera.fy <= 1e6 &&
           std::abs(camera.cx) <= 1e7 && std::abs(camera.cy) <= 1e7;
  } else {
    return true;
  }
}

/// Lets H + correction map the last step to the change of the gradient that it brought; both stay symmetric and
/// positive.
inline void learn_curvature(const Matrix6<double>& H, const Vector6<double>& change, const Vector6<double>& step,
                            Matrix6<double>& correction) noexcept {
  const Matrix6<double> model = H + correction;
  Vector6<double> expected;
  expected.noalias() = model.selfadjointView<Eigen::Upper>() * step;
  const double curvature = step.dot(expected), seen = step.dot(change);
  if (!(seen > 0.1 * curvature)) return;
  for (int i = 0; i < 6; ++i) {
    for (int j = i; j < 6; ++j)
      correction(i, j) += change[i] * change[j] / seen - expected[i] * expected[j] / curvature;
  }
}

/// One refinement: the loaded observations and the pose, which is kept relative to the start position (see
/// refine_pose).
///
/// In double, a pinhole camera's passes on the way are drafts, made in float on a copy of the columns: twice the points
/// per register. A pose is evaluated in draft while the step that leads to it promises to move pixels by more than 0.1
/// sigma on average; float knows a pixel to 3e-5 px (6e-8 of the focal length). From then on the round continues in
/// double. So it does when a draft refuses a step. What is returned, or chooses inliers, is evaluated in double, and a
/// draft that ends without a pose (degenerate or not finite in float, too few inliers) is forgotten: the rounds are run
/// again in double alone.
template <typename P, typename Camera>
class PoseRefinement {
  using Scalar = scalar_of<P>;
  static constexpr bool has_draft =
      std::is_same<Scalar, double>::value && (lanes_of<P> > 1) && is_pinhole<Camera>::value;
  using DraftP = std::conditional_t<has_draft, Packet<float>, P>;

 public:
  PoseRefinement(const Camera& camera, const SE3<double>& start, const PoseOptions& options) noexcept
      : options_(options),
        passes_{camera, options, {}},
        drafts_{camera, options, {}},
        centre_(start.rotation.transpose() * -start.translation) {
    start_.rotation = start.rotation;
  }

  template <typename Input>
  void load(const PoseObservations<Input>& observations, PoseWorkspace<Scalar>& workspace, PoseResult& result) {
    constexpr std::size_t lanes =
        static_cast<std::size_t>(lanes_of < P >> lanes_of<DraftP> ? lanes_of<P> : lanes_of<DraftP>);
    passes_.columns.load(observations, passes_.camera, centre_, options_.convention, lanes, workspace, result);
    if constexpr (has_draft) {
      drafts_suit_ = passes_.columns.suit_float();
      if (drafts_suit_) drafts_.columns.copy(passes_.columns, workspace.draft);
    }
  }

  /// Runs the rounds; writes pose, information, cost, chi2, counts and reason. The mask of inliers: mark_inliers.
  void run(PoseResult& result) noexcept {
    run_rounds(drafts_suit_, result);
    if (drafts_suit_ && !is_refined(result.reason)) {
      passes_.columns.forget_passes();
      run_rounds(false, result);
    }
    if (!is_refined(result.reason)) return;
    result.T_cam_world = {pose_.rotation, pose_.translation - pose_.rotation * centre_};
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j)
        result.information(i, j) = system_.H((std::min)(i, j), (std::max)(i, j)) * passes_.columns.mean_weight;
    }
    result.cost = system_.cost * passes_.columns.mean_weight;
  }

  void mark_inliers(span<char> inliers) const noexcept { passes_.mark_inliers(inliers); }

 private:
  /// The rounds, beginning in draft or in double alone; afterwards system_ is of pose_ and in double, unless there is a
  /// reason against it.
  void run_rounds(bool draft, PoseResult& result) noexcept {
    const PoseRound* done = &options_.rounds[0];  // the last one that was run
    pose_ = start_;
    next_is_draft_ = draft;
    result.rounds = 0;
    for (std::size_t r = 0; r < options_.round_count; ++r) {
      const PoseRound& round = options_.rounds[r];
      bool changed = false;
      if (r > 0 && (round.inliers_only || options_.rounds[r - 1].inliers_only)) {
        if (round.inliers_only && !settle(*done, result)) return;
        changed = passes_.activate(round.inliers_only);
        if (draft && changed) {
          drafts_.columns.active = round.inliers_only ? drafts_.columns.kept : drafts_.columns.weight;
          if (round.inliers_only) drafts_.columns.copy_column(passes_.columns.kept, drafts_.columns.kept);
        }
      }
      if (r > 0 && !changed && round == options_.rounds[r - 1]) continue;
      if (round.from_start) {
        pose_ = start_;
        if (draft && !next_is_draft_) draft_next();
      }
      ++result.rounds;
      solve(round, result);
      done = &round;
      if (!is_refined(result.reason) || !has_enough_inliers(result)) return;
    }
    (void)settle(*done, result);
  }

  /// The pass for T, in the arithmetic that is due.
  PoseSystem evaluate(const SE3<double>& T, const PoseRound& round, PoseResult& result) const noexcept {
    ++result.evaluations;
    PoseSystem system = next_is_draft_ ? drafts_.evaluate(T, round) : passes_.evaluate(T, round);
    system.draft = next_is_draft_;
    return system;
  }
  void draft_next() noexcept {
    next_is_draft_ = true;
    drafts_.columns.copy_errors(passes_.columns);
  }
  void double_next() noexcept {
    next_is_draft_ = false;
    passes_.columns.copy_errors(drafts_.columns);
  }
  bool has_enough_inliers(PoseResult& result) const noexcept {
    result.inliers = system_.draft ? drafts_.count_inliers(result.chi2) : passes_.count_inliers(result.chi2);
    if (result.inliers < options_.min_observations) result.reason = PoseStop::not_enough_inliers;
    return is_refined(result.reason);
  }
  /// Evaluates pose_ in double where that has not been done; false: too few inliers.
  bool settle(const PoseRound& round, PoseResult& result) noexcept {
    if (!system_.draft) return true;
    if (next_is_draft_) double_next();
    system_ = evaluate(pose_, round, result);
    return has_enough_inliers(result);
  }

  /// Gauss-Newton from pose_; steps that do not lower the cost are taken back and shortened (Levenberg-Marquardt). H
  /// lacks the curvature of loss and projection, which would make the convergence linear; near the minimum a secant
  /// correction learns it (structured BFGS: Dennis, Schnabel 1983, section 10.3): 10 % to 15 % fewer passes.
  void solve(const PoseRound& round, PoseResult& result) noexcept {
    constexpr double rounding = static_cast<double>(std::numeric_limits<Scalar>::epsilon());
    constexpr double near =
        100;  // decrease, so 10 sigma of the pose: further away a difference of gradients says little of the minimum
    constexpr double draft_rounding = 1e-5;  // of a draft's cost
    const double enough = (std::max)(round.min_decrease, round.min_mean_decrease * result.used);
    const double draft_ends = 0.01 * result.used;  // decrease, so 0.1 sigma of every pixel
    system_ = evaluate(pose_, round, result);
    Matrix6<double> correction = Matrix6<double>::Zero();
    double damping = 0;
    bool current = true;  // whether the stored errors belong to pose_
    result.reason = PoseStop::iteration_limit;
    for (int iteration = 0;; ++iteration) {
      const double degenerate = system_.draft ? static_cast<double>(Tolerance<float>::degenerate)
                                              : static_cast<double>(Tolerance<Scalar>::degenerate);
      Vector6<double> step;
      const Matrix6<double> H = system_.H + correction;
      if (!solve_normal_equations<6>(H, system_.g, damping, degenerate, step)) {
        if (!solve_normal_equations<6>(system_.H, system_.g, damping, degenerate, step)) {
          result.reason = PoseStop::degenerate;
          return;
        }
        correction.setZero();
      }
      double decrease = 0;  // of the quadratic model
      for (int i = 0; i < 6; ++i) decrease += -system_.g[i] * step[i] + damping * H(i, i) * step[i] * step[i];
      if (next_is_draft_ && !(decrease > draft_ends)) double_next();
      if (damping == 0 && !(decrease > (std::max)(enough, rounding * system_.cost))) {
        result.reason = PoseStop::converged;
        break;
      }
      if (iteration == round.max_iterations) break;
      const SE3<double> trial = se3_exp(step) * pose_;
      const PoseSystem trial_system = evaluate(trial, round, result);
      current = trial_system.cost < system_.cost * (system_.draft ? 1 + draft_rounding : 1);
      if (current) {
        if (damping == 0 && decrease < near)
          learn_curvature(trial_system.H, trial_system.g - system_.g, step, correction);
        pose_ = trial;
        system_ = trial_system;
        damping = damping > 1e-4 ? damping * 0.1 : 0;
      } else if (system_.draft) {  // whether the step fails is for double to say
        if (next_is_draft_) double_next();
        system_ = evaluate(pose_, round, result);
        current = true;
        correction.setZero();
      } else if (damping < 1e8) {
        correction.setZero();
        damping = damping > 0 ? damping * 10 : 1e-3;
      } else {
        result.reason = PoseStop::no_decrease;
        break;
      }
    }
    if (!current) system_ = evaluate(pose_, round, result);
  }

  const PoseOptions& options_;
  PosePasses<P, Camera> passes_;
  PosePasses<DraftP, Camera> drafts_;
  bool drafts_suit_ = false, next_is_draft_ = false;
  Vector3<double> centre_;
  SE3<double> start_, pose_;  // about the start position: p = R (X - centre) + t
  PoseSystem system_;         // at pose_
};

/// refine_pose with the packet type named: P = Scalar is the scalar path.
template <typename P, typename Input, typename Camera>
PoseResult refine_pose_with(const PoseObservations<Input>& observations, const Camera& camera,
                            const SE3<double>& T_cam_world, const PoseOptions& options,
                            PoseWorkspace<scalar_of<P>>& workspace, span<char> inliers) {
  const std::size_t n = observations.points.size();
  const auto fits = [n](std::size_t size) { return size == 0 || size == n; };
  CFP_ASSERT(!invalid_field(options) && observations.pixels.size() == n);
  CFP_ASSERT(fits(observations.weights.size()) && fits(observations.sigmas.size()) &&
             fits(observations.inverse_sigmas_sq.size()));
  CFP_ASSERT(fits(observations.depths.size()) && fits(observations.u_right.size()) && fits(inliers.size()));
  (void)fits;
  PoseResult result;
  result.T_cam_world = T_cam_world;
  for (char& inlier : inliers) inlier = 0;
  if (!is_rigid_motion(T_cam_world) || !is_usable_camera(camera)) {
    bool finite = true;
    for (int i = 0; i < 3; ++i) finite = finite && is_finite(T_cam_world.translation[i]);
    for (int i = 0; i < 9; ++i) finite = finite && is_finite(T_cam_world.rotation.data()[i]);
    if (!finite) result.T_cam_world = SE3<double>();
    result.reason = PoseStop::invalid_input;
    return result;
  }
  PoseRefinement<P, Camera> refinement(camera, {normalized_rotation(T_cam_world.rotation), T_cam_world.translation},
                                       options);
  refinement.load(observations, workspace, result);
  if (result.used < options.min_observations) {
    result.reason = result.used == 0 && result.zero_weight > 0 && result.invalid == 0 ? PoseStop::no_weight
                                                                                      : PoseStop::not_enough_data;
    return result;
  }
  refinement.run(result);
  if (!is_refined(result.reason)) {
    result.inliers = 0;
    result.chi2 = 0;
  } else if (!inliers.empty()) {
    refinement.mark_inliers(inliers);
  }
  return result;
}

}  // namespace cfp::detail
