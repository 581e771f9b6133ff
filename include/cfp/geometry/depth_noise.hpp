/// @file depth_noise.hpp
/// The noise of depth measurements, and the prior of a depth that was not measured.
#pragma once

#include "cfp/core/options.hpp"

namespace cfp {

/// One standard deviation of a depth measurement, in metres: constant + quadratic (z - nearest)^2. It does not model
/// the bias of stereo, whose depth is one over a disparity: the motion from such depths has too small a covariance if
/// most disparities are below ten times their noise (cfp_camera_motion_study).
struct DepthNoise {
  double constant_m = 0.0012;  ///< >= 0
  double quadratic = 0.0019;   ///< 1/m, >= 0; for stereo: constant_m 0, nearest_m 0, quadratic = sigma_disparity_px /
                               ///< (fx_px baseline_m)
  double nearest_m = 0.4;      ///< defaults: structured light, Nguyen, Izadi and Lovell, 3DIMPVT 2012

  /// Example: 0.0140 m at z = 3 m with the defaults.
  [[nodiscard]] CFP_INLINE constexpr double sigma_m(double depth_m) const noexcept {
    return constant_m + quadratic * (depth_m - nearest_m) * (depth_m - nearest_m);
  }
};

/// Prior of a depth that was not measured: inverse depth, mean +- sigma. The default covers everything beyond 0.7 m;
/// with a sigma of 1e6 only the distance from the epipolar line remains.
struct UnknownDepth {
  double inverse_mean = 0.5;   ///< 1/m, > 0
  double inverse_sigma = 0.5;  ///< 1/m, >= 0
};

/// The depth model of motion_distance.
struct MotionDistanceOptions {
  DepthNoise depth_noise;      ///< of a measured depth
  UnknownDepth unknown_depth;  ///< prior of all others
};

inline namespace CFP_ISA {

[[nodiscard]] constexpr OptionPath invalid_field(const DepthNoise& o) noexcept {
  if (!detail::non_negative(o.constant_m)) return "constant_m";
  if (!detail::non_negative(o.quadratic)) return "quadratic";
  return is_finite(o.nearest_m) ? OptionPath() : "nearest_m";
}

[[nodiscard]] constexpr OptionPath invalid_field(const UnknownDepth& o) noexcept {
  if (!detail::positive(o.inverse_mean)) return "inverse_mean";
  return detail::non_negative(o.inverse_sigma) ? OptionPath() : "inverse_sigma";
}

[[nodiscard]] constexpr OptionPath invalid_field(const MotionDistanceOptions& o) noexcept {
  if (const OptionPath field = nested("depth_noise", invalid_field(o.depth_noise))) return field;
  return nested("unknown_depth", invalid_field(o.unknown_depth));
}

}  // namespace CFP_ISA
}  // namespace cfp
