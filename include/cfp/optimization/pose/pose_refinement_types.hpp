/// @file pose_refinement_types.hpp
/// Options, observations, result and workspace of pose_refinement.hpp, which says what they mean together.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "cfp/core/options.hpp"
#include "cfp/core/span.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/optimization/robust_loss.hpp"

namespace cfp {

/// One robust solve within a refinement.
struct PoseRound {
  LossType loss = LossType::huber;
  double scale = 1;         ///< delta of the loss in units of sqrt(chi2 threshold), > 0
  int max_iterations = 10;  ///< evaluations after the first, rejected trial steps included, >= 1
  double min_decrease =
      1e-3;  ///< > 0; ends when the next step promises less of cost / mean weight: 1e-3 is 0.03 sigma of the pose
  bool from_start = false;    ///< begin at the start pose instead of the previous round's
  bool inliers_only = false;  ///< leave out what the previous round found to be an outlier
  double min_mean_decrease =
      0;  ///< >= 0; ends, too, when the next step promises less than this per observation: 0.3 moves them 0.5 sigma

  friend bool operator==(const PoseRound& a, const PoseRound& b) noexcept {
    return a.loss == b.loss && a.scale == b.scale && a.max_iterations == b.max_iterations &&
           a.min_decrease == b.min_decrease && a.from_start == b.from_start && a.inliers_only == b.inliers_only &&
           a.min_mean_decrease == b.min_mean_decrease;
  }
};

/// Where the weight w enters.
enum class WeightConvention : std::uint8_t {
  outside_loss,      ///< cost w rho(s), outlier test on s
  information_scale  ///< cost rho(w s), outlier test on w s: g2o with the weight in the information matrix. Inliers
                     ///< then include gross errors of small weight: w = 0.1 lets 59 px^2 pass. For like-for-like
                     ///< comparison.
};

struct PoseOptions {
  static constexpr std::size_t max_rounds = 8;
  double chi2_mono = 5.991;    ///< outlier threshold on s of a pixel, 95 % of chi^2 with 2 degrees of freedom, > 0
  double chi2_stereo = 7.815;  ///< the same with a depth, 3 degrees of freedom, > 0
  WeightConvention convention = WeightConvention::outside_loss;
  int min_observations = 3;  ///< fewer usable observations, or inliers after a round, leave the pose untouched, >= 3
  /// The rounds, in order. A round that would repeat the previous one exactly (same set, same loss) is left out.
  /// Default: Huber until pixels move by half a sigma, then Geman-McClure on all observations to 0.1 sigma of the pose:
  /// its error is 2 % to 4 % above least squares on the true inliers where the hard cut's is 9 % to 11 %, and stopping
  /// later gains nothing (benchmarks/studies/pose_loss_study.cpp).
  std::array<PoseRound, max_rounds> rounds = {PoseRound{LossType::huber, 1, 10, 1e-2, false, false, 0.3},
                                              PoseRound{LossType::geman_mcclure, 1.5, 10, 1e-2, false, false}};
  std::size_t round_count = 2;  ///< in [1, max_rounds]
};

/// ORB-SLAM2's Optimizer::PoseOptimization: 4 rounds of at most 10 iterations, each from the start pose, Huber in the
/// first three, outliers left out (and allowed back in) after every round. A round ends early when the next step
/// promises less than 1e-8.
[[nodiscard]] inline PoseOptions orb_slam2_pose_options() noexcept {
  PoseOptions options;
  options.rounds = {
      PoseRound{LossType::huber, 1, 10, 1e-8, true, false}, PoseRound{LossType::huber, 1, 10, 1e-8, true, true},
      PoseRound{LossType::huber, 1, 10, 1e-8, true, true}, PoseRound{LossType::trivial, 1, 10, 1e-8, true, true}};
  options.round_count = 4;
  return options;
}

/// The first field outside its range, or nullptr.
[[nodiscard]] inline OptionPath invalid_field(const PoseRound& round) noexcept {
  if (!(static_cast<unsigned>(round.loss) <= static_cast<unsigned>(LossType::truncated))) return "loss";
  if (!detail::positive(round.scale)) return "scale";
  if (!(round.max_iterations >= 1)) return "max_iterations";
  if (!detail::positive(round.min_decrease)) return "min_decrease";
  if (!detail::non_negative(round.min_mean_decrease)) return "min_mean_decrease";
  return {};
}

[[nodiscard]] inline OptionPath invalid_field(const PoseOptions& options) noexcept {
  if (!detail::positive(options.chi2_mono)) return "chi2_mono";
  if (!detail::positive(options.chi2_stereo)) return "chi2_stereo";
  if (!(static_cast<unsigned>(options.convention) <= 1U)) return "convention";
  if (!(options.min_observations >= 3)) return "min_observations";
  if (!(options.round_count >= 1 && options.round_count <= PoseOptions::max_rounds)) return "round_count";
  for (std::size_t i = 0; i < options.round_count; ++i) {
    if (const OptionPath field = nested("rounds", invalid_field(options.rounds[i]))) return field;
  }
  return {};
}

/// Why a refinement ended. The pose was changed for the first three only.
enum class PoseStop : std::uint8_t {
  converged,           ///< the last round met min_decrease
  iteration_limit,     ///< the last round used its iterations up
  no_decrease,         ///< no step, however short, lowers the cost: the minimum within rounding
  not_enough_data,     ///< fewer usable observations than min_observations
  no_weight,           ///< observations, but all weights are 0
  not_enough_inliers,  ///< fewer inliers than min_observations after a round
  degenerate,    ///< the observations do not determine the pose: collinear or coincident points, all behind the camera
  invalid_input  ///< start pose not a rigid motion (a non-finite one is returned as identity), or camera not finite
};

/// Whether the pose was refined.
[[nodiscard]] constexpr bool is_refined(PoseStop reason) noexcept { return reason <= PoseStop::no_decrease; }

[[nodiscard]] constexpr const char* to_string(PoseStop reason) noexcept {
  switch (reason) {
    case PoseStop::converged:
      return "converged";
    case PoseStop::iteration_limit:
      return "iteration limit";
    case PoseStop::no_decrease:
      return "no decrease";
    case PoseStop::not_enough_data:
      return "not enough data";
    case PoseStop::no_weight:
      return "no weight";
    case PoseStop::not_enough_inliers:
      return "not enough inliers";
    case PoseStop::degenerate:
      return "degenerate";
    case PoseStop::invalid_input:
      return "invalid input";
  }
  return "unknown";
}

/// The caller's arrays, parallel, of n observations; nothing is kept. Optional spans are empty or of length n.
/// An observation counts when point, pixel, weight and sigma are finite, the weight within [1e-30, 1e30], sigma within
/// [1e-6, 1e6] px, the pixel within 1e7 px of the principal point and the point within 1e9 m of the camera (sums of
/// absolute coordinates); others are skipped and counted.
template <typename Scalar>
struct PoseObservations {
  PointSpan<Scalar, 3> points;  ///< X, world frame, m
  PointSpan<Scalar, 2> pixels;  ///< px
  span<const Scalar>
      weights;  ///< w >= 0, static probabilities for example; empty: 1. Below 1e-30, 0 for example: as good as absent
  span<const Scalar> sigmas;             ///< px, ORB-SLAM2: the scale factor of the octave; empty: 1
  span<const Scalar> inverse_sigmas_sq;  ///< 1/px^2, instead of sigmas (ORB-SLAM2: mvInvLevelSigma2 of the octave)
  span<const Scalar> depths;             ///< m, instead of u_right; not > 0 or NaN: the observation is a pixel only
  span<const Scalar> u_right;            ///< px, column in the (virtual) right image; not > 0 or NaN: a pixel only
  double baseline_fx = 0;  ///< fx times stereo baseline, px m (ORB-SLAM2: Camera.bf); not > 0: depths are not used
};

struct PoseResult {
  SE3<double> T_cam_world;
  /// Information of xi (1/m^2, 1/(m rad), 1/rad^2): sum of w rho'(s) J^T J / sigma^2 of the last round at the returned
  /// pose. Its inverse is a covariance in the statistical sense only for weights that are 0 or 1. Zero when the pose
  /// was not refined.
  Eigen::Matrix<double, 6, 6, Eigen::DontAlign> information = Eigen::Matrix<double, 6, 6, Eigen::DontAlign>::Zero();
  double cost = 0;       ///< sum of w rho(s) of the last round
  double chi2 = 0;       ///< sum of w s over the inliers
  double effective = 0;  ///< (sum w)^2 / sum w^2 of the used observations: how many of full weight they amount to
  int used = 0;          ///< observations in the problem
  int used_stereo = 0;   ///< of these with a depth
  int zero_weight = 0;   ///< skipped: weight below 1e-30
  int invalid = 0;       ///< skipped: not finite, negative weight or out of range
  int inliers = 0;       ///< s within the threshold and in front of the camera, at the returned pose
  int rounds = 0;        ///< rounds run
  int evaluations = 0;   ///< passes over the data, those in float included
  PoseStop reason = PoseStop::not_enough_data;
};

/// Memory of a refinement in float or double arithmetic; grows to the largest n seen and is then reused.
template <typename Scalar>
struct PoseWorkspace {
  std::vector<Scalar> columns;
  std::vector<float> draft;  ///< the columns once more, for early passes: in double only
  std::vector<std::uint32_t> indices;
};

}  // namespace cfp
