/// @file pnp_ransac_types.hpp
/// Options, reasons and result of pnp_ransac.hpp.
#pragma once

#include <cstddef>
#include <cstdint>

#include "cfp/core/options.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/robust/sampling.hpp"

namespace cfp {

struct PnpRansacOptions {
  double threshold_px =
      2.5;                   ///< reprojection distance up to which a match is an inlier, (0, 1e4); 2.45 sigma hold 95 %
  double confidence = 0.99;  ///< of having drawn a sample without mismatches, (0, 1)
  std::size_t min_iterations = 5;          ///< samples drawn at least
  std::size_t max_iterations = 1000;       ///< samples drawn at most, >= 1
  std::size_t min_inliers = 8;             ///< fewer inliers are no consensus, >= 4: any three matches have a pose
  Sampling sampling = Sampling::weighted;  ///< how samples follow the weights; cfp_pnp_ransac_benchmark compares them
  std::uint64_t seed = 0;                  ///< same input and seed, same bits
};

[[nodiscard]] inline OptionPath invalid_field(const PnpRansacOptions& options) noexcept {
  if (!(options.threshold_px > 0 && options.threshold_px < 1e4)) return "threshold_px";
  if (!detail::inside_unit_interval(options.confidence)) return "confidence";
  if (options.max_iterations < 1) return "max_iterations";
  if (options.min_iterations > options.max_iterations) return "min_iterations";
  if (options.min_inliers < 4) return "min_inliers";
  return {};
}

enum class PnpRansacReason : std::uint8_t {
  ok,               ///< pose found with the asked confidence
  iteration_limit,  ///< pose found, but max_iterations ended the search before the confidence was reached
  too_few_matches,  ///< fewer than min_inliers matches are present
  no_consensus      ///< no pose has min_inliers inliers: mismatches, or points on one line
};

/// The enumerator's name, for reports.
[[nodiscard]] constexpr const char* to_string(PnpRansacReason reason) noexcept {
  switch (reason) {
    case PnpRansacReason::ok:
      return "ok";
    case PnpRansacReason::iteration_limit:
      return "iteration limit";
    case PnpRansacReason::too_few_matches:
      return "too few matches";
    case PnpRansacReason::no_consensus:
      return "no consensus";
  }
  return "unknown";
}

template <typename Scalar>
struct PnpRansacResult {
  SE3<Scalar> T_cam_world;  ///< identity unless has_pose()
  PnpRansacReason reason = PnpRansacReason::too_few_matches;
  std::size_t matches = 0;  ///< present: finite, weight > 0, with a ray
  std::size_t inliers = 0;
  std::size_t iterations = 0;  ///< samples drawn
  double inlier_share = 0;     ///< share of the weight that inliers hold, [0, 1]

  [[nodiscard]] bool has_pose() const noexcept {
    return reason == PnpRansacReason::ok || reason == PnpRansacReason::iteration_limit;
  }
};

}  // namespace cfp
