/// @file weighted_pnp_impl.hpp
/// The machinery of weighted_pnp.hpp: loading, damped Gauss-Newton, rounds.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "cfp/optimization/pose_columns.hpp"
#include "cfp/optimization/pose_system.hpp"
#include "cfp/optimization/weighted_pnp_types.hpp"

namespace cfp::detail {

/// Solves (H + damping diag H) step = -g by Cholesky (L D L^T) of the matrix scaled to a unit diagonal; H: upper triangle.
/// False for an H that is not positive definite, or whose smallest pivot, 1 - (multiple correlation)^2, is below `tolerance`.
inline bool solve_pose_step(const Matrix6<double>& H, const Vector6<double>& g, double damping, double tolerance, Vector6<double>& step) noexcept {
  double scale[6], L[6][6], pivot[6], inverse[6];
  for (int i = 0; i < 6; ++i) {
    if (!(H(i, i) > 0) || !is_finite(H(i, i))) return false;
    scale[i] = 1 / std::sqrt(H(i, i));
  }
  for (int j = 0; j < 6; ++j) {
    double d = 1 + damping;
    for (int k = 0; k < j; ++k) d -= L[j][k] * L[j][k] * pivot[k];
    if (!(d > tolerance)) return false;
    pivot[j] = d;
    inverse[j] = 1 / d;
    for (int i = j + 1; i < 6; ++i) {
      double sum = H(j, i) * scale[j] * scale[i];
      for (int k = 0; k < j; ++k) sum -= L[i][k] * L[j][k] * pivot[k];
      L[i][j] = sum * inverse[j];
    }
  }
  for (int i = 0; i < 6; ++i) {
    step[i] = -g[i] * scale[i];
    for (int k = 0; k < i; ++k) step[i] -= L[i][k] * step[k];
  }
  for (int i = 5; i >= 0; --i) {
    step[i] *= inverse[i];
    for (int k = i + 1; k < 6; ++k) step[i] -= L[k][i] * step[k];
  }
  bool finite = true;
  for (int i = 0; i < 6; ++i) {
    step[i] *= scale[i];
    finite = finite && is_finite(step[i]);
  }
  return finite;
}

inline bool is_rigid_motion(const SE3<double>& T) noexcept {
  bool finite = true;
  for (int i = 0; i < 3; ++i) {
    finite = finite && std::abs(T.translation[i]) <= 1e9;
    for (int j = 0; j < 3; ++j) finite = finite && std::abs(T.rotation(i, j)) <= 2;
  }
  // A float rotation from a host is off by 1e-7 or, after many products, more; a scaled or mirrored matrix is a mistake.
  return finite && (T.rotation.transpose() * T.rotation - Matrix3<double>::Identity()).cwiseAbs().maxCoeff() < 1e-2 && T.rotation.determinant() > 0;
}

/// Calls visit(i) for every whole packet from begin on until end is covered: the columns are padded.
template <typename P, typename Visit>
void for_each_packet(std::size_t begin, std::size_t end, Visit&& visit) noexcept {
  for (std::size_t i = begin; i < end; i += static_cast<std::size_t>(lanes_of<P>)) visit(i);
}

template <typename Camera>
bool is_usable_camera(const Camera& camera) noexcept {
  if constexpr (is_pinhole<Camera>::value) {
    return camera.fx >= 1e-3 && camera.fx <= 1e6 && camera.fy >= 1e-3 && camera.fy <= 1e6 && std::abs(camera.cx) <= 1e7 && std::abs(camera.cy) <= 1e7;
  } else {
    return true;
  }
}

/// One refinement: the loaded observations and the pose, which is kept relative to the start position (see refine_pose).
template <typename P, typename Camera>
class PoseRefinement {
  using Scalar = scalar_of<P>;

 public:
  PoseRefinement(const Camera& camera, const SE3<double>& start, const WeightedPnPOptions& options) noexcept
      : camera_(camera), options_(options), centre_(start.rotation.transpose() * -start.translation) {
    start_.rotation = start.rotation;
  }

  template <typename Input>
  void load(const PoseObservations<Input>& observations, WeightedPnPWorkspace<Scalar>& workspace, WeightedPnPResult& result) {
    columns_.load(observations, camera_, centre_, options_.convention, static_cast<std::size_t>(lanes_of<P>), workspace, result);
  }

