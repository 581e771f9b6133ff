/// @file pose_problem.hpp
/// Observations, options, result and workspace of pose_refinement.hpp, which says what they mean together.
#pragma once

#include <array>
#include <vector>

#include "cfp/core/options.hpp"
#include "cfp/core/span.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/optimization/least_squares.hpp"
#include "cfp/optimization/robust_loss.hpp"

namespace cfp {

/// The caller's arrays, parallel, of n observations; nothing is kept. Optional spans are empty or of length n.
/// An observation counts when point, pixel, weight and sigma are finite, the weight within [1e-30, 1e30], sigma within
/// [1e-6, 1e6] px, the pixel within 1e7 px of the principal point and the point within 1e9 m of the camera (sums of
/// absolute coordinates); others are skipped and counted. Of `depths` and `u_right` at most one may be given: both are
/// invalid input.
///
/// A third row comes from a depth z, of which the disparity fx b / z has the noise sigma beside that of the pixel, or
/// from the column of the point in a right image, u_right = u - fx b / z, which has it. ORB-SLAM2's mvuRight of an
/// RGB-D camera is no such column but made of u and z: its noise is u's as well, and with it the pose seems up to 1.4
/// times as certain as it is; give the depth. For depths baseline_fx may be fictitious: depths with an error of c z^2
/// have a disparity noise of one pixel for baseline_fx = 1 / c, some 500 px m for structured light
/// (examples/slam/RESULTS.md). A third row counts when z is positive and finite, and u_right positive (as in ORB-SLAM2,
/// which marks "none" with -1), and column or disparity at most 1e7 px; otherwise the observation is a pixel only.
/// Bundle adjustment takes any finite u_right above 0.
template <typename Scalar>
struct PoseObservations {
  PointSpan<Scalar, 3> points;  ///< X, world frame, m
  PointSpan<Scalar, 2> pixels;  ///< px
  span<const Scalar> weights;   ///< w >= 0, static probabilities for example; empty: 1. Below 1e-30: absent
  span<const Scalar> sigmas;    ///< px, ORB-SLAM2: the scale factor of the octave; empty: 1
  span<const Scalar> depths;    ///< m, instead of u_right
  span<const Scalar> u_right;   ///< px, instead of depths
  double baseline_fx = 0;       ///< fx times stereo baseline, px m (ORB-SLAM2: Camera.bf); not in (0, 1e6]: pixels only
};

/// One robust solve within a refinement.
struct PoseRound {
  LossType loss = LossType::geman_mcclure;
  double scale = 1;  ///< delta of the loss in units of sqrt(chi2 threshold), > 0

