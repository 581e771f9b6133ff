/// @file depth_foreground.hpp
/// Which keypoints of a person's box lie on the person and which behind or in front (paper IV-C): by the depth window
/// whose points are placed in the box as those of people are or, as printed, by clustering the depths. Depths in
/// metres, one call per box.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "cfp/clustering/adaptive.hpp"
#include "cfp/clustering/dbscan.hpp"
#include "cfp/clustering/depth_foreground_types.hpp"
#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"
#include "cfp/geometry/box.hpp"

namespace cfp {

/// Grows to the largest box seen, then allocates nothing.
template <typename Scalar>
struct ForegroundWorkspace : DbscanWorkspace<Scalar> {
  std::vector<double> odds;

  void reserve(std::size_t n) { DbscanWorkspace<Scalar>::reserve(n), odds.reserve(n + 1); }
};

namespace detail {
inline namespace CFP_ISA {

// sums[i]: log odds that people cover the places of the i nearest points, so that of two ranges of depths the one with
// the larger sum is the likelier person if the places are independent. How often people of all postures cover a place
// of their box is a logistic function: high in the middle column, low at the sides and beside the head (fitted to
// benchmarks/support/person_scene.hpp). Zeros when the places are not known.
template <typename Scalar>
void sum_place_odds(const PointSpan<Scalar, 2>& pixels, const Box<Scalar>& box, span<const std::uint32_t> order,
                    std::vector<double>& sums) {
  sums.assign(order.size() + 1, 0.0);
  if (pixels.empty() || !is_proper(box)) return;
  for (std::size_t i = 0; i < order.size(); ++i) {
    const double across = 2 * static_cast<double>((pixels(order[i], 0) - box.x1) / box.width()) - 1;
    const double down = static_cast<double>((pixels(order[i], 1) - box.y1) / box.height());
    sums[i + 1] = sums[i] + 1.7 - 3.5 * across * across - 3 * (std::max)(0.0, 1 - 4 * down);
  }
}

// The depth at `upper_share` of the points in the upper half of the box; 0 for fewer than eight, or unknown places.
template <typename Scalar>
[[nodiscard]] double front_of_upper_half(const PointSpan<Scalar, 2>& pixels, const Box<Scalar>& box,
                                         const SortedValues<Scalar>& sorted, double upper_share) noexcept {
  if (pixels.empty() || !is_proper(box)) return 0;
  const Scalar middle = (box.y1 + box.y2) / Scalar(2);
  const auto upper = [&](std::uint32_t i) { return pixels(i, 1) < middle; };
  const auto count = static_cast<std::size_t>(std::count_if(sorted.index.begin(), sorted.index.end(), upper));
  if (count < 8) return 0;
  std::size_t left = position_of_share(upper_share, count), i = 0;
  for (; !upper(sorted.index[i]) || left > 0; ++i) left -= upper(sorted.index[i]) ? 1U : 0U;
  return static_cast<double>(sorted.values[i]);
}

// Positions [first, last) of the ascending depths.
struct DepthRange {
  std::size_t first, last;
};

// The window of a front. A gap of many points is what few of them lie in, as flying pixels bridge the empty ones: it
// may be the narrower the more they are, but is twice what they take where the window is filled evenly. More than a few
// points lie behind it: every tail is thin.
template <typename Scalar>
[[nodiscard]] DepthRange depth_window(span<const Scalar> depths, double front, double before_m,
                                      const ForegroundOptions& o) noexcept {
  const auto depth = [&](std::size_t i) { return static_cast<double>(depths[i]); };
  const auto nearer_than = [&](double z) {
    return static_cast<std::size_t>(std::lower_bound(depths.begin(), depths.end(), z) - depths.begin());
  };
  const auto up_to = [&](double z) {
    return static_cast<std::size_t>(std::upper_bound(depths.begin(), depths.end(), z) - depths.begin());
  };
  const std::size_t n = depths.size(), stride = 1 + n / 150, few = n / 50;
  const std::size_t first = nearer_than(front - before_m), begin = nearer_than(front),
                    end = up_to(front + o.last_gap_m);
  const double even_m = end > begin ? (depth(end - 1) - depth(begin)) / static_cast<double>(end - begin) : 0;
  const auto points = static_cast<double>(stride);
  double widest = (std::max)(o.min_gap_m / std::sqrt(points), 2 * even_m * points);
  std::size_t end_at_gap = 0;
  for (std::size_t i = (std::max)(first + 1, nearer_than(front + o.first_gap_m)) - 1; i < end && i + stride + few < n;
       ++i) {
    const double gap = depth(i + stride) - depth(i);
    if (!(gap > widest)) continue;
    widest = gap;
    end_at_gap = i + 1;  // before the widest gap between two neighbours: of equal depths all or none
    for (std::size_t next = i + 1; next < i + stride; ++next) {
      if (depth(next + 1) - depth(next) > depth(end_at_gap) - depth(end_at_gap - 1)) end_at_gap = next + 1;
    }
  }
  if (end_at_gap > 0) return {first, end_at_gap};
  return {first, (std::max)(first, (std::min)(end, up_to(front + o.behind_m)))};
}

// The reaches of the window as depths see them whose noise has this standard deviation.
[[nodiscard]] inline ForegroundOptions seen_through(double sigma_m, ForegroundOptions o) noexcept {
  if (!is_finite(sigma_m)) return o;
  for (double* const reach_m :
       {&o.obstacle_m, &o.before_m, &o.behind_m, &o.first_gap_m, &o.last_gap_m, &o.short_m, &o.half_body_m})
    *reach_m = std::hypot(*reach_m, 3 * sigma_m);
  return o;
}

template <typename Scalar>
[[nodiscard]] DepthRange person_range(const ForegroundInput<Scalar>& in, const SortedValues<Scalar>& sorted,
                                      const ForegroundOptions& options, std::vector<double>& odds) {
  const span<const Scalar> depths = sorted.values;
  const std::size_t n = depths.size(), near = position_of_share(options.near_share, n);
  const double nearest = static_cast<double>(depths[near]);
  const ForegroundOptions o = seen_through(in.depth_noise.sigma_m(nearest), options);
  sum_place_odds(in.pixels, in.box, sorted.index, odds);
  DepthRange best{0, n};
  double most = -1e300;
  // `bonus`: log odds per point by which this window may fall behind the others; a shorter one must be ahead by 0.1.
  const auto offer = [&](double front, double before_m, std::size_t least, double bonus) {
    DepthRange range = depth_window(depths, front, before_m, o);
    for (int shorter = 0; shorter < 2 && range.last > range.first + least; ++shorter) {
      const double found = (odds[range.last] - odds[range.first]) / static_cast<double>(n) + bonus - shorter * 0.1;
      if (found > most) most = found, best = range;
      while (range.last > range.first && static_cast<double>(depths[range.last - 1]) > front + o.short_m) --range.last;
    }
  };
  if (is_valid_depth(in.previous_depth_m))
    offer(static_cast<double>(in.previous_depth_m) - o.half_body_m, o.before_m, near, 0.1);
  offer(nearest, nearest, 0, 0.05);
  const double upper = front_of_upper_half(in.pixels, in.box, sorted, o.upper_share);
  if (upper > nearest + o.obstacle_m) offer(upper, o.before_m, 0, 0);
  return best;
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// mask[i] = 1 for foreground, 0 for background, by two cuts in depth.
/// The person's front may stand at `previous_depth_m`, if the window there holds more than `near_share` of the points;
/// where the upper half of the box begins, if that is `obstacle_m` farther (a desk hides the legs); or at the depth
/// that the nearest `near_share` reach, and then all that is nearer is the person's (an arm), else what is up to
/// `before_m` nearer. The window ends at the widest gap between `first_gap_m` and `last_gap_m` behind the front that
/// has more than a fiftieth of the points behind it; without a gap that is clear of noise and of evenly spread points,
/// `behind_m` behind it; or `short_m` behind it. The window whose points are placed most like a person's is taken
/// (sum_place_odds); without pixels the previous, else the nearest. Points without a valid depth are not used and count
/// as foreground, the safe side. O(n log n); deterministic; permuting the points permutes the mask; allocates only when
/// the workspace grows. Departure from the paper, which clusters: a window is better on every kind of scene of
/// foreground_study.
template <typename Scalar>
ForegroundResult depth_foreground(const ForegroundInput<non_deduced<Scalar>>& in, const ForegroundOptions& options,
                                  ForegroundWorkspace<Scalar>& workspace, span<char> mask) {
  CFP_ASSERT(mask.size() == in.depths_m.size() && detail::fits(in.depths_m.size(), in.pixels));
  const SortedValues<Scalar> sorted = sort_values(
      in.depths_m, [](Scalar depth) { return is_valid_depth(depth); }, workspace);
  const span<const Scalar> depths = sorted.values;
  const std::size_t n = depths.size();
  ForegroundResult result;
  result.invalid = in.depths_m.size() - n;
  std::fill(mask.begin(), mask.end(), char(1));

  detail::DepthRange range{0, n};
  if (n > 0 && n >= options.min_points) {
    if (options.rule == ForegroundRule::depth_window) {
      range = detail::person_range<Scalar>(in, sorted, options, workspace.odds);
    } else {
      result.dbscan = adaptive_options(depths, options.adaptive, workspace);
      workspace.labels.resize(n);
      dbscan_sorted(depths, result.dbscan, workspace, workspace.labels);
      const auto after_first = std::find(workspace.labels.rbegin(), workspace.labels.rend(), 0).base();
      range = {0, static_cast<std::size_t>(after_first - workspace.labels.begin())};
    }
    result.status = range.last > range.first ? ForegroundStatus::ok : ForegroundStatus::no_cluster;
    if (range.last <= range.first) range = {0, n};
  }
  for (std::size_t i = 0; i < n; ++i) mask[sorted.index[i]] = i >= range.first && i < range.last ? char(1) : char(0);
  result.foreground = range.last - range.first;
  result.background = n - result.foreground;
  if (n == 0) return result;
  result.near_m = static_cast<double>(depths[range.first]);
  result.far_m = static_cast<double>(depths[range.last - 1]);
  if (result.status == ForegroundStatus::ok)
    result.depth_m = static_cast<double>(depths[(range.first + range.last) / 2]);
  return result;
}

}  // namespace CFP_ISA
}  // namespace cfp