  /// Runs the rounds; writes pose, information, cost, chi2, counts and reason. The mask of inliers: mark_inliers.
  void run(WeightedPnPResult& result) noexcept {
    pose_ = start_;
    for (std::size_t r = 0; r < options_.round_count; ++r) {
      const PoseRound& round = options_.rounds[r];
      const bool subset = r > 0 && (round.inliers_only || options_.rounds[r - 1].inliers_only);
      const bool changed = subset && activate(round.inliers_only);
      if (r > 0 && !changed && round == options_.rounds[r - 1]) continue;
      if (round.from_start) pose_ = start_;
      ++result.rounds;
      solve(round, result);
      if (!is_refined(result.reason)) return;
      result.inliers = count_inliers(result.chi2);
      if (result.inliers < options_.min_observations) {
        result.reason = PoseStop::not_enough_inliers;
        return;
      }
    }
    result.T_cam_world = {pose_.rotation, pose_.translation - pose_.rotation * centre_};
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) result.information(i, j) = system_.H((std::min)(i, j), (std::max)(i, j)) * columns_.mean_weight;
    }
    result.cost = system_.cost * columns_.mean_weight;
  }

  void mark_inliers(span<char> inliers) const noexcept {
    columns_.for_each_kind(options_, [&](std::size_t begin, std::size_t end, double chi2_limit) {
      const Scalar threshold = static_cast<Scalar>(chi2_limit);
      for (std::size_t i = begin; i < end; ++i) inliers[columns_.index[i]] = columns_.error[i] >= Scalar(0) && columns_.error[i] <= threshold ? char(1) : char(0);
    });
  }

 private:
  [[nodiscard]] static auto is_inlier(const P& error, const P& threshold) noexcept { return both(error >= P(Scalar(0)), error <= threshold); }

  int count_inliers(double& chi2) const noexcept {
    constexpr std::size_t block = 64 * static_cast<std::size_t>(lanes_of<P>);
    const P zero(Scalar(0)), one(Scalar(1));
    double count = 0, sum = 0;
    columns_.for_each_kind(options_, [&](std::size_t begin, std::size_t end, double chi2_limit) {
      const P threshold(static_cast<Scalar>(chi2_limit));
      for (; begin < end; begin += block) {
        P block_count = zero, block_sum = zero;
        for_each_packet<P>(begin, (std::min)(end, begin + block), [&](std::size_t i) {
          const P error = cfp::load<P>(columns_.error + i), weight = cfp::load<P>(columns_.weight + i);
          const auto inlier = both(is_inlier(error, threshold), weight > zero);  // weight 0: padding
          block_count += select(inlier, one, zero);
          block_sum += select(inlier, weight * error, zero);
        });
        count += static_cast<double>(reduce_add(block_count));
        sum += static_cast<double>(reduce_add(block_sum));
      }
    });
    chi2 = sum * columns_.mean_weight;
    return static_cast<int>(count);
  }
  /// Chooses the observations of the next round; whether the choice differs from the last round's.
  bool activate(bool inliers_only) noexcept {
    const P zero(Scalar(0));
    P changed = zero;
    columns_.for_each_kind(options_, [&](std::size_t begin, std::size_t end, double chi2_limit) {
      const P threshold(static_cast<Scalar>(chi2_limit));
      for_each_packet<P>(begin, end, [&](std::size_t i) {
        using std::abs;
        const P weight = cfp::load<P>(columns_.weight + i);
        const P active = inliers_only ? select(is_inlier(cfp::load<P>(columns_.error + i), threshold), weight, zero) : weight;
        changed += abs(active - cfp::load<P>(columns_.active + i));
        store(columns_.active + i, active);
      });
    });
    return reduce_add(changed) > Scalar(0);
  }

  PoseSystem evaluate(const SE3<double>& T, const PoseRound& round) const noexcept {
    PoseSystem system;
    const auto add = [&](std::size_t begin, std::size_t end, double chi2, auto stereo) {
      constexpr bool is_stereo = decltype(stereo)::value;
      const double delta = round.scale * std::sqrt(chi2);
      if constexpr (is_pinhole<Camera>::value) {
        with_loss<P>(round.loss, P(static_cast<Scalar>(delta)),
                     [&](const auto& loss) { add_pinhole<P, is_stereo>(columns_, begin, end, camera_, columns_.baseline_fx, T, loss, system); });
      } else {
        with_loss<double>(round.loss, delta, [&](const auto& loss) { add_camera<is_stereo>(columns_, begin, end, camera_, columns_.baseline_fx, T, loss, system); });
      }
    };
    if (columns_.mono > 0) add(0, columns_.mono, options_.chi2_mono, std::false_type());
    if (columns_.stereo_end > columns_.stereo_begin) add(columns_.stereo_begin, columns_.stereo_end, options_.chi2_stereo, std::true_type());
    return system;
  }

  /// Gauss-Newton from pose_; steps that do not lower the cost are taken back and shortened (Levenberg-Marquardt). H lacks the
  /// curvature of loss and projection, which would make the convergence linear; near the minimum a secant correction learns it
  /// (structured BFGS: Dennis, Schnabel 1983, section 10.3): 10 % to 15 % fewer passes.
  void solve(const PoseRound& round, WeightedPnPResult& result) noexcept {
    constexpr double degenerate = static_cast<double>(Tolerance<Scalar>::degenerate), rounding = static_cast<double>(std::numeric_limits<Scalar>::epsilon());
    constexpr double near = 100;  // decrease, so 10 sigma of the pose: further away a difference of gradients says little of the minimum
    const double enough = (std::max)(round.min_decrease, round.min_mean_decrease * result.used);
    system_ = evaluate(pose_, round);
    ++result.evaluations;
    Matrix6<double> correction = Matrix6<double>::Zero();
    double damping = 0;
    bool current = true;  // whether the stored errors belong to pose_
    result.reason = PoseStop::iteration_limit;
    for (int iteration = 0;; ++iteration) {
      Vector6<double> step;
      const Matrix6<double> H = system_.H + correction;
      if (!solve_pose_step(H, system_.g, damping, degenerate, step)) {
        if (!solve_pose_step(system_.H, system_.g, damping, degenerate, step)) {
          result.reason = PoseStop::degenerate;
          return;
        }
        correction.setZero();
      }
      double decrease = 0;  // of the quadratic model
      for (int i = 0; i < 6; ++i) decrease += -system_.g[i] * step[i] + damping * H(i, i) * step[i] * step[i];
      if (damping == 0 && !(decrease > (std::max)(enough, rounding * system_.cost))) {
        result.reason = PoseStop::converged;
        break;
      }
      if (iteration == round.max_iterations) break;
      const SE3<double> trial = se3_exp(step) * pose_;
      const PoseSystem trial_system = evaluate(trial, round);
      ++result.evaluations;
      current = trial_system.cost < system_.cost;
      if (current) {
        if (damping == 0 && decrease < near) correct(trial_system.H, trial_system.g - system_.g, step, correction);
        pose_ = trial;
        system_ = trial_system;
        damping = damping > 1e-4 ? damping * 0.1 : 0;
      } else if (damping < 1e8) {
        correction.setZero();
        damping = damping > 0 ? damping * 10 : 1e-3;
      } else {
        result.reason = PoseStop::no_decrease;
        break;
      }
    }
    if (!current) {
      system_ = evaluate(pose_, round);
      ++result.evaluations;
    }
  }

  /// Lets H + correction map the last step to the change of the gradient that it brought; both stay symmetric and positive.
  static void correct(const Matrix6<double>& H, const Vector6<double>& change, const Vector6<double>& step, Matrix6<double>& correction) noexcept {
    const Matrix6<double> model = H + correction;
    Vector6<double> expected;
    expected.noalias() = model.selfadjointView<Eigen::Upper>() * step;
    const double curvature = step.dot(expected), seen = step.dot(change);
    if (!(seen > 0.1 * curvature)) return;
    for (int i = 0; i < 6; ++i) {
      for (int j = i; j < 6; ++j) correction(i, j) += change[i] * change[j] / seen - expected[i] * expected[j] / curvature;
    }
  }

  const Camera& camera_;
  const WeightedPnPOptions& options_;
  PoseColumns<Scalar> columns_;
  Vector3<double> centre_;
  SE3<double> start_, pose_;  // about the start position: p = R (X - centre) + t
  PoseSystem system_;
};

