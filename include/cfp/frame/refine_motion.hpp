/// @file refine_motion.hpp
/// The camera's motion that a host knows, from an IMU or odometry, refined by flow pairs of which few or none have a
/// depth. Not in the paper, whose fundamental matrix ignores the host's motion and fits whatever holds most pairs.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "cfp/core/span.hpp"
#include "cfp/frame/camera_motion.hpp"
#include "cfp/geometry/flow_pairs.hpp"
#include "cfp/geometry/motion_residual_impl.hpp"
#include "cfp/math/normal_equations.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/optimization/least_squares.hpp"

namespace cfp {

template <typename Scalar>
struct RefinedMotion : CameraMotion<Scalar> {
  double apart_sq = 0;        ///< squared Mahalanobis distance from the host's motion
  bool contradicted = false;  ///< by enough pairs: the host's covariance is too small for the error of its motion

  CFP_INLINE RefinedMotion() noexcept {}  // NOLINT(modernize-use-equals-default): inline
};

namespace detail {
inline namespace CFP_ISA {

/// A host's motion and the pairs on no object as a model of least_squares.hpp. The sums and the distances of the pairs,
/// no_distance of those that do not count, are those of the last evaluation.
template <typename Scalar>
struct MotionRefinement {
  const FlowPairs<Scalar>& flow;
  span<const char> outside;
  const PinholeCamera<Scalar>& camera;
  const CameraMotionOptions& options;
  std::vector<Scalar>& distances;
  UncertainMotion<double> prior;
  Matrix6<double> information = Matrix6<double>::Zero();  // of the prior; 0: it is exact
  Scalar sigma_px = 1;                                    // the noise
  double apart_sq = 0;                                    // from the prior, in squares of its sigmas
  double pairs = 0, agreeing = 0, coordinates = 0;        // the last two: sums by the weights of the loss

  double linearize(const SE3<double>& T_cur_prev, NormalEquations<6>& equations) noexcept {
    const SE3<Scalar> T = T_cur_prev.template cast<Scalar>();
    equations.H = information;
    const Vector6<double> apart = se3_log(T_cur_prev * prior.T_cur_prev.inverse());
    equations.g = information.lazyProduct(apart);
    apart_sq = apart.dot(equations.g);
    double cost = apart_sq;
    pairs = agreeing = coordinates = 0;
    for (std::size_t i = 0; i < outside.size(); ++i) {
      distances[i] = Scalar(no_distance<double>);
      if (outside[i] == 0) continue;
      ++pairs;
      const Scalar sigma = sigma_px * flow.relative_sigma(i);
      MotionResidual<Scalar> pair;
      if (!likely_residual<PinholeCamera<Scalar>, Scalar>(flow.previous[i], flow.depth(i), flow.current[i], T, camera,
                                                          sigma, options.distance, pair))
        continue;
      const PairTerm term = add_pair(pair, static_cast<double>(sigma), Vector6<double>::Zero(), equations);
      if (!(term.weight > 0)) continue;
      agreeing += term.weight;
      coordinates += term.weight * term.coordinates;
      cost += term.distance_sq * std::sqrt(term.weight);
      // As if of two coordinates: distances from lines are smaller, and the median is of both.
      const double median = chi_median(term.coordinates > 1.5 ? 2 : 1) / chi_median(2);
      distances[i] = sigma_px * static_cast<Scalar>(std::sqrt(term.distance_sq) / median);
    }
    return cost;
  }
  [[nodiscard]] SE3<double> moved(const SE3<double>& T, const Vector6<double>& step) const noexcept {
    return se3_exp(step) * T;
  }

  /// From the prior, which counts as one more observation; the first round with a loss of `first_scale` times its
  /// width. An exact prior stays as it is.
  [[nodiscard]] RefinedMotion<Scalar> refine(double first_scale) {
    constexpr int rounds = 2;
    LevenbergMarquardtOptions steps;
    steps.max_iterations = 15;
    steps.min_relative_decrease = 1e-3;
    RefinedMotion<Scalar> motion;
    const bool exact = prior.covariance.isZero(0);
    UncertainMotion<double> refined = prior;
    Matrix6<double> covariance;
    information.setZero();
    if (!exact && !invert_normal_equations<6>(Matrix6<double>(prior.covariance), 1e-14, information)) return motion;
    distances.resize(outside.size());
    sigma_px = Scalar(options.max_sigma_px);
    const auto measure_noise = [&] {
      NormalEquations<6> equations;
      linearize(refined.T_cur_prev, equations);
      motion.coordinates = coordinates > 1.5 * agreeing ? 2 : 1;
      sigma_px = motion.sigma_px = flow_sigma(span<Scalar>(distances), 2, exact ? 0 : 6, options);
      return pairs >= static_cast<double>(options.min_pairs) && agreeing > 0;
    };
    for (int round = 0; round < rounds; ++round) {
      if (!measure_noise()) return motion;
      if (exact) continue;
      if (round == 0) sigma_px *= static_cast<Scalar>(first_scale);
      DenseLeastSquares<6, SE3<double>, MotionRefinement> problem{*this, refined.T_cur_prev, 1e-14};
      minimize_least_squares(problem, steps);
      if (!invert_normal_equations<6>(problem.equations.H, 1e-14, covariance)) return motion;
      refined.T_cur_prev = problem.state;
      refined.covariance = covariance;
    }
    motion.known = measure_noise() && agreeing >= options.min_inlier_share * pairs;
    static_cast<UncertainMotion<Scalar>&>(motion) = refined.template cast<Scalar>();
    motion.apart_sq = apart_sq;
    return motion;
  }

  /// A tight loss keeps to the prior where something that moves would take a wide one along, and loses a prior that
  /// errs much: whichever leaves less noise, where that of the wide one is more than the flow's own may be.
  [[nodiscard]] RefinedMotion<Scalar> refine_wide_or_tight() {
    const RefinedMotion<Scalar> wide = refine(1);
    if (wide.known && wide.sigma_px <= Scalar(options.search_above_px)) return wide;
    const RefinedMotion<Scalar> tight = refine(1.0 / 3);
    return tight.known && !(wide.known && wide.sigma_px <= tight.sigma_px) ? tight : wide;
  }
};

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// The motion that minimises
///
///   (xi - xi_0)^T C^-1 (xi - xi_0) + sum of rho(r_i^T (sigma^2 I + sigma_z^2 J_i J_i^T)^-1 r_i)
///
/// over the pairs of the undistorted image that `outside` marks as on no object: xi_0 and C the host's motion and its
/// covariance, r, J and sigma_z of motion_distance, an unknown depth at its best fit, rho the Geman-McClure loss at
/// four times the measured noise. The length of the translation is the host's if no depth is known, as one camera
/// cannot observe it. A result outside the 99.9 % bound of C may have followed an unreported mover: if the host's
/// motion leaves at most 1.2 times its noise, it is returned unchanged (cfp_unreported_study). Otherwise C is inflated
/// until they agree (by apart_sq / 6), and the fit is repeated: `contradicted`. Unknown with fewer than
/// options.min_pairs pairs, if less than min_inlier_share of them are inliers, if C has no inverse, or if even the
/// inflated C is contradicted. An exact motion (C = 0) stays, and the noise of the pairs is measured. O(pairs);
/// allocates `distances` alone. Not in the paper (cfp_object_motion_study).
template <typename Scalar>
[[nodiscard]] RefinedMotion<Scalar> refine_camera_motion(const UncertainMotion<double>& prior,
                                                         const FlowPairs<Scalar>& flow, span<const char> outside,
                                                         const PinholeCamera<Scalar>& camera,
                                                         const CameraMotionOptions& options,
                                                         std::vector<Scalar>& distances) {
  CFP_ASSERT(outside.size() == flow.current.size());
  detail::MotionRefinement<Scalar> refinement{flow, outside, camera, options, distances, prior};
  RefinedMotion<Scalar> motion = refinement.refine_wide_or_tight();
  const auto inside = static_cast<std::size_t>(std::count(outside.begin(), outside.end(), char(0)));
  motion.contradicted =
      motion.known ? motion.apart_sq > detail::most_motion_distance_sq : outside.size() - inside >= options.min_pairs;
  if (!motion.known || !motion.contradicted) return motion;
  refinement.prior.covariance.setZero();
  RefinedMotion<Scalar> as_given = refinement.refine(1);
  if (as_given.known && as_given.sigma_px <= Scalar(1.2) * motion.sigma_px) {
    as_given.covariance = prior.covariance.template cast<Scalar>();
    return as_given;
  }
  refinement.prior.covariance = prior.covariance * (motion.apart_sq / 6);
  motion = refinement.refine_wide_or_tight();
  motion.contradicted = true;
  motion.known = motion.known && motion.apart_sq <= detail::most_motion_distance_sq;
  return motion;
}

}  // namespace CFP_ISA
}  // namespace cfp