  friend bool operator==(const PoseRound& a, const PoseRound& b) noexcept {
    return a.loss == b.loss && a.scale == b.scale;
  }
};

struct PoseOptions {
  static constexpr std::size_t max_rounds = 4;
  static constexpr int min_observations = 3;  ///< fewer usable observations, or inliers, leave the pose untouched
  double chi2_mono = 5.991;    ///< outlier threshold on s of a pixel, 95 % of chi^2 with 2 degrees of freedom, > 0
  double chi2_stereo = 7.815;  ///< the same with a depth, 3 degrees of freedom, > 0
  /// Unless all observations agree, fewer rows of inliers (two of a pixel, three with a depth) leave the pose as it
  /// was, >= 6. Any three pixels fit some pose: of poses from 4 to 60 observations with up to 90 % mismatches 6 to 45 %
  /// were solved and wrong with 6 rows, at most 1 % with 10 (cfp_pose_loss_study).
  int min_inlier_rows = 10;
  /// The rounds, in order. Default: Geman-McClure, so wide that most starts reach the minimum, until pixels move by
  /// half a sigma, then narrow to 0.1 sigma of the pose. Its error is 2 % to 4 % above least squares on the true
  /// inliers where a hard cut's is 9 % to 11 %, and stopping later gains nothing (cfp_pose_loss_study). From starts 30
  /// degrees off it fails in 1 % to 5 %, 50 degrees off in 26 %; {cauchy, 16} first: 0.1 % and 10 %, in 1.1 to 1.4
  /// times the time.
  std::array<PoseRound, max_rounds> rounds = {PoseRound{LossType::geman_mcclure, 30},
                                              PoseRound{LossType::geman_mcclure, 1.5}};
  std::size_t round_count = 2;     ///< in [1, max_rounds]
  int max_iterations = 20;         ///< per round: steps tried, >= 1
  double min_decrease = 1e-2;      ///< > 0; a round ends when a step promises less of cost / mean weight: 1e-2 is 0.1
                                   ///< sigma of the pose
  double handover_decrease = 0.3;  ///< >= 0, per observation: a round from whose pose the next one goes on ends when a
                                   ///< step promises less; 0.3 moves pixels by 0.5 sigma
  bool from_start = false;         ///< every round begins at the start pose instead of the previous round's
  bool inliers_only = false;       ///< every round but the first leaves out the outliers of the previous one
};

inline namespace CFP_ISA {

/// ORB-SLAM2's Optimizer::PoseOptimization: 4 rounds of at most 10 iterations, each from the start pose, Huber in the
/// first three, outliers left out (and allowed back in) after every round. A round ends early when the next step
/// promises less than 1e-8, and one that would repeat the previous one is left out.
[[nodiscard]] inline PoseOptions orb_slam2_pose_options() noexcept {
  PoseOptions options;
  options.rounds = {PoseRound{LossType::huber, 1}, PoseRound{LossType::huber, 1}, PoseRound{LossType::huber, 1},
                    PoseRound{LossType::trivial, 1}};
  options.round_count = 4;
  options.max_iterations = 10;
  options.min_decrease = 1e-8;
  options.from_start = options.inliers_only = true;
  return options;
}

[[nodiscard]] inline OptionPath invalid_field(const PoseRound& round) noexcept {
  if (!is_loss(round.loss)) return "loss";
  if (!detail::positive(round.scale)) return "scale";
  return {};
}
[[nodiscard]] inline OptionPath invalid_field(const PoseOptions& options) noexcept {
  if (!detail::positive(options.chi2_mono)) return "chi2_mono";
  if (!detail::positive(options.chi2_stereo)) return "chi2_stereo";
  if (!(options.min_inlier_rows >= 6)) return "min_inlier_rows";
  if (!(options.round_count >= 1 && options.round_count <= PoseOptions::max_rounds)) return "round_count";
  for (std::size_t i = 0; i < options.round_count; ++i) {
    if (const OptionPath field = nested("rounds", invalid_field(options.rounds[i]))) return field;
  }
  if (!(options.max_iterations >= 1)) return "max_iterations";
  if (!detail::positive(options.min_decrease)) return "min_decrease";
  if (!detail::non_negative(options.handover_decrease)) return "handover_decrease";
  return {};
}

}  // namespace CFP_ISA

struct PoseResult {
  SolverStatus status = SolverStatus::not_enough_data;  ///< is_solved(status): the pose was refined
  SE3<double> T_cam_world;
  /// Information of xi (1/m^2, 1/(m rad), 1/rad^2) at the returned pose: sum of w rho'(s) J^T J / sigma^2, scaled so
  /// that an inlier counts fully on average. Where sigma is the pixels' noise and weights are 0 or 1, its inverse is
  /// the covariance of the pose, 4 % too small with the default rounds and 18 % with those of ORB-SLAM2, whose hard cut
  /// costs accuracy. With other weights it is only a relative measure. Zero when the pose was not refined.
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
  int evaluations = 0;   ///< passes over the data
};

/// Memory of a refinement in float or double arithmetic; grows to the largest n seen and is then reused.
template <typename Scalar>
struct PoseWorkspace {
  std::vector<Scalar> columns;
  std::vector<std::uint32_t> indices;
};

}  // namespace cfp
