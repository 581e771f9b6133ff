/// @file pair_points_impl.hpp
/// Flow pairs of known depth as points, and which of them to leave out, for camera_motion.hpp. Not an interface.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"
#include "cfp/frame/point_grid_impl.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/geometry/flow_pairs.hpp"
#include "cfp/math/order_statistic.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

/// The pairs marked in `outside` whose depth is valid, as points of the previous camera; the others as NaN.
template <typename Scalar>
void place_points(const FlowPairs<Scalar>& flow, span<const char> outside, const PinholeCamera<Scalar>& camera,
                  std::vector<std::array<Scalar, 3>>& points) {
  const Scalar nowhere = std::numeric_limits<Scalar>::quiet_NaN();
  points.assign(outside.size(), {nowhere, nowhere, nowhere});
  for (std::size_t i = 0; i < flow.previous_depths.size(); ++i) {
    const Scalar z = flow.previous_depths[i];
    Vector3<Scalar> ray;
    if (outside[i] == 0 || !is_valid_depth(z) || !camera.unproject(flow.previous[i], ray)) continue;
    points[i] = {ray.x() * z, ray.y() * z, z};
  }
}

/// The depth that the given share of the points do not exceed. At least one point must be finite.
template <typename Scalar>
[[nodiscard]] Scalar depth_at_share(const std::vector<std::array<Scalar, 3>>& points, double share,
                                    std::vector<Scalar>& depths) {
  depths.clear();
  for (const auto& point : points) {
    if (is_finite(point[0])) depths.push_back(point[2]);
  }
  return quantile(span<Scalar>(depths), share);
}

/// Sets points of isolated depth (CameraMotionOptions::shared_depth_ratio) to NaN; 0: none. Returns how many remain. A
/// wrong depth may displace a pair by less than its noise, so that it is no outlier by its distance, and yet bias the
/// motion: a near point whose depth is taken for far makes a translation look like a rotation.
template <typename Scalar>
[[nodiscard]] std::size_t leave_out_lone_depths(const PointSpan<Scalar, 2>& pixels, Scalar ratio,
                                                span<std::array<Scalar, 3>> points, PointGrid<Scalar>& grid) {
  const auto takes_part = [&](std::size_t i) { return is_finite(points[i][0]); };
  fill_grid(pixels, takes_part, Scalar(0), grid, true);  // the reach follows from the extent of the cells
  const std::size_t taken = grid.points.size();
  Scalar nearest = std::numeric_limits<Scalar>::infinity(), farthest = 0;
  for (const auto& point : grid.points) {
    const Scalar depth = points[point.index][2];
    nearest = (std::min)(nearest, depth), farthest = (std::max)(farthest, depth);
  }
  const bool all_alike = farthest - nearest <= ratio * nearest;  // as all are where the motion is up to scale
  grid.reach = std::sqrt(Scalar(7) / 4 * (grid.width * grid.height) / static_cast<Scalar>(taken));
  if (taken == 0 || ratio <= 0 || all_alike || !(grid.reach > 0) || !is_finite(grid.reach)) return taken;
  auto& alone = grid.unsorted;
  alone.clear();
  for (const auto& point : grid.points) {
    const Scalar depth = points[point.index][2];
    int neighbours = -1, alike = -1;  // itself is none
    visit_near(grid, point.x, point.y, [&](const auto& other) {
      if (std::abs(other.x - point.x) > grid.reach || std::abs(other.y - point.y) > grid.reach) return false;
      const Scalar its = points[other.index][2];
      ++neighbours;
      alike += std::abs(depth - its) <= ratio * (std::min)(depth, its) ? 1 : 0;
      return alike >= 2;
    });
    if (neighbours >= 2 && alike < 2) alone.push_back(point);
  }
  if (8 * alone.size() > 3 * taken) return taken;
  for (const auto& point : alone) points[point.index][0] = std::numeric_limits<Scalar>::quiet_NaN();
  return taken - alone.size();
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