/// refine_pose with the packet type named: P = Scalar is the scalar path.
template <typename P, typename Input, typename Camera>
WeightedPnPResult refine_pose_with(const PoseObservations<Input>& observations, const Camera& camera, const SE3<double>& T_cam_world,
                                   const WeightedPnPOptions& options, WeightedPnPWorkspace<scalar_of<P>>& workspace, span<char> inliers) {
  const std::size_t n = observations.points.size();
  const auto fits = [n](std::size_t size) { return size == 0 || size == n; };
  CFP_ASSERT(invalid_field(options) == nullptr && observations.pixels.size() == n);
  CFP_ASSERT(fits(observations.weights.size()) && fits(observations.sigmas.size()) && fits(observations.inverse_sigmas_sq.size()));
  CFP_ASSERT(fits(observations.depths.size()) && fits(observations.u_right.size()) && fits(inliers.size()));
  (void)fits;
  WeightedPnPResult result;
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
  PoseRefinement<P, Camera> refinement(camera, {normalized_rotation(T_cam_world.rotation), T_cam_world.translation}, options);
  refinement.load(observations, workspace, result);
  if (result.used < options.min_observations) {
    result.reason = result.used == 0 && result.zero_weight > 0 && result.invalid == 0 ? PoseStop::no_weight : PoseStop::not_enough_data;
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
