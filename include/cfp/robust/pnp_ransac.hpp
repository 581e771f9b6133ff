/// @file pnp_ransac.hpp
/// Camera pose of 3-D/2-D matches with mismatches and without a start: seeded LO-RANSAC over P3P samples that follow
/// the weights (map-point and keypoint static probabilities), MSAC score in pixels, any camera. Its pose starts the
/// weighted refinement.
#pragma once

#include <algorithm>
#include <cstddef>

#include "cfp/core/span.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/robust/pnp_ransac_impl.hpp"
#include "cfp/robust/pnp_ransac_types.hpp"
#include "cfp/robust/sampling.hpp"

namespace cfp {

/// Scratch memory of pnp_ransac: keep one per thread. After a call with n matches, calls with up to n allocate nothing.
struct PnpRansacWorkspace {
  detail::MatchArrays matches;
  MinimalSampler sampler;
};

/// Pose of matches (world[i], pixels[i]). weights: empty (ones) or one per match; only ratios matter. They multiply the
/// score, sum w min(d^2 / T^2, 1), and the refinement's loss, and steer the sampling; the inlier test sees the
/// reprojection distance d alone, so a low weight never makes a mismatch harder to reject. A match whose weight is not
/// positive and finite, whose coordinates are not finite (points: not below 1e8), or whose pixel has no ray counts as
/// absent. inlier_mask: empty or one per match, 1 = inlier.
///
/// During the search d is linearised by the camera's Jacobian at the measured pixel: exact for a pinhole camera, to
/// first order in d for any other; the final inliers use the camera itself. The search stops early when the weighted
/// share of inliers gives the confidence. Works in double, scores in float. Source of the local optimisation: Chum,
/// Matas, Kittler: "Locally optimized RANSAC", DAGM 2003.
template <typename Camera, typename Scalar = typename Camera::ScalarType>
PnpRansacResult<Scalar> pnp_ransac(const Camera& camera, PointSpan<Scalar, 3> world, PointSpan<Scalar, 2> pixels,
                                   span<const Scalar> weights, span<char> inlier_mask, const PnpRansacOptions& options,
                                   PnpRansacWorkspace& workspace) {
  CFP_ASSERT(world.size() == pixels.size() && (weights.empty() || weights.size() == world.size()) &&
             (inlier_mask.empty() || inlier_mask.size() == world.size()));
  std::fill(inlier_mask.begin(), inlier_mask.end(), char(0));
  PnpRansacResult<Scalar> result;
  detail::MatchArrays& matches = workspace.matches;
  matches.load(camera, world, pixels, weights);
  result.matches = matches.size;
  if (matches.size < options.min_inliers || matches.size < 4) return result;
  workspace.sampler.reset(matches.size, weights.empty() ? span<const double>() : matches.weights(), 3, options.sampling,
                          options.max_iterations);
  detail::PnpSearch search{matches, options, workspace.sampler, options.threshold_px * options.threshold_px,
                           Random(options.seed, "pnp_ransac")};
  detail::PnpCandidate best = search.run();
  result.iterations = search.iterations;
  result.reason = PnpRansacReason::no_consensus;
  if (!(best.cost < matches.total_weight)) return result;
  search.polish(best);

  SE3<double> T = best.T;
  T.translation -= T.rotation * matches.origin;
  const SE3<Scalar> pose = T.template cast<Scalar>();
  double weight = 0;
  for (std::size_t i = 0; i < matches.size; ++i) {
    const std::size_t k = matches.index[i];
    Vector2<Scalar> pixel(Scalar(0), Scalar(0));
    if (!camera.project(pose * world[k], pixel) || !((pixel - pixels[k]).squaredNorm() <= Scalar(search.limit)))
      continue;
    ++result.inliers;
    weight += matches.weights()[i];
    if (!inlier_mask.empty()) inlier_mask[k] = 1;
  }
  if (result.inliers < options.min_inliers) {
    std::fill(inlier_mask.begin(), inlier_mask.end(), char(0));
    result.inliers = 0;
    return result;
  }
  result.inlier_share = (std::min)(weight / matches.total_weight, 1.0);
  result.T_cam_world = pose;
  result.reason = search.confident ? PnpRansacReason::ok : PnpRansacReason::iteration_limit;
  return result;
}

}  // namespace cfp
