/// @file adaptive.hpp
/// eps and min_pts of the depth clustering from the depths themselves (paper IV-C: "we adaptively determine eps and
/// minPts", without saying how).
#pragma once

#include <algorithm>
#include <cmath>

#include "cfp/clustering/dbscan.hpp"
#include "cfp/core/options.hpp"
#include "cfp/core/span.hpp"
#include "cfp/geometry/depth_noise.hpp"

namespace cfp {

enum class AdaptiveRule : std::uint8_t {
  foreground_density,  ///< see `adaptive_options`
  fixed                ///< `fixed` as it stands
};

struct AdaptiveOptions {
  AdaptiveRule rule = AdaptiveRule::foreground_density;
  DbscanOptions fixed;  ///< for `fixed`, and where the rule has too few values to work on
  DepthNoise noise;
  double noise_factor = 3.0;    ///< eps is at least so many sigmas at the foreground's depth; >= 0
  double min_eps_m = 0.1;       ///< smallest eps; a smaller one tears bodies, limbs become background; > 0
  double max_eps_m = 0.3;       ///< largest eps; a larger one bridges to the wall; >= min_eps_m
  double spacing_factor = 3.0;  ///< eps follows so many mean spacings, for boxes with few points; > 0
  double min_share = 0.15;      ///< the foreground's depth is read at this share of all points, as nearer ones may be a
                                ///< hand or flying pixels at a silhouette; [0, 1)
  double density = 0.3;         ///< share of the foreground's density that a core point must have; (0, 1]
};

inline namespace CFP_ISA {

[[nodiscard]] constexpr OptionPath invalid_field(const AdaptiveOptions& o) noexcept {
  if (const OptionPath field = nested("fixed", invalid_field(o.fixed))) return field;
  if (const OptionPath field = nested("noise", invalid_field(o.noise))) return field;
  if (!detail::non_negative(o.noise_factor)) return "noise_factor";
  if (!detail::positive(o.min_eps_m)) return "min_eps_m";
  if (!(o.max_eps_m >= o.min_eps_m) || !is_finite(o.max_eps_m)) return "max_eps_m";
  if (!detail::positive(o.spacing_factor)) return "spacing_factor";
  if (!(o.min_share >= 0.0 && o.min_share < 1.0)) return "min_share";
  if (!(o.density > 0.0 && o.density <= 1.0)) return "density";
  return {};
}

/// eps (metres) and min_pts for depths that are valid and ascending.
/// The rule reads the foreground's depth z at `min_share`, sets eps to `spacing_factor` mean spacings around it within
/// [min_eps_m, max_eps_m], but at least noise_factor sigmas at z, counts the neighbours of the points up to z + eps,
/// and asks of a core point `density` of the largest count, at least 2. So min_pts grows with n and with the density of
/// the foreground, not of the wall. Fewer than three depths, or an eps that overflows: `fixed`. O(n). Allocates only
/// when the workspace grows. Source: ours; paper IV-C leaves it open.
template <typename Scalar>
[[nodiscard]] DbscanOptions adaptive_options(span<const non_deduced<Scalar>> depths, const AdaptiveOptions& options,
                                             DbscanWorkspace<Scalar>& workspace) {
  CFP_ASSERT(std::is_sorted(depths.begin(), depths.end()));
  const std::size_t n = depths.size();
  if (n < 3 || options.rule == AdaptiveRule::fixed) return options.fixed;
  const auto depth = [&](std::size_t i) { return static_cast<double>(depths[i]); };
  const std::size_t at = detail::position_of_share(options.min_share, n);
  const std::size_t around = 3 + static_cast<std::size_t>(0.5 * std::sqrt(static_cast<double>(n)));
  const std::size_t low = at > around ? at - around : 0, high = (std::min)(n - 1, at + around);
  const double spacing = (depth(high) - depth(low)) / static_cast<double>(high - low);
  DbscanOptions chosen;
  chosen.eps = (std::min)((std::max)(options.min_eps_m, options.spacing_factor * spacing), options.max_eps_m);
  chosen.eps = (std::max)(chosen.eps, options.noise_factor * options.noise.sigma_m(depth(at)));
  if (!is_finite(chosen.eps)) return options.fixed;

  const Scalar eps = detail::radius<Scalar>(chosen.eps);
  detail::count_neighbours(depths, eps, workspace.neighbours);
  std::uint32_t peak = 0;
  for (std::size_t i = 0; i < n && (i <= at || depths[i] - depths[at] <= eps); ++i)
    peak = (std::max)(peak, workspace.neighbours[i]);
  chosen.min_pts = (std::max)(std::size_t(2), static_cast<std::size_t>(std::ceil(options.density * peak)));
  return chosen;
}

}  // namespace CFP_ISA
}  // namespace cfp
