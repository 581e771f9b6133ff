/// @file fundamental_ransac.hpp
/// The fundamental matrix of pairs with mismatches: seeded LO-RANSAC over seven-point samples, MSAC score, robust
/// non-linear refinement, and a refusal instead of a wrong F when a rotation, a plane or no motion explains the pairs.
/// F maps a pixel of the previous image to its line in the current one, x_cur^T F x_prev = 0. Distances in pixels.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cfp/core/span.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/robust/fundamental_degeneracy_impl.hpp"
#include "cfp/robust/fundamental_ransac_impl.hpp"
#include "cfp/robust/fundamental_ransac_types.hpp"
#include "cfp/robust/sampling.hpp"

namespace cfp {

/// Scratch memory of fundamental_ransac: keep one per thread. After a call with n pairs, calls with up to n allocate
/// nothing.
struct FundamentalRansacWorkspace {
  detail::PairArrays pairs;
  MinimalSampler sampler;
  std::vector<std::uint32_t> list;
  std::vector<double> distances_sq;
};

/// Robust F of pairs (prev[i], cur[i]). weights: empty (ones) or one per pair; only ratios matter. They multiply the
/// score, sum w min(d^2 / T^2, 1), and the refinement's loss, and steer the sampling; the inlier test sees the Sampson
/// distance alone. A pair whose weight is not positive and finite, or whose coordinates are not finite and below 1e5
/// px, counts as absent. inlier_mask: empty or one per pair, 1 = inlier. camera: intrinsics, only to tell a rotation
/// from a plane. Works in double, scores in float.
///
/// A homography that holds most inliers is looked for first: with parallax beside it the F is completed from both,
/// without it there is no F and `reason` says why. The result is refined under a Geman-McClure loss of 2.25 standard
/// deviations of the noise that the pairs themselves show, from several starts, as a short baseline gives the cost
/// several minima. Cost per sample about 1 us plus 0.3 us per 200 pairs, and some 100 us at the end. Sources: Chum,
/// Matas, Kittler: "Locally optimized RANSAC", DAGM 2003; Torr and Zisserman: "MLESAC", CVIU 2000, for the score;
/// DEGENSAC (see fundamental_degeneracy_impl.hpp).
template <typename Scalar>
FundamentalResult<Scalar> fundamental_ransac(PointSpan<Scalar, 2> prev, PointSpan<Scalar, 2> cur,
                                             span<const Scalar> weights, span<char> inlier_mask,
                                             const FundamentalRansacOptions& options,
                                             FundamentalRansacWorkspace& workspace,
                                             const PinholeCamera<Scalar>* camera = nullptr) {
  CFP_ASSERT(prev.size() == cur.size() && (weights.empty() || weights.size() == prev.size()) &&
             (inlier_mask.empty() || inlier_mask.size() == prev.size()));
  std::fill(inlier_mask.begin(), inlier_mask.end(), char(0));
  FundamentalResult<Scalar> result;
  detail::PairArrays& pairs = workspace.pairs;
  pairs.load(prev, cur, weights);
  result.pairs = pairs.size;
  if (pairs.size < options.min_inliers || pairs.size < 8) return result;
  if (!(pairs.factor > 0)) {
    result.reason = FundamentalReason::coincident;
    return result;
  }
  workspace.list.reserve(pairs.size);
  workspace.sampler.reset(pairs.size, weights.empty() ? span<const double>() : pairs.weights(), 7, options.sampling,
                          options.max_iterations);
  const double threshold = options.threshold_px * pairs.factor;
  detail::FundamentalSearch search{pairs,
                                   options,
                                   workspace.sampler,
                                   workspace.list,
                                   workspace.distances_sq,
                                   threshold * threshold,
                                   Random(options.seed, "fundamental_ransac")};

  detail::FundamentalCandidate best = search.run();
  result.iterations = search.iterations;
  if (!(best.cost < pairs.total_weight)) {
    result.reason = FundamentalReason::no_consensus;
    return result;
  }
  Matrix3<double> H;
  detail::HomographyCheck plane{search};
  const bool has_homography = plane.dominant_homography(best.F, 0.5, H);
  if (has_homography) plane.complete_from_plane(H, best);
  search.polish(best.F);
  const bool explained_by_homography = has_homography && !plane.has_parallax(H);
  if (explained_by_homography) {
    PinholeCamera<double> intrinsics;
    if (camera != nullptr)
      intrinsics = {double(camera->fx), double(camera->fy), double(camera->cx), double(camera->cy)};
    result.reason = plane.classify(camera != nullptr ? &intrinsics : nullptr, H);
  } else {
    result.reason = search.confident ? FundamentalReason::ok : FundamentalReason::iteration_limit;
  }
  const double limit = explained_by_homography ? plane.transfer_limit() : search.limit;
  double weight = 0;
  for (std::size_t i = 0; i < pairs.size; ++i) {
    const double distance_sq = explained_by_homography ? detail::transfer_sq(pairs, H, i) : search.distances_sq[i];
    if (!(distance_sq <= limit)) continue;
    ++result.inliers;
    weight += pairs.weights()[i];
    if (!inlier_mask.empty()) inlier_mask[pairs.index[i]] = 1;
  }
  result.inlier_share = (std::min)(weight / pairs.total_weight, 1.0);
  if (result.inliers < options.min_inliers) {
    std::fill(inlier_mask.begin(), inlier_mask.end(), char(0));
    result.inliers = 0;
    result.inlier_share = 0;
    result.reason = FundamentalReason::no_consensus;
  } else if (explained_by_homography) {
    const Matrix3<double> pixels = pairs.scale_cur.matrix().inverse() * H * pairs.scale_prev.matrix();
    result.homography = ((pixels.determinant() < 0 ? -1.0 : 1.0) * pixels.normalized()).template cast<Scalar>();
  } else {
    result.F = pairs.to_pixels(best.F).template cast<Scalar>();
  }
  return result;
}

}  // namespace cfp
