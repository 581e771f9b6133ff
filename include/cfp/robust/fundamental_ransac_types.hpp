/// @file fundamental_ransac_types.hpp
/// Options, reasons and result of fundamental_ransac.hpp.
#pragma once

#include <cstddef>
#include <cstdint>

#include "cfp/core/options.hpp"
#include "cfp/math/so3.hpp"
#include "cfp/robust/sampling.hpp"

namespace cfp {

struct FundamentalRansacOptions {
  double threshold_px =
      1.0;  ///< Sampson distance up to which a pair is an inlier, (0, 1e4); 2 sigma for sigma = 0.5 px per coordinate
  double confidence = 0.99;                ///< of having drawn a sample without mismatches, (0, 1)
  std::size_t min_iterations = 30;         ///< samples drawn at least
  std::size_t max_iterations = 1000;       ///< samples drawn at most, >= 1
  std::size_t min_inliers = 12;            ///< fewer inliers are no consensus, >= 8: any seven pairs have an F
  Sampling sampling = Sampling::weighted;  ///< how samples follow the weights
  std::uint64_t seed = 0;                  ///< same input and seed, same bits
};

[[nodiscard]] inline OptionPath invalid_field(const FundamentalRansacOptions& options) noexcept {
  if (!(options.threshold_px > 0 && options.threshold_px < 1e4)) return "threshold_px";
  if (!detail::inside_unit_interval(options.confidence)) return "confidence";
  if (options.max_iterations < 1) return "max_iterations";
  if (options.min_iterations > options.max_iterations) return "min_iterations";
  if (options.min_inliers < 8) return "min_inliers";
  return {};
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
    case FundamentalReason::ok:
      return "ok";
    case FundamentalReason::iteration_limit:
      return "iteration limit";
    case FundamentalReason::too_few_pairs:
      return "too few pairs";
    case FundamentalReason::coincident:
      return "coincident";
    case FundamentalReason::no_consensus:
      return "no consensus";
    case FundamentalReason::no_motion:
      return "no motion";
    case FundamentalReason::pure_rotation:
      return "pure rotation";
    case FundamentalReason::planar:
      return "planar";
    case FundamentalReason::homography:
      return "homography";
  }
  return "unknown";
}

template <typename Scalar>
struct FundamentalResult {
  Matrix3<Scalar> F = Matrix3<Scalar>::Zero();           ///< unit norm, rank 2; zero unless has_fundamental()
  Matrix3<Scalar> homography = Matrix3<Scalar>::Zero();  ///< previous to current pixels, det > 0, unit norm; set for
                                                         ///< no_motion, pure_rotation, planar, homography
  FundamentalReason reason = FundamentalReason::too_few_pairs;
  std::size_t pairs = 0;       ///< present: finite, weight > 0
  std::size_t inliers = 0;     ///< of F, or of the homography
  std::size_t iterations = 0;  ///< samples drawn
  double inlier_share = 0;     ///< share of the weight that inliers hold, [0, 1]

  [[nodiscard]] bool has_fundamental() const noexcept {
    return reason == FundamentalReason::ok || reason == FundamentalReason::iteration_limit;
  }
};

}  // namespace cfp
