/// @file weighted_pnp_impl.hpp
/// The machinery of weighted_pnp.hpp: loading, damped Gauss-Newton, rounds.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <type_traits>

#include "cfp/optimization/pose_system.hpp"
#include "cfp/optimization/weighted_pnp.hpp"

namespace cfp {

inline const char* invalid_field(const WeightedPnPOptions& options) noexcept {
  const auto positive = [](double x) { return x > 0 && is_finite(x); };
  if (!positive(options.chi2_mono)) return "chi2_mono";
  if (!positive(options.chi2_stereo)) return "chi2_stereo";
  if (!(static_cast<unsigned>(options.convention) <= 1U)) return "convention";
  if (!(options.min_observations >= 3)) return "min_observations";
  if (!(options.round_count >= 1 && options.round_count <= WeightedPnPOptions::max_rounds)) return "round_count";
  for (std::size_t i = 0; i < options.round_count; ++i) {
    const PoseRound& round = options.rounds[i];
    if (!(static_cast<unsigned>(round.loss) <= static_cast<unsigned>(LossType::truncated))) return "rounds.loss";
    if (!positive(round.scale)) return "rounds.scale";
    if (!(round.max_iterations >= 1)) return "rounds.max_iterations";
    if (!positive(round.min_decrease)) return "rounds.min_decrease";
  }
  return nullptr;
}

namespace detail {

template <typename Camera>
struct is_pinhole : std::false_type {};
template <typename C>
struct is_pinhole<PinholeCamera<C>> : std::true_type {};

/// Solves (H + damping diag H) step = -g by Cholesky (L D L^T) of the matrix scaled to a unit diagonal; H: upper triangle.
/// False for an H that is not positive definite, or whose smallest pivot, 1 - (multiple correlation)^2, is below `tolerance`.
inline bool solve_pose_step(const PoseSystem& system, double damping, double tolerance, double (&step)[6]) noexcept {
  double scale[6], L[6][6], pivot[6], inverse[6];
  for (int i = 0; i < 6; ++i) {
    if (!(system.H(i, i) > 0) || !is_finite(system.H(i, i))) return false;
    scale[i] = 1 / std::sqrt(system.H(i, i));
  }
  for (int j = 0; j < 6; ++j) {
    double d = 1 + damping;
    for (int k = 0; k < j; ++k) d -= L[j][k] * L[j][k] * pivot[k];
    if (!(d > tolerance)) return false;
    pivot[j] = d;
    inverse[j] = 1 / d;
    for (int i = j + 1; i < 6; ++i) {
      double sum = system.H(j, i) * scale[j] * scale[i];
      for (int k = 0; k < j; ++k) sum -= L[i][k] * L[j][k] * pivot[k];
      L[i][j] = sum * inverse[j];
    }
  }
  for (int i = 0; i < 6; ++i) {
    step[i] = -system.g[i] * scale[i];
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
  static constexpr std::size_t lanes = static_cast<std::size_t>(lanes_of<P>);

 public:
  PoseRefinement(const Camera& camera, const SE3<double>& start, const WeightedPnPOptions& options, WeightedPnPWorkspace<Scalar>& workspace) noexcept
      : camera_(camera), options_(options), workspace_(workspace), centre_(start.rotation.transpose() * -start.translation) {
    start_.rotation = start.rotation;
  }

  template <typename Input>
  void load_observations(const PoseObservations<Input>& observations, WeightedPnPResult& result) {
    const std::size_t n = observations.points.size();
    const std::size_t padded = (n + lanes - 1) / lanes * lanes;
    reserve(2 * padded, n);
    double sum = 0, sum_sq = 0;
    std::size_t mono = 0, stereo = padded;
    double fu = 1, fv = 1, cu = 0, cv = 0;
    if constexpr (is_pinhole<Camera>::value) {
      fu = 1 / static_cast<double>(camera_.fx), fv = 1 / static_cast<double>(camera_.fy);
      cu = static_cast<double>(camera_.cx), cv = static_cast<double>(camera_.cy);
    }
    baseline_fx_ = observations.baseline_fx > 0 && observations.baseline_fx <= 1e6 ? observations.baseline_fx : 0;
    for (std::size_t i = 0; i < n; ++i) {
      const double weight = observations.weights.empty() ? 1 : static_cast<double>(observations.weights[i]);
      if (weight == 0) {
        ++result.zero_weight;
        continue;
      }
      double information = observations.inverse_sigmas_sq.empty() ? 1 : static_cast<double>(observations.inverse_sigmas_sq[i]);
      if (!observations.sigmas.empty()) {
        const double sigma = static_cast<double>(observations.sigmas[i]);
        information = sigma > 0 ? 1 / (sigma * sigma) : 0;
      }
      const double x = static_cast<double>(observations.points(i, 0)) - centre_.x();
      const double y = static_cast<double>(observations.points(i, 1)) - centre_.y();
      const double z = static_cast<double>(observations.points(i, 2)) - centre_.z();
      const double u = static_cast<double>(observations.pixels(i, 0)), v = static_cast<double>(observations.pixels(i, 1));
      if (!(weight > 0 && weight <= 1e30 && information >= 1e-12 && information <= 1e12 && std::abs(x) <= 1e9 && std::abs(y) <= 1e9 &&
            std::abs(z) <= 1e9 && std::abs(u) <= 1e7 && std::abs(v) <= 1e7)) {
        ++result.invalid;
        continue;
      }
      double u_right = 0;
      bool has_depth = false;
      if (baseline_fx_ > 0 && !observations.depths.empty()) {
        const double depth = static_cast<double>(observations.depths[i]);
        u_right = u - baseline_fx_ / depth;
        has_depth = depth > 0 && std::abs(u_right) <= 1e7;
      } else if (baseline_fx_ > 0 && !observations.u_right.empty()) {
        u_right = static_cast<double>(observations.u_right[i]);
        has_depth = u_right > 0 && u_right <= 1e7;
      }
      const std::size_t slot = has_depth ? stereo++ : mono++;
      const bool scaled = options_.convention == WeightConvention::information_scale;
      set(slot, x, y, z, (u - cu) * fu, (v - cv) * fv, has_depth ? (u_right - cu) * fu : 0, scaled ? weight * information : information, scaled ? 1 : weight);
      workspace_.indices[has_depth ? n + (slot - padded) : slot] = static_cast<std::uint32_t>(i);
      sum += weight;
      sum_sq += weight * weight;
    }
    columns_.mono = mono, columns_.stereo_begin = padded, columns_.stereo_end = stereo;
    result.used_stereo = static_cast<int>(stereo - padded);
    result.used = static_cast<int>(mono) + result.used_stereo;
    if (result.used > 0) result.effective = sum / sum_sq * sum;
    used_ = result.used;
    mean_weight_ = used_ > 0 && options_.convention == WeightConvention::outside_loss ? sum / used_ : 1;
    for (; mono % lanes != 0; ++mono) set(mono, 0, 0, 0, 0, 0, 0, 1, 0);
    for (; stereo % lanes != 0; ++stereo) set(stereo, 0, 0, 0, 0, 0, 0, 1, 0);
    const Scalar normal = static_cast<Scalar>(1 / mean_weight_);
    const auto normalise = [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) columns_.active[i] = columns_.weight[i] = columns_.weight[i] * normal;
    };
    normalise(0, mono);
    normalise(padded, stereo);
  }

  /// Runs the rounds; writes pose, information, cost, chi2, counts and reason. The mask of inliers: mark_inliers.
  void run(WeightedPnPResult& result) noexcept {
    pose_ = start_;
    for (std::size_t r = 0; r < options_.round_count; ++r) {
      const PoseRound& round = options_.rounds[r];
      const bool changed = r > 0 && activate(round.inliers_only);
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
      for (int j = 0; j < 6; ++j) result.information(i, j) = system_.H((std::min)(i, j), (std::max)(i, j)) * mean_weight_;
    }
    result.cost = system_.cost * mean_weight_;
  }

  void mark_inliers(span<char> inliers, std::size_t n) const noexcept {
    for_each_slot([&](std::size_t slot, Scalar threshold) {
      const std::size_t index = slot < columns_.stereo_begin ? slot : n + (slot - columns_.stereo_begin);
      inliers[workspace_.indices[index]] = is_inlier(slot, threshold) ? char(1) : char(0);
    });
  }

 private:
  void reserve(std::size_t slots, std::size_t n) {
    constexpr std::size_t alignment = 64 / sizeof(Scalar);
    const std::size_t stride = (slots + alignment - 1) / alignment * alignment + alignment;  // + one line: columns never share a set index
    if (workspace_.columns.size() < 10 * stride + alignment) workspace_.columns.resize(10 * stride + alignment);
    if (workspace_.indices.size() < 2 * n) workspace_.indices.resize(2 * n);
    const std::size_t misaligned = reinterpret_cast<std::uintptr_t>(workspace_.columns.data()) / sizeof(Scalar) % alignment;
    Scalar* next = workspace_.columns.data() + (alignment - misaligned) % alignment;
    for (Scalar** column : {&columns_.x, &columns_.y, &columns_.z, &columns_.u, &columns_.v, &columns_.u_right, &columns_.information, &columns_.weight,
                            &columns_.active, &columns_.error}) {
      *column = next;
      next += stride;
    }
  }
  void set(std::size_t slot, double x, double y, double z, double u, double v, double u_right, double information, double weight) noexcept {
    columns_.x[slot] = static_cast<Scalar>(x), columns_.y[slot] = static_cast<Scalar>(y), columns_.z[slot] = static_cast<Scalar>(z);
    columns_.u[slot] = static_cast<Scalar>(u), columns_.v[slot] = static_cast<Scalar>(v), columns_.u_right[slot] = static_cast<Scalar>(u_right);
    columns_.information[slot] = static_cast<Scalar>(information), columns_.weight[slot] = static_cast<Scalar>(weight);
    columns_.error[slot] = Scalar(0);
  }

  template <typename Visit>
  void for_each_slot(Visit&& visit) const noexcept {
    for (std::size_t i = 0; i < columns_.mono; ++i) visit(i, static_cast<Scalar>(options_.chi2_mono));
    for (std::size_t i = columns_.stereo_begin; i < columns_.stereo_end; ++i) visit(i, static_cast<Scalar>(options_.chi2_stereo));
  }
  [[nodiscard]] bool is_inlier(std::size_t slot, Scalar threshold) const noexcept {
    return columns_.error[slot] >= Scalar(0) && columns_.error[slot] <= threshold;
  }
  int count_inliers(double& chi2) const noexcept {
    int count = 0;
    double sum = 0;
    for_each_slot([&](std::size_t slot, Scalar threshold) {
      const bool inlier = is_inlier(slot, threshold);
      count += inlier ? 1 : 0;
      sum += inlier ? static_cast<double>(columns_.weight[slot]) * static_cast<double>(columns_.error[slot]) : 0.0;
    });
    chi2 = sum * mean_weight_;
    return count;
  }
  /// Chooses the observations of the next round; whether the choice differs from the last round's.
  bool activate(bool inliers_only) noexcept {
    bool changed = false;
    for_each_slot([&](std::size_t slot, Scalar threshold) {
      const Scalar active = !inliers_only || is_inlier(slot, threshold) ? columns_.weight[slot] : Scalar(0);
      changed |= active != columns_.active[slot];
      columns_.active[slot] = active;
    });
    return changed;
  }

  PoseSystem evaluate(const SE3<double>& T, const PoseRound& round) const noexcept {
    PoseSystem system;
    const auto add = [&](std::size_t begin, std::size_t end, double chi2, auto stereo) {
      constexpr bool is_stereo = decltype(stereo)::value;
      const double delta = round.scale * std::sqrt(chi2);
      if constexpr (is_pinhole<Camera>::value) {
        with_loss<P>(round.loss, P(static_cast<Scalar>(delta)),
                     [&](const auto& loss) { add_pinhole<P, is_stereo>(columns_, begin, end, camera_, baseline_fx_, T, loss, system); });
      } else {
        with_loss<double>(round.loss, delta, [&](const auto& loss) { add_camera<is_stereo>(columns_, begin, end, camera_, baseline_fx_, T, loss, system); });
      }
    };
    if (columns_.mono > 0) add(0, columns_.mono, options_.chi2_mono, std::false_type());
    if (columns_.stereo_end > columns_.stereo_begin) add(columns_.stereo_begin, columns_.stereo_end, options_.chi2_stereo, std::true_type());
    return system;
  }

  /// Gauss-Newton from pose_; steps that do not lower the cost are taken back and shortened (Levenberg-Marquardt).
  void solve(const PoseRound& round, WeightedPnPResult& result) noexcept {
    constexpr double degenerate = static_cast<double>(Tolerance<Scalar>::degenerate), rounding = static_cast<double>(std::numeric_limits<Scalar>::epsilon());
    system_ = evaluate(pose_, round);
    ++result.evaluations;
    double damping = 0;
    bool current = true;  // whether the stored errors belong to pose_
    result.reason = PoseStop::iteration_limit;
    for (int iteration = 0;; ++iteration) {
      double step[6];
      if (!solve_pose_step(system_, damping, degenerate, step)) {
        result.reason = PoseStop::degenerate;
        return;
      }
      double decrease = 0;  // of the quadratic model with fixed loss weights, an upper bound of the robust cost near pose_
      for (int i = 0; i < 6; ++i) decrease += -system_.g[i] * step[i] + damping * system_.H(i, i) * step[i] * step[i];
      if (damping == 0 && !(decrease > (std::max)(round.min_decrease, rounding * system_.cost))) {
        result.reason = PoseStop::converged;
        break;
      }
      if (iteration == round.max_iterations) break;
      Vector6<double> xi;
      for (int i = 0; i < 6; ++i) xi[i] = step[i];
      const SE3<double> trial = se3_exp(xi) * pose_;
      const PoseSystem trial_system = evaluate(trial, round);
      ++result.evaluations;
      current = trial_system.cost < system_.cost;
      if (current) {
        pose_ = trial;
        system_ = trial_system;
        damping = damping > 1e-4 ? damping * 0.1 : 0;
      } else if (damping < 1e8) {
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

  const Camera& camera_;
  const WeightedPnPOptions& options_;
  WeightedPnPWorkspace<Scalar>& workspace_;
  PoseColumns<Scalar> columns_;
  Vector3<double> centre_;
  SE3<double> start_, pose_;  // about the start position: p = R (X - centre) + t
  PoseSystem system_;
  double baseline_fx_ = 0, mean_weight_ = 1;
  int used_ = 0;
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
  PoseRefinement<P, Camera> refinement(camera, {normalized_rotation(T_cam_world.rotation), T_cam_world.translation}, options, workspace);
  refinement.load_observations(observations, result);
  if (result.used < options.min_observations) {
    result.reason = result.used == 0 && result.zero_weight > 0 && result.invalid == 0 ? PoseStop::no_weight : PoseStop::not_enough_data;
    return result;
  }
  refinement.run(result);
  if (!is_refined(result.reason)) {
    result.inliers = 0;
    result.chi2 = 0;
  } else if (!inliers.empty()) {
    refinement.mark_inliers(inliers, n);
  }
  return result;
}

}  // namespace detail

template <typename Scalar, typename Input, typename Camera>
WeightedPnPResult refine_pose(const PoseObservations<Input>& observations, const Camera& camera, const SE3<double>& T_cam_world,
                              const WeightedPnPOptions& options, WeightedPnPWorkspace<Scalar>& workspace, span<char> inliers) {
  return detail::refine_pose_with<Packet<Scalar>>(observations, camera, T_cam_world, options, workspace, inliers);
}

}  // namespace cfp
