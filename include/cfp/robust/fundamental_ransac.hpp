/// @file fundamental_ransac.hpp
/// The fundamental matrix of pairs with mismatches: seeded LO-RANSAC over seven-point samples, a score that decreases
/// with the distance, robust non-linear refinement, and a refusal instead of a wrong F if a rotation, a plane or no
/// motion explains the pairs. F maps a pixel of the previous image to its line in the current one, x_cur^T F x_prev =
/// 0. Distances in pixels.
#pragma once

#include <algorithm>
#include <vector>

#include "cfp/core/span.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/geometry/epipolar.hpp"
#include "cfp/geometry/point_pairs.hpp"
#include "cfp/robust/fundamental_degeneracy_impl.hpp"
#include "cfp/robust/fundamental_noise_impl.hpp"
#include "cfp/robust/fundamental_search_impl.hpp"
#include "cfp/robust/ransac.hpp"

namespace cfp {

/// The threshold is a Sampson distance: 1 px is 2 sigma for sigma = 0.5 px per coordinate. At least 8 inliers: any
/// seven pairs have an F.
struct FundamentalRansacOptions : RansacOptions {};

template <typename Scalar>
struct FundamentalResult : RansacReport {
  Matrix3<Scalar> F = Matrix3<Scalar>::Zero();           ///< unit norm, rank 2; zero unless found()
  Matrix3<Scalar> homography = Matrix3<Scalar>::Zero();  ///< previous to current pixels, det > 0, unit norm; set for
                                                         ///< no_motion, pure_rotation, planar, homography
};

/// Scratch memory of fundamental_ransac: keep one per thread. After a call with n pairs, calls with up to n allocate
/// nothing.
struct FundamentalRansacWorkspace {
  detail::PairArrays pairs;
  std::vector<double> sampling;
  std::vector<std::uint32_t> list;
  std::vector<double> distances_sq, scratch;
  Matrix3<double> F = Matrix3<double>::Zero();  // of the last call and of scaled pixels
  double noise_variance = 0;
};

namespace detail {
inline namespace CFP_ISA {

/// F of scaled coordinates and its inliers as the result.
template <typename Scalar>
void report_fundamental(const Matrix3<double>& F, const FundamentalSearch<double>& search, std::size_t min_inliers,
                        span<char> inlier_mask, FundamentalResult<Scalar>& result) noexcept {
  const auto is_inlier = [&](std::size_t i) { return search.distances_sq[i] <= search.limit; };
  report_inliers(search.pairs, is_inlier, min_inliers, inlier_mask, result);
  if (result.found()) result.F = unscaled_fundamental(F, search.pairs.scaling).template cast<Scalar>();
}

/// In the place of an F: what motion the homography is, its pairs and itself.
template <typename Scalar>
void report_homography(DegeneracyCheck<double>& check, const Matrix3<double>* K, std::size_t min_inliers,
                       span<char> inlier_mask, FundamentalResult<Scalar>& result) noexcept {
  const PairArrays& pairs = check.pairs;
  const auto is_inlier = [&](std::size_t i) { return transfer_sq(pairs, check.H, i) <= check.transfer_limit(); };
  result.status = check.classify(K);
  report_inliers(pairs, is_inlier, min_inliers, inlier_mask, result);
  if (result.status == RansacStatus::planar || result.status == RansacStatus::homography) {
    check.search.list_where(is_inlier);
    if (lie_on_a_line(pairs, check.search.list, 2 * std::sqrt(check.transfer_limit())))
      refuse(inlier_mask, result, RansacStatus::degenerate);
  }
  if (result.status == RansacStatus::no_consensus || result.status == RansacStatus::degenerate) return;
  const Matrix3<double> pixels =
      unscaling_matrix(pairs.scaling.current) * check.H * scaling_matrix(pairs.scaling.previous);
  result.homography = ((determinant(pixels) < 0 ? -1.0 : 1.0) * pixels.normalized()).template cast<Scalar>();
}

template <typename Scalar>
[[nodiscard]] FundamentalResult<Scalar> fundamental_ransac(const PointPairs<Scalar>& input, const Matrix3<double>* K,
                                                           const FundamentalRansacOptions& options,
                                                           FundamentalRansacWorkspace& workspace,
                                                           span<char> inlier_mask) {
  CFP_ASSERT(fits(input.previous.size(), inlier_mask));
  std::fill(inlier_mask.begin(), inlier_mask.end(), char(0));
  FundamentalResult<Scalar> result;
  PairArrays& pairs = workspace.pairs;
  load_pairs(input, 3 * options.threshold_px, pairs);
  workspace.sampling.reserve(pairs.capacity);
  workspace.list.reserve(pairs.capacity);
  workspace.distances_sq.resize(pairs.capacity);
  workspace.scratch.resize(4 * pairs.capacity);
  result.used = pairs.size;
  if (pairs.size < options.min_inliers || pairs.size < 8) return result;
  result.status = RansacStatus::degenerate;
  if (!(pairs.factor > 0)) return result;
  const double threshold = options.threshold_px * pairs.factor;
  FundamentalSearch<double> search{pairs, threshold * threshold, workspace.list, workspace.distances_sq,
                                   Random(options.seed, "fundamental_ransac")};

  RansacSearch<Matrix3<double>> found = lo_ransac(search, options, search.random, workspace.sampling);
  result.iterations = found.iterations;
  Matrix3<double>& F = found.best.model;
  bool has_F = is_finite(found.best.cost);
  DegeneracyCheck<double> check{search, workspace.scratch};
  if (has_F)
    search.measure_noise(F);
  else
    std::fill(search.distances_sq.begin(), search.distances_sq.end(), 0.0);
  search.collect_inliers();
  check.find_homography(has_F ? 24 : 200);
  if (has_F) {
    if (check.dominant) check.complete_from_plane(found.best);
    search.polish(F, found.confident ? 1 : 4);
    search.collect_inliers();
    has_F = check.has_parallax(F, K, static_cast<double>(options.min_inliers));
    if (!has_F && !check.rests_on_lines()) result.status = RansacStatus::no_consensus;
  } else {
    for (std::size_t i = 0; i < pairs.size; ++i) search.distances_sq[i] = transfer_sq(pairs, check.H, i) / 4;
    search.measure_noise();
  }
  if (has_F) {
    result.status = found.confident ? RansacStatus::ok : RansacStatus::iteration_limit;
    report_fundamental(F, search, options.min_inliers, inlier_mask, result);
    workspace.F = F;
    workspace.noise_variance = search.noise.variance;
  } else if (check.dominant) {
    report_homography(check, K, options.min_inliers, inlier_mask, result);
  }
  return result;
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

[[nodiscard]] inline OptionPath invalid_field(const FundamentalRansacOptions& options) noexcept {
  return invalid_field(options, 8);
}

/// Robust F of pairs: `fundamental_ransac(PointPairs{previous, current}, options, workspace)`. Weights multiply the
/// score, sum w d^2 / (d^2 + T^2 / 4), and the refinement's loss, and steer the sampling; the inlier test sees the
/// Sampson distance d alone. inlier_mask: empty or one per pair, 1 = inlier. Works in double, scores in float.
///
/// The homography with most inliers is searched first; if other pairs show parallax, F is completed from both. There is
/// no F, and `status` says why, unless
///  - more pairs lie near its lines than the best of all samples would gather by chance (from which 30 true pairs among
///    300 are not distinguished),
///  - its lines explain the pairs better than that homography and than no motion do, by more than chance,
///  - this holds also without any one part of the image that a mover nearby may fill,
///  - and without any two lines of points (`degenerate`).
/// Pairs that begin or end in the same cell of three thresholds count as one there. Where most pairs are mismatches a
/// moving region may still be taken for parallax; so may noise that is larger in one image direction for all pairs
/// (docs/limits.md). Pixels must be undistorted.
///
/// The result is refined under a Geman-McClure loss of 2.25 standard deviations of the noise that the pairs themselves
/// show, from several starts, since the cost has several minima on a short baseline. Cost per sample about 1 us plus
/// 0.3 us per 200 pairs, and some 100 us at the end. Sources: Chum, Matas, Kittler: "Locally optimized RANSAC", DAGM
/// 2003; Geman and McClure 1987 for score and loss; DEGENSAC (see fundamental_degeneracy_impl.hpp).
template <typename Scalar>
[[nodiscard]] FundamentalResult<Scalar> fundamental_ransac(const PointPairs<Scalar>& pairs,
                                                           const FundamentalRansacOptions& options,
                                                           FundamentalRansacWorkspace& workspace,
                                                           span<char> inlier_mask = {}) {
  return detail::fundamental_ransac<Scalar>(pairs, nullptr, options, workspace, inlier_mask);
}
/// With the camera's intrinsics a rotation is distinguished from a plane, and an F that a rotation explains as well is
/// refused.
template <typename Scalar>
[[nodiscard]] FundamentalResult<Scalar> fundamental_ransac(const PointPairs<Scalar>& pairs,
                                                           const PinholeCamera<Scalar>& camera,
                                                           const FundamentalRansacOptions& options,
                                                           FundamentalRansacWorkspace& workspace,
                                                           span<char> inlier_mask = {}) {
  const Matrix3<double> K = camera.matrix().template cast<double>();
  return detail::fundamental_ransac<Scalar>(pairs, &K, options, workspace, inlier_mask);
}

/// The covariance of F, the result of the last call with this workspace, from the noise of its pairs. Zero without F,
/// and if the pairs do not determine it. Allocates nothing; some 10 us for 500 pairs.
template <typename Scalar>
[[nodiscard]] FundamentalCovariance fundamental_covariance(const FundamentalResult<Scalar>& result,
                                                           const FundamentalRansacWorkspace& workspace) noexcept {
  if (!result.found()) return FundamentalCovariance::Zero();
  constexpr double loss = detail::FundamentalSearch<double>::final_scale;
  return detail::weight_in_covariance(workspace.pairs, workspace.distances_sq, loss * workspace.noise_variance) *
         detail::covariance_in_pixels(workspace.pairs, workspace.F, workspace.noise_variance, loss);
}

}  // namespace CFP_ISA
}  // namespace cfp
