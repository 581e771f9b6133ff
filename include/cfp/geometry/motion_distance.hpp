/// @file motion_distance.hpp
/// How far a point of the image has gone from where a static point would have gone: a flow pair against the camera's
/// motion, with what is known of the depth. It lies between two distances of the paper: with an exact depth it is d^T
/// of eq. 6, with none at all d^F of eq. 13, the distance from the epipolar line.
#pragma once

#include <algorithm>
#include <cmath>

#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"
#include "cfp/core/types.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/geometry/depth_noise.hpp"
#include "cfp/geometry/distance.hpp"
#include "cfp/geometry/flow_pairs.hpp"
#include "cfp/geometry/motion_residual_impl.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/math/uncertain_motion.hpp"

namespace cfp {

namespace detail {
inline namespace CFP_ISA {

/// What distances are computed in: at least double, as det W may be a difference of large numbers.
template <typename Scalar>
using AtLeastDouble = decltype(Scalar() + double());

/// What becomes of the motion where a depth is unknown: C of motion_distance.
template <typename Real>
[[nodiscard]] UncertainMotion<Real> at_unknown_depth(UncertainMotion<Real> motion, const UnknownDepth& depth) noexcept {
  const double ratio = depth.inverse_sigma / depth.inverse_mean, more = 1 + (std::min)(ratio * ratio, 1.0);
  motion.covariance.template topLeftCorner<3, 3>() *= Real(more);
  return motion;
}

/// The distance of a pair where the error of the motion adds (a b; b c) sigma^2 to the noise of its pixel.
template <typename Scalar, typename Real = AtLeastDouble<Scalar>>
[[nodiscard]] CFP_INLINE Scalar distance_of(const MotionResidual<Scalar>& pair, const Scalar& sigma_px,
                                            const Real& a = Real(0), const Real& b = Real(0),
                                            const Real& c = Real(0)) noexcept {
  using std::sqrt;
  const Real rank_two = a * c - b * b;  // not below 0 but for rounding
  const Real det = Real(1) + a + c + (rank_two > Real(0) ? rank_two : Real(0));
  const auto adjugate = [&](Real x, Real y) {
    return (Real(1) + c) * x * x - Real(2) * b * x * y + (Real(1) + a) * y * y;
  };
  // W + kappa J J^T has the adjugate of W plus kappa times that of J J^T: sums of squares, however large kappa is.
  const Vector2<Real> r = pair.r.template cast<Real>(), along = pair.along.template cast<Real>();
  const Real spread = Real(pair.sigma_z) / Real(sigma_px), kappa = spread * spread,
             across = along[0] * r[1] - along[1] * r[0];
  const Scalar distance_sq = static_cast<Scalar>((adjugate(r[0], r[1]) + kappa * across * across) /
                                                 (det + kappa * adjugate(along[0], along[1])));
  const Scalar distance = sqrt(distance_sq > Scalar(0) ? distance_sq : Scalar(0));
  return has_distance(distance) && is_finite(distance_sq) ? distance : Scalar(no_distance<double>);
}

/// motion_distance under T_cur_prev with the covariance of `motion`; null: it is exact.
template <typename Camera, typename Scalar>
[[nodiscard]] CFP_INLINE Scalar distance_under(const Vector2<Scalar>& pixel_prev, const Scalar& depth_prev,
                                               const Vector2<Scalar>& pixel_cur, const SE3<Scalar>& T_cur_prev,
                                               const UncertainMotion<AtLeastDouble<Scalar>>* motion,
                                               const Camera& camera, const Scalar& sigma_px,
                                               const MotionDistanceOptions& options) noexcept {
  using Real = AtLeastDouble<Scalar>;
  MotionResidual<Scalar> pair;
  if (!expected_residual(pixel_prev, depth_prev, pixel_cur, T_cur_prev, camera, options, pair))
    return Scalar(no_distance<double>);
  if (motion == nullptr) return distance_of(pair, sigma_px);
  // W = I + A with A = M C M^T / sigma^2.
  const Real per_sigma = Real(1) / Real(sigma_px);
  const Eigen::Matrix<Real, 6, 2> M = pair.M().transpose().template cast<Real>() * per_sigma,
                                  CM = motion->covariance.lazyProduct(M);
  return distance_of(pair, sigma_px, M.col(0).dot(CM.col(0)), M.col(0).dot(CM.col(1)), M.col(1).dot(CM.col(1)));
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// The Mahalanobis distance of a pair from where a static point would have gone, times sigma_px, in pixels:
///
///   d = sigma sqrt(r^T (sigma^2 I + sigma_z^2 J J^T + M C M^T)^-1 r),
///
/// r = pixel_cur - project(p), p = T_cur_prev X, X the previous pixel at its depth z, J = d project / d z,
/// M = d project / d xi, C the motion's covariance. (d / sigma)^2 of a static point has two degrees of freedom.
/// Deviations within the error of the depth (along the epipolar line) or of the motion do not count; so a plane, a
/// rotation or a resting camera is no special case. A depth that is not positive or not finite has the prior
/// UnknownDepth. As a translation moves near points more, the covariance of the translation is then multiplied by 1 +
/// (sigma / mean)^2, at most by 2 (cfp_object_motion_study). no_distance for a pixel without a ray, a point behind the
/// current camera, or anything not finite. sigma_px > 0. Not in the paper.
template <typename Camera, typename Scalar = typename Camera::ScalarType>
[[nodiscard]] Scalar motion_distance(const Vector2<non_deduced<Scalar>>& pixel_prev,
                                     const non_deduced<Scalar>& depth_prev,
                                     const Vector2<non_deduced<Scalar>>& pixel_cur,
                                     const UncertainMotion<non_deduced<Scalar>>& motion, const Camera& camera,
                                     const non_deduced<Scalar>& sigma_px,
                                     const MotionDistanceOptions& options) noexcept {
  auto precise = motion.template cast<detail::AtLeastDouble<Scalar>>();
  if (!is_valid_depth(depth_prev)) precise = detail::at_unknown_depth(precise, options.unknown_depth);
  return detail::distance_under<Camera, Scalar>(pixel_prev, depth_prev, pixel_cur, motion.T_cur_prev, &precise, camera,
                                                sigma_px, options);
}

/// motion_distance of every pair, sigma_px times its relative_sigma in the place of sigma_px, over relative_sigma: the
/// distances of all pairs are on one scale. Sizes must agree. Allocates nothing.
template <typename Camera, typename Scalar = typename Camera::ScalarType>
void motion_distances(const FlowPairs<non_deduced<Scalar>>& pairs, const UncertainMotion<non_deduced<Scalar>>& motion,
                      const Camera& camera, non_deduced<Scalar> sigma_px, const MotionDistanceOptions& options,
                      span<non_deduced<Scalar>> out) noexcept {
  CFP_ASSERT(pairs.previous.size() == out.size() && pairs.current.size() == out.size());
  CFP_ASSERT(detail::fits(out.size(), pairs.previous_depths) && detail::fits(out.size(), pairs.relative_sigmas));
  const auto precise = motion.template cast<detail::AtLeastDouble<Scalar>>();
  const auto without_depth = detail::at_unknown_depth(precise, options.unknown_depth);
  const bool exact = motion.covariance.isZero(0);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const Scalar depth = pairs.depth(i), relative = pairs.relative_sigma(i);
    const auto& uncertain = is_valid_depth(depth) ? precise : without_depth;
    out[i] =
        detail::distance_under<Camera, Scalar>(pairs.previous[i], depth, pairs.current[i], motion.T_cur_prev,
                                               exact ? nullptr : &uncertain, camera, sigma_px * relative, options) /
        relative;
  }
}

}  // namespace CFP_ISA
}  // namespace cfp
