/// @file depth_foreground_types.hpp
/// Input, options and result of depth_foreground.hpp, which says what they mean together.
#pragma once

#include "cfp/clustering/adaptive.hpp"
#include "cfp/clustering/dbscan.hpp"
#include "cfp/core/numeric.hpp"
#include "cfp/core/options.hpp"
#include "cfp/core/span.hpp"
#include "cfp/geometry/box.hpp"
#include "cfp/geometry/depth_noise.hpp"

namespace cfp {

/// The keypoints of one box. Leave unknown members at their defaults.
template <typename Scalar>
struct ForegroundInput {
  span<const Scalar> depths_m;  ///< not positive or not finite: no depth there
  PointSpan<Scalar, 2> pixels;  ///< one per depth, px, finite; empty: unknown. Of use only with `box`.
  Box<Scalar> box;              ///< px; improper: unknown
  Scalar previous_depth_m{};    ///< `depth_m` of the same object's result in the frame before; not positive: unknown
  DepthNoise depth_noise{0, 0, 0};  ///< of the depths; the window is widened by it where it reaches decimetres
};

enum class ForegroundRule : std::uint8_t {
  depth_window,  ///< see `depth_foreground`
  dbscan         ///< as printed: the cluster of the lowest mean depth, and what is nearer
};

/// Defaults of the window from benchmarks/studies/foreground_study.cpp.
struct ForegroundOptions {
  ForegroundRule rule = ForegroundRule::depth_window;
  AdaptiveOptions adaptive;    ///< dbscan: eps and min_pts
  double near_share = 0.15;    ///< the front is read at this share of the depths, as a hand may be nearer; [0, 1)
  double upper_share = 0.1;    ///< the same among the points in the upper half of the box; [0, 1)
  double obstacle_m = 0.3;     ///< the upper half begins so much farther: something may stand before the person; >= 0
  double before_m = 0.5;       ///< how far the window reaches before the front of a person behind something; >= 0
  double behind_m = 0.4;       ///< how far the window reaches behind the front where no gap ends it; >= 0
  double first_gap_m = 0.15;   ///< nearest end of the window at a gap, behind the front; >= 0
  double last_gap_m = 0.6;     ///< farthest end of the window at a gap; >= first_gap_m
  double min_gap_m = 0.02;     ///< narrower gaps between two points end nothing; >= 0
  double short_m = 0.3;        ///< another end of the window, so far behind the front; >= 0
  double half_body_m = 0.05;   ///< the front stands so much before `previous_depth_m`; >= 0
  std::size_t min_points = 6;  ///< fewer valid depths: too_few_points; >= 1
};

inline namespace CFP_ISA {

[[nodiscard]] constexpr OptionPath invalid_field(const ForegroundOptions& o) noexcept {
  if (const OptionPath field = nested("adaptive", invalid_field(o.adaptive))) return field;
  if (!(o.near_share >= 0.0 && o.near_share < 1.0)) return "near_share";
  if (!(o.upper_share >= 0.0 && o.upper_share < 1.0)) return "upper_share";
  if (!detail::non_negative(o.obstacle_m)) return "obstacle_m";
  if (!detail::non_negative(o.before_m)) return "before_m";
  if (!detail::non_negative(o.behind_m)) return "behind_m";
  if (!detail::non_negative(o.first_gap_m)) return "first_gap_m";
  if (!(o.last_gap_m >= o.first_gap_m) || !is_finite(o.last_gap_m)) return "last_gap_m";
  if (!detail::non_negative(o.min_gap_m)) return "min_gap_m";
  if (!detail::non_negative(o.short_m)) return "short_m";
  if (!detail::non_negative(o.half_body_m)) return "half_body_m";
  if (o.min_points < 1) return "min_points";
  return {};
}

}  // namespace CFP_ISA

/// All but `ok` say that the depths cannot tell, and label every point with a valid depth foreground: the safe side, as
/// the paper gives foreground points of a moving person the probability 0.
enum class ForegroundStatus : std::uint8_t {
  ok,
  too_few_points,  ///< fewer valid depths than min_points
  no_cluster       ///< dbscan alone
};

[[nodiscard]] constexpr const char* to_string(ForegroundStatus status) noexcept {
  constexpr const char* names[] = {"ok", "too few points", "no cluster"};
  return status <= ForegroundStatus::no_cluster ? names[static_cast<int>(status)] : "unknown";
}

struct ForegroundResult {
  ForegroundStatus status = ForegroundStatus::too_few_points;
  double depth_m = 0;            ///< median of the foreground, for the next frame; 0 unless ok
  double near_m = 0, far_m = 0;  ///< nearest and farthest foreground depth; 0 without valid depths
  std::size_t foreground = 0;    ///< points labelled foreground, those without a valid depth not counted
  std::size_t background = 0;    ///< points labelled background, likewise
  std::size_t invalid = 0;       ///< points without a valid depth
  DbscanOptions dbscan;          ///< eps (m) and min_pts that the rule dbscan used
};

}  // namespace cfp
