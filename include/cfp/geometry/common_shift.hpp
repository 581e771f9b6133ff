/// @file common_shift.hpp
/// Whether flow pairs share a motion: each pair may be within the noise while their common shift is far beyond it. Not
/// in the paper, whose O ranks the pairs one by one.
#pragma once

#include <algorithm>

#include "cfp/geometry/motion_distance.hpp"
#include "cfp/math/normal_equations.hpp"
#include "cfp/math/uncertain_motion.hpp"

namespace cfp {

inline namespace CFP_ISA {

/// How much better a common translation D of the points of `members` (indices of pairs) explains them than a static
/// world: D^T Cov(D)^-1 D at the best D, chi-squared with three degrees of freedom for a static object. With r, M, J
/// and the motion's covariance C of motion_distance,
///
///   r_i = M_i (xi + (D, 0)) + J_i dz_i + noise,   xi ~ N(0, C) the same for all pairs, dz_i the error of a depth,
///
/// so that a shift within the error of the motion is no evidence, however many the pairs. The fit is robust: mismatches
/// are ignored, and so is most of a shift far beyond the noise, which the single pairs' distances reveal. Neighbouring
/// pairs have a correlated error (rolling shutter, lens, focal length) of about `shared_error_px` >= 0, which does not
/// average out: n pairs count as n / (1 + n (shared_error_px / sigma_px)^2) independent ones. Pairs without a depth are
/// not used; 0 if nothing can be fitted. sigma_px > 0, times each pair's relative_sigma. O(members), allocates nothing.
template <typename Camera, typename Scalar = typename Camera::ScalarType>
[[nodiscard]] double common_shift(const FlowPairs<non_deduced<Scalar>>& pairs, span<const std::int32_t> members,
                                  const UncertainMotion<non_deduced<Scalar>>& motion, const Camera& camera,
                                  non_deduced<Scalar> sigma_px, const MotionDistanceOptions& options,
                                  double shared_error_px) noexcept {
  CFP_ASSERT(pairs.current.size() == pairs.previous.size());
  constexpr int passes = 2;
  const double shared = shared_error_px / static_cast<double>(sigma_px);
  // A micrometre and a microradian are negligible, and make every covariance invertible.
  Matrix6<double> covariance = motion.template cast<double>().covariance, information, inverse;
  for (int k = 0; k < 6; ++k) covariance(k, k) += 1e-12;
  if (pairs.previous_depths.empty() || !invert_normal_equations<6>(covariance, 1e-14, information)) return 0;

  double chi_squared = 0;
  Vector6<double> moved = Vector6<double>::Zero();  // xi + (D, 0)
  for (int pass = 0; pass < passes; ++pass) {
    detail::NormalEquations<6> sums;
    double count = 0;
    for (const std::int32_t member : members) {
      const auto i = static_cast<std::size_t>(member);
      const Scalar depth = pairs.depth(i);
      detail::MotionResidual<Scalar> pair;
      if (is_valid_depth(depth) && detail::expected_residual<Camera, Scalar>(pairs.previous[i], depth, pairs.current[i],
                                                                             motion.T_cur_prev, camera, options, pair))
        count += detail::add_pair(pair, static_cast<double>(sigma_px * pairs.relative_sigma(i)), moved, sums).weight;
    }
    const double share = 1 / (1 + count * shared * shared);
    const Vector6<double> g = -share * sums.g;
    const Matrix6<double> H = share * Matrix6<double>(sums.H.template selfadjointView<Eigen::Upper>());
    if (!invert_normal_equations<6>(Matrix6<double>(H + information), 1e-14, inverse)) return 0;
    // xi eliminated: S D = s with S = H - H (H + C^-1)^-1 H, without the difference.
    const Vector6<double> s = information.lazyProduct(inverse.lazyProduct(g));
    const Matrix6<double> S = information.lazyProduct(Matrix6<double>(inverse.lazyProduct(H)));
    Eigen::Matrix<double, 3, 1> D;
    if (!solve_normal_equations<3>(S.template topLeftCorner<3, 3>(), -s.template head<3>(), 0, 1e-14, D)) return 0;
    chi_squared = D.dot(s.template head<3>());
    moved = inverse.lazyProduct(Vector6<double>(g - H.template leftCols<3>().lazyProduct(D)));
    moved.template head<3>() += D;
  }
  return (std::max)(chi_squared, 0.0);
}

}  // namespace CFP_ISA
}  // namespace cfp
