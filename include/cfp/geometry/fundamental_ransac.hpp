/// @file fundamental_ransac.hpp
/// The fundamental matrix of pairs with mismatches: seeded LO-RANSAC over seven-point samples, MSAC score, robust non-linear
/// refinement, and a refusal instead of a wrong F when a rotation, a plane or no motion explains the pairs.
/// F maps a pixel of the previous image to its line in the current one, x_cur^T F x_prev = 0. Distances in pixels.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cfp/core/options.hpp"
#include "cfp/core/span.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/math/sampling.hpp"
#include "cfp/math/so3.hpp"

namespace cfp {

struct FundamentalRansacOptions {
  double threshold_px = 1.0;          ///< Sampson distance up to which a pair is an inlier, (0, 1e4); 2 sigma for sigma = 0.5 px per coordinate
  double confidence = 0.99;           ///< of having drawn a sample without mismatches, (0, 1)
  std::size_t min_iterations = 30;    ///< samples drawn at least
  std::size_t max_iterations = 1000;  ///< samples drawn at most, >= 1
  std::size_t min_inliers = 12;       ///< fewer inliers are no consensus, >= 8: any seven pairs have an F
  Sampling sampling = Sampling::weighted;  ///< how samples follow the weights
  std::uint64_t seed = 0;             ///< same input and seed, same bits
};

[[nodiscard]] inline const char* invalid_field(const FundamentalRansacOptions& options) noexcept {
  if (!(options.threshold_px > 0 && options.threshold_px < 1e4)) return "threshold_px";
  if (!(options.confidence > 0 && options.confidence < 1)) return "confidence";
  if (options.max_iterations < 1) return "max_iterations";
  if (options.min_iterations > options.max_iterations) return "min_iterations";
  if (options.min_inliers < 8) return "min_inliers";
  return nullptr;
}

enum class FundamentalReason : std::uint8_t {
  ok,               ///< F found with the asked confidence
  iteration_limit,  ///< F found, but max_iterations ended the search before the confidence was reached
  too_few_pairs,    ///< fewer than min_inliers pairs are present: no F
  coincident,       ///< the points of an image (nearly) coincide: no F
  no_consensus,     ///< no F has min_inliers inliers: no F
  no_motion,        ///< the pairs do not move: no F, the homography is the identity
  pure_rotation,    ///< a rotation of the camera explains the pairs: no F, see the homography
  planar,           ///< a homography that is no rotation explains the pairs, a plane: no F, see the homography
  homography        ///< a homography explains the pairs; without intrinsics rotation and plane are not told apart: no F
};

/// The enumerator's name, for reports.
[[nodiscard]] constexpr const char* to_string(FundamentalReason reason) noexcept {
  switch (reason) {
    case FundamentalReason::ok: return "ok";
    case FundamentalReason::iteration_limit: return "iteration limit";
    case FundamentalReason::too_few_pairs: return "too few pairs";
    case FundamentalReason::coincident: return "coincident";
    case FundamentalReason::no_consensus: return "no consensus";
    case FundamentalReason::no_motion: return "no motion";
    case FundamentalReason::pure_rotation: return "pure rotation";
    case FundamentalReason::planar: return "planar";
    case FundamentalReason::homography: return "homography";
  }
  return "unknown";
}

template <typename Scalar>
struct FundamentalResult {
  Matrix3<Scalar> F = Matrix3<Scalar>::Zero();           ///< unit norm, rank 2; zero unless has_fundamental()
  Matrix3<Scalar> homography = Matrix3<Scalar>::Zero();  ///< previous to current pixels, det > 0, unit norm; set for no_motion, pure_rotation, planar, homography
  FundamentalReason reason = FundamentalReason::too_few_pairs;
  std::size_t pairs = 0;       ///< present: finite, weight > 0
  std::size_t inliers = 0;     ///< of F, or of the homography
  std::size_t iterations = 0;  ///< samples drawn
  double inlier_share = 0;     ///< share of the weight that inliers hold, [0, 1]

