/// @file point_grid_impl.hpp
/// Points of an image in cells, to find those near a place. Not an interface.
#pragma once

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
#include <vector>

#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"
#include "cfp/core/types.hpp"
#include "cfp/math/order_statistic.hpp"

namespace cfp::detail {

/// Memory of a grid, reused: after points, at most as many allocate nothing.
template <typename Scalar>
struct PointGrid {
  struct Point {
    Scalar x, y;
    std::uint32_t index;  // in what the grid was made of
  };
  std::vector<Point> points;                                   // by cell, row by row; of one cell by index
  std::vector<Point> unsorted;                                 // while the grid is filled; free afterwards
  std::vector<std::uint32_t> first;                            // of each cell
  std::array<Scalar, 2> low = {}, high = {};                   // of the points
  Scalar left = 0, top = 0, width = 0, height = 0, reach = 0;  // of the cells, but for what the outermost hold beyond
  Scalar columns_per_px = 0, rows_per_px = 0;

  static constexpr std::size_t side = 32;  // columns, and rows
};

inline namespace CFP_ISA {

/// Where value(0) to value(n - 1) lie, but at most a quarter beyond the middle nine tenths of a sample of them: a pair
/// far beside the image, or at the rim of a fisheye, has no say in it, nor has what is not finite. 0 to 0 of nothing.
template <typename Scalar, typename Value>
[[nodiscard]] std::array<Scalar, 2> extent_of_most(std::size_t n, const Value& value) noexcept {
  std::array<Scalar, 128> sample;
  const std::size_t most = (std::min)(n, sample.size());
  std::size_t used = 0;
  Scalar low = std::numeric_limits<Scalar>::infinity(), high = -low;
  for (std::size_t i = 0, k = 0; i < n; ++i) {
    const Scalar at = value(i);
    if (is_finite(at)) low = (std::min)(low, at), high = (std::max)(high, at);
    if (i != k * n / most) continue;
    sample[used] = at;
    used += is_finite(at) ? 1U : 0U;
    ++k;
  }
  const span<Scalar> values(sample.data(), used);
  if (used == 0) return {0, 0};
  const Scalar left = quantile(values, 0.05), right = quantile(values, 0.95), margin = (right - left) / 4;
  return {(std::max)(low, left - margin), (std::min)(high, right + margin)};
}

/// Which column or row a place lies in; the outermost ones hold all beyond, and no number lies in the first.
template <typename Scalar>
[[nodiscard]] std::size_t cell_at(Scalar offset, Scalar cells_per_px) noexcept {
  constexpr Scalar last = PointGrid<Scalar>::side - 1;
  return static_cast<std::uint32_t>((std::min)((std::max)(Scalar(0), offset * cells_per_px), last));
}

/// Puts those of the points for which `keep(index)` holds, all finite, into cells over the extent of all of them or,
/// `over_most`, of most. Later `reach` is how near is near.
template <typename Scalar, typename Keep>
void fill_grid(const PointSpan<Scalar, 2>& points, const Keep& keep, Scalar reach, PointGrid<Scalar>& grid,
               bool over_most = false) {
  const std::size_t most = points.size();
  grid.points.reserve(most), grid.unsorted.reserve(most);
  grid.unsorted.clear();
  const Scalar huge = std::numeric_limits<Scalar>::infinity();
  Vector2<Scalar> low(huge, huge), high = -low;
  for (std::size_t i = 0; i < most; ++i) {
    if (!keep(i)) continue;
    grid.unsorted.push_back({points(i, 0), points(i, 1), static_cast<std::uint32_t>(i)});
    low = low.cwiseMin(points[i]), high = high.cwiseMax(points[i]);
  }
  constexpr std::size_t side = PointGrid<Scalar>::side;
  grid.low = {low.x(), low.y()}, grid.high = {high.x(), high.y()};
  std::array<Scalar, 2> x = {low.x(), high.x()}, y = {low.y(), high.y()};
  if (over_most) {
    x = extent_of_most<Scalar>(grid.unsorted.size(), [&](std::size_t i) { return grid.unsorted[i].x; });
    y = extent_of_most<Scalar>(grid.unsorted.size(), [&](std::size_t i) { return grid.unsorted[i].y; });
  }
  grid.left = x[0], grid.top = y[0], grid.width = x[1] - x[0], grid.height = y[1] - y[0], grid.reach = reach;
  grid.columns_per_px = Scalar(side) / grid.width, grid.rows_per_px = Scalar(side) / grid.height;
  const auto cell = [&](const auto& p) {
    return cell_at(p.y - grid.top, grid.rows_per_px) * side + cell_at(p.x - grid.left, grid.columns_per_px);
  };
  grid.first.assign(side * side + 2, 0);
  for (const auto& p : grid.unsorted) ++grid.first[cell(p) + 2];
  std::partial_sum(grid.first.begin(), grid.first.end(), grid.first.begin());
  grid.points.resize(grid.unsorted.size());
  for (const auto& p : grid.unsorted) grid.points[grid.first[cell(p) + 1]++] = p;
}

/// Calls visit(point) for the points of the cells that hold what is at most the reach away in x and in y, until it
/// returns true.
template <typename Scalar, typename Visit>
CFP_INLINE void visit_near(const PointGrid<Scalar>& grid, Scalar x, Scalar y, const Visit& visit) {
  const Scalar from_left = x - grid.left, from_top = y - grid.top;
  if (!(x >= grid.low[0] - grid.reach && x <= grid.high[0] + grid.reach && y >= grid.low[1] - grid.reach &&
        y <= grid.high[1] + grid.reach))
    return;
  const auto column = [&](Scalar offset) { return cell_at(from_left + offset, grid.columns_per_px); };
  const auto row = [&](Scalar offset) { return cell_at(from_top + offset, grid.rows_per_px); };
  const std::size_t left = column(-grid.reach), right = column(grid.reach), bottom = row(grid.reach);
  for (std::size_t r = row(-grid.reach); r <= bottom; ++r) {
    const auto* const end = grid.points.data() + grid.first[r * grid.side + right + 1];
    for (const auto* p = grid.points.data() + grid.first[r * grid.side + left]; p != end; ++p) {
      if (visit(*p)) return;
    }
  }
}

/// The index of the nearest point that lies less than the reach from (x, y) and for which take(point) holds, the first
/// of several; `none` without one.
template <typename Scalar, typename Take>
[[nodiscard]] std::size_t nearest(const PointGrid<Scalar>& grid, Scalar x, Scalar y, std::size_t none,
                                  const Take& take) {
  Scalar nearest_sq = grid.reach * grid.reach;
  std::size_t index = none;
  visit_near(grid, x, y, [&](const auto& p) {
    const Scalar dx = p.x - x, dy = p.y - y, apart_sq = dx * dx + dy * dy;
    if (apart_sq < nearest_sq && take(p)) nearest_sq = apart_sq, index = p.index;
    return false;
  });
  return index;
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
