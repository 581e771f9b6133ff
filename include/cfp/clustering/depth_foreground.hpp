/// @file depth_foreground.hpp
/// Which keypoints of a person's box lie on the person and which on what is behind (paper IV-C, "DBSCAN density
/// clustering algorithm"): depth clustering, then the nearest layer. Depths in metres, one call per box.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cfp/clustering/adaptive.hpp"
#include "cfp/clustering/dbscan.hpp"
#include "cfp/clustering/sorted_values.hpp"
#include "cfp/core/assert.hpp"
#include "cfp/core/numeric.hpp"
#include "cfp/core/options.hpp"
#include "cfp/core/span.hpp"

namespace cfp {

struct ForegroundOptions {
  AdaptiveOptions adaptive;
  double merge_gap_m = 0.2;  ///< a cluster that begins so near behind the foreground and ends within body_depth_m joins
                             ///< it; >= 0, 0: none
  std::size_t min_points = 6;    ///< fewer valid depths: too_few_points; >= 1
  std::size_t sure_points = 18;  ///< with fewer valid depths the split must also hold for a smaller and a larger eps
  bool invalid_is_foreground = true;  ///< label of points without a valid depth: true is the safe side
};

[[nodiscard]] constexpr OptionPath invalid_field(const ForegroundOptions& options) noexcept {
  if (const OptionPath field = nested("adaptive", invalid_field(options.adaptive))) return field;
  if (!detail::non_negative(options.merge_gap_m)) return "merge_gap_m";
  if (options.min_points < 1) return "min_points";
  return {};
}

/// Every way of ending but `ok` says that the depths cannot tell, and labels every point with a valid depth foreground:
/// the safe side, as the paper gives foreground points of a moving person the probability 0.
enum class ForegroundStatus : std::uint8_t {
  ok,
  too_few_points,  ///< fewer valid depths than min_points
  no_cluster,      ///< no cluster reaches past the minimum share of the points
  unstable         ///< few points, and a slightly smaller or larger eps splits them elsewhere
};

[[nodiscard]] constexpr const char* to_string(ForegroundStatus status) noexcept {
  switch (status) {
    case ForegroundStatus::ok:
      return "ok";
    case ForegroundStatus::too_few_points:
      return "too few points";
    case ForegroundStatus::no_cluster:
      return "no cluster";
    case ForegroundStatus::unstable:
      return "unstable";
  }
  return "unknown";
}

struct ForegroundResult {
  ForegroundStatus status = ForegroundStatus::too_few_points;
  DbscanOptions dbscan;  ///< eps (m) and min_pts that were used
  std::size_t clusters = 0;
  std::size_t foreground = 0;    ///< points labelled foreground, those without a valid depth not counted
  std::size_t background = 0;    ///< points labelled background, likewise
  std::size_t invalid = 0;       ///< points without a valid depth
  double near_m = 0, far_m = 0;  ///< nearest and farthest foreground depth; 0 without valid depths
};

/// Grows to the largest box seen, then allocates nothing.
template <typename Scalar>
struct ForegroundWorkspace {
  DbscanWorkspace<Scalar> dbscan;
  std::vector<int> labels;
};

namespace detail {
inline namespace CFP_ISA {

// How many of the ascending depths belong to the foreground under these parameters; 0 for none.
template <typename Scalar>
std::size_t foreground_count(span<const Scalar> depths, const DbscanOptions& parameters,
                             const ForegroundOptions& options, ForegroundWorkspace<Scalar>& workspace,
                             std::size_t& clusters) {
  const std::size_t n = depths.size();
  workspace.labels.resize(n);
  clusters = dbscan_sorted(depths, parameters, workspace.dbscan, span<int>(workspace.labels)).clusters;
  const std::size_t at = foreground_position(n, options.adaptive);
  const double limit = static_cast<double>(depths[at]) + options.adaptive.body_depth_m;
  std::size_t count = 0;  // up to the end of the last cluster taken
  for (std::size_t i = 0; i < n;) {
    if (workspace.labels[i] == dbscan_noise) {
      ++i;
      continue;
    }
    std::size_t end = i + 1;
    for (std::size_t j = end; j < n && workspace.labels[j] <= workspace.labels[i]; ++j) {
      if (workspace.labels[j] == workspace.labels[i]) end = j + 1;
    }
    const bool enough = count > at;
    if (enough && !(static_cast<double>(depths[i]) - static_cast<double>(depths[count - 1]) <= options.merge_gap_m &&
                    static_cast<double>(depths[end - 1]) <= limit)) {
      break;
    }
    count = end;
    i = end;
  }
  return count > at ? count : 0;
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// mask[i] = 1 for foreground, 0 for background. Clusters the valid depths (finite, > 0) with `adaptive_options`. The
/// foreground ends where the first cluster ends that reaches past the nearest `adaptive.min_share` of the points; a
/// cluster that begins within `merge_gap_m` behind it, and ends within `adaptive.body_depth_m` of the foreground's
/// depth, joins it; everything nearer goes with it, smaller clusters (a hand) and noise (flying pixels at silhouettes)
/// alike. The result is a cut in depth. Fewer than `sure_points` valid depths: the split is repeated with eps x 0.7 and
/// x 1.4, and unless both agree to within one point in ten, the status is `unstable`. One cluster only is `ok`:
/// everything is foreground because it is one layer. Points without a valid depth take no part and get the label
/// `invalid_is_foreground` says, whatever the status. O(n log n), in practice O(n); deterministic; permuting the points
/// permutes the mask; allocates only when the workspace grows. Departures from the paper, which takes the cluster of
/// the lowest mean depth (dbscan_study shows what they bring): the minimum share, for without it a tiny near cluster
/// wins; and joining, for plain clothes leave gaps in a body.
template <typename Scalar>
ForegroundResult depth_foreground(span<const non_deduced<Scalar>> depths_m, const ForegroundOptions& options,
                                  ForegroundWorkspace<Scalar>& workspace, span<char> mask) {
  CFP_ASSERT(mask.size() == depths_m.size());
  const SortedValues<Scalar> sorted = sort_values(
      depths_m, [](Scalar depth) { return is_valid_depth(depth); }, workspace.dbscan.sort);
  const span<const Scalar> depths = sorted.values;
  const std::size_t n = depths.size();
  ForegroundResult result;
  result.invalid = depths_m.size() - n;
  std::fill(mask.begin(), mask.end(), options.invalid_is_foreground ? char(1) : char(0));

  std::size_t count = 0;
  if (n >= options.min_points && n > 0) {
    result.dbscan = adaptive_options(depths, options.adaptive, workspace.dbscan);
    count = detail::foreground_count(depths, result.dbscan, options, workspace, result.clusters);
    result.status = count > 0 ? ForegroundStatus::ok : ForegroundStatus::no_cluster;
    if (count > 0 && n < options.sure_points) {
      for (const double factor : {0.7, 1.4}) {
        std::size_t clusters = 0;
        const std::size_t other = detail::foreground_count(depths, {result.dbscan.eps * factor, result.dbscan.min_pts},
                                                           options, workspace, clusters);
        if (10 * (other > count ? other - count : count - other) > n) result.status = ForegroundStatus::unstable;
      }
    }
  }
  if (result.status != ForegroundStatus::ok) count = n;
  for (std::size_t i = 0; i < n; ++i) mask[sorted.index[i]] = i < count ? char(1) : char(0);
  result.foreground = count;
  result.background = n - count;
  if (count > 0) {
    result.near_m = static_cast<double>(depths[0]);
    result.far_m = static_cast<double>(depths[count - 1]);
  }
  return result;
}

}  // namespace CFP_ISA
}  // namespace cfp