  [[nodiscard]] bool has_fundamental() const noexcept { return reason == FundamentalReason::ok || reason == FundamentalReason::iteration_limit; }
};

}  // namespace cfp

#include "cfp/geometry/fundamental_ransac_impl.hpp"

namespace cfp {

/// Scratch memory of fundamental_ransac: keep one per thread. After a call with n pairs, calls with up to n allocate nothing.
struct FundamentalRansacWorkspace {
  detail::PairArrays pairs;
  MinimalSampler sampler;
  std::vector<std::uint32_t> list;
};

/// Robust F of pairs (prev[i], cur[i]). weights: empty (ones) or one per pair; only ratios matter. They multiply the score, sum w
/// min(d^2 / T^2, 1), and the refinement's loss, and steer the sampling; the inlier test sees the Sampson distance alone. A pair whose weight is not positive and
/// finite, or whose coordinates are not finite and below 1e5 px, counts as absent. inlier_mask: empty or one per pair, 1 = inlier.
/// camera: intrinsics, only to tell a rotation from a plane. All weights and points of float are taken to double.
///
/// A homography that holds most inliers is looked for first: with parallax beside it the F is completed from both, without it
/// there is no F and `reason` says why. Cost per sample about 1 us plus 0.3 us per 200 pairs. Sources: Chum, Matas, Kittler:
/// "Locally optimized RANSAC", DAGM 2003; Torr and Zisserman: "MLESAC", CVIU 2000, for the score; DEGENSAC (see fundamental_ransac_impl.hpp).
template <typename Scalar>
FundamentalResult<Scalar> fundamental_ransac(PointSpan<Scalar, 2> prev, PointSpan<Scalar, 2> cur, span<const Scalar> weights, span<char> inlier_mask,
                                             const FundamentalRansacOptions& options, FundamentalRansacWorkspace& workspace,
                                             const PinholeCamera<Scalar>* camera = nullptr) {
  CFP_ASSERT(prev.size() == cur.size() && (weights.empty() || weights.size() == prev.size()) && (inlier_mask.empty() || inlier_mask.size() == prev.size()));
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
  workspace.sampler.reset(pairs.size, weights.empty() ? span<const double>() : pairs.weights(), 7, options.sampling, options.max_iterations);
  const double threshold = options.threshold_px * pairs.factor;
  detail::FundamentalSearch search{pairs, options, workspace.sampler, workspace.list, threshold * threshold, Random(options.seed, "fundamental_ransac")};

  detail::FundamentalCandidate best = search.run();
  result.iterations = search.iterations;
  if (!(best.cost < pairs.total_weight)) {
    result.reason = FundamentalReason::no_consensus;
    return result;
  }
  Matrix3<double> H;
  const bool has_homography = search.dominant_homography(best.F, 0.5, H);
  if (has_homography) search.complete_from_plane(H, best);
  search.polish(best);
  search.measure_noise(best.F);
  const bool explained_by_homography = has_homography && !search.has_parallax(H, best.F);
  if (explained_by_homography) {
    PinholeCamera<double> intrinsics;
    if (camera != nullptr) intrinsics = {double(camera->fx), double(camera->fy), double(camera->cx), double(camera->cy)};
    result.reason = search.classify(camera != nullptr ? &intrinsics : nullptr, H);
  } else {
    result.reason = search.confident ? FundamentalReason::ok : FundamentalReason::iteration_limit;
  }
  const double limit = explained_by_homography ? search.transfer_limit() : search.limit;
  double weight = 0;
  for (std::size_t i = 0; i < pairs.size; ++i) {
    const double distance_sq = explained_by_homography ? detail::transfer_sq(pairs, H, i) : detail::scaled_sampson_sq(pairs, best.F, i);
    if (!(distance_sq <= limit)) continue;
    ++result.inliers;
    weight += pairs.weights()[i];
    if (!inlier_mask.empty()) inlier_mask[pairs.index[i]] = 1;
  }
  result.inlier_share = (std::min)(weight / pairs.total_weight, 1.0);
  if (result.inliers < options.min_inliers) {
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
