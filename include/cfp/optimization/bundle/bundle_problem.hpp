/// @file bundle_problem.hpp
/// Input, options and result of the weighted bundle adjustment (bundle_adjustment.hpp). Frames: poses are T_cam_world;
/// points are in the world, metres; pixels.
#pragma once

#include "cfp/core/options.hpp"
#include "cfp/core/span.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/optimization/least_squares.hpp"
#include "cfp/optimization/robust_loss.hpp"

namespace cfp {

/// Parallel arrays in any order, float or double (the arithmetic is double). An observation is *invalid*, hence not
/// used, when an index is out of range, its pixel, weight, sigma, pose or point is not finite, its pose is no rigid
/// motion, its weight is negative, its sigma is not positive, or its cost overflows. Weight 0 is the same as absent.
/// The same pose may observe a point several times.
template <typename Scalar>
struct BundleObservations {
  span<const int> pose;             ///< index into BundleProblem::poses
  span<const int> point;            ///< index into BundleProblem::points
  PointSpan<Scalar, 2> pixels;      ///< (u, v)
  span<const Scalar> u_right = {};  ///< px, as in PoseObservations: not > 0 or NaN: a pixel only. Empty: all mono
  span<const Scalar> sigmas = {};   ///< px, ORB-SLAM2: the scale factor of the octave. Empty: all 1
  span<const Scalar> weights = {};  ///< w >= 0, for example the static probability. Empty: all 1
  span<const Scalar> depths = {};   ///< m, instead of u_right, as in PoseObservations: what an RGB-D camera measures
};

/// What to adjust. Views only: the arrays must live during the call; poses and points are read and written.
template <typename Camera = PinholeCamera<double>, typename Scalar = double>
struct BundleProblem {
  span<SE3<double>> poses;       ///< T_cam_world
  span<Vector3<double>> points;  ///< world, m
  span<const Camera> cameras;    ///< one for all poses, or one per pose; any type like PinholeCamera
  BundleObservations<Scalar> observations;
  span<const char> fixed_poses = {};  ///< per pose: not 0 = held. Empty: all free
  double baseline_fx = 0;             ///< fx times stereo baseline, px m (ORB-SLAM2: Camera.bf); not > 0: all are mono
};

struct BundleOptions {
  LevenbergMarquardtOptions levenberg_marquardt;
  LossType loss = LossType::huber;
  double chi2_mono = 5.991;    ///< delta^2 of the loss for two residuals, > 0: 95 % of chi^2 with 2 degrees of freedom
  double chi2_stereo = 7.815;  ///< delta^2 of the loss for three residuals, > 0: 3 degrees of freedom
};

/// Costs are sums of w rho(|r|^2 / sigma^2) over the used observations; the final one is that of the poses and points
/// returned, the rotations of fixed ones normalised about their centres. Every observation is counted once: used +
/// zero_weight + invalid + behind = all.
struct BundleResult : LeastSquaresResult {
  std::size_t used = 0;         ///< observations in the cost
  std::size_t zero_weight = 0;  ///< left out: w = 0
  std::size_t invalid = 0;      ///< left out: see BundleObservations
  std::size_t behind = 0;       ///< left out: at the start the camera did not see the point (behind it, for example)
  std::size_t free_poses = 0;   ///< poses that were adjusted
  std::size_t adjusted_points = 0;  ///< points that were adjusted: those with a used observation
  std::size_t factor_blocks = 0;    ///< blocks of the reduced system's Cholesky factor
};

inline namespace CFP_ISA {

/// An executor that does everything on the calling thread. Any type with `executor(count, task)`, which calls task(0),
/// …, task(count - 1) in any order and on any thread and returns when all are done, is an executor; two_threads.hpp has
/// one.
struct SingleThread {
  template <typename Task>
  void operator()(int count, const Task& task) const {
    for (int i = 0; i < count; ++i) task(i);
  }
};

[[nodiscard]] inline OptionPath invalid_field(const BundleOptions& options) noexcept {
  if (const OptionPath field = nested("levenberg_marquardt", invalid_field(options.levenberg_marquardt))) return field;
  if (!is_loss(options.loss)) return "loss";
  if (!detail::positive(options.chi2_mono)) return "chi2_mono";
  if (!detail::positive(options.chi2_stereo)) return "chi2_stereo";
  return {};
}

}  // namespace CFP_ISA
}  // namespace cfp
