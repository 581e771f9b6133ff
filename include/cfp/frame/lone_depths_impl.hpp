/// @file lone_depths_impl.hpp
/// Depths that no neighbours in the image share, for camera_motion.hpp. Not an interface.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"
#include "cfp/core/types.hpp"

namespace cfp::detail {

template <typename Scalar>
struct LoneDepthsWorkspace {
  struct Sample {  // of the depth image
    Scalar x, y, depth;
    int neighbours, alike;  // numbers of neighbours, and of those of about the same depth
    std::size_t pair;
  };
  std::vector<Sample> samples, by_cell;
  std::vector<std::size_t> cells;  // the first sample of each
};

inline namespace CFP_ISA {

/// Counts, in workspace.samples, neighbours at most `reach` away in x and y, and those of about the same depth. Samples
/// lie in a box of that size from the corner on. They are sorted into cells, so that it takes O(n) for some neighbours
/// each.
template <typename Scalar>
void count_neighbours(const Vector2<Scalar>& corner, const Vector2<Scalar>& size, Scalar reach, Scalar ratio,
                      LoneDepthsWorkspace<Scalar>& workspace) {
  auto& samples = workspace.samples;
  auto& first = workspace.cells;
  const Scalar side = (std::max)(reach, size.maxCoeff() / static_cast<Scalar>(samples.size()));
  const auto index = [&](Scalar offset) { return static_cast<std::size_t>(offset / side); };
  const std::size_t columns = index(size.x()) + 1, rows = index(size.y()) + 1;
  const auto column_of = [&](const auto& s) { return index(s.x - corner.x()); };
  const auto cell_of = [&](const auto& s) { return index(s.y - corner.y()) * columns + column_of(s); };
  first.assign(columns * (rows + 1) + 2, 0);  // with an empty row below
  for (const auto& s : samples) ++first[cell_of(s) + 2];
  std::partial_sum(first.begin(), first.end(), first.begin());
  workspace.by_cell.resize(samples.size());
  for (const auto& s : samples) workspace.by_cell[first[cell_of(s) + 1]++] = s;
  samples.swap(workspace.by_cell);
  const auto compare = [&](auto& a, std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      auto& b = samples[k];
      if (std::abs(a.x - b.x) > reach || std::abs(a.y - b.y) > reach) continue;
      const bool alike = std::abs(a.depth - b.depth) <= ratio * (std::min)(a.depth, b.depth);
      ++a.neighbours, ++b.neighbours;
      a.alike += alike ? 1 : 0, b.alike += alike ? 1 : 0;
    }
  };
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const std::size_t cell = cell_of(samples[k]), below = cell + columns, column = column_of(samples[k]);
    const std::size_t right = column + 1 < columns ? 2 : 1;
    compare(samples[k], k + 1, first[cell + right]);
    compare(samples[k], first[below - (column > 0 ? 1 : 0)], first[below + right]);
  }
}

/// Takes out of the points, by NaN, those whose depth no neighbours share (CameraMotionOptions::shared_depth_ratio);
/// 0 takes out none. Returns how many stay. A wrong depth may move a pair by less than its noise, so that no distance
/// tells it, and yet bend the motion: what seems far and moves makes a turn of a translation.
template <typename Scalar>
[[nodiscard]] std::size_t leave_out_lone_depths(const PointSpan<Scalar, 2>& pixels, Scalar ratio,
                                                span<std::array<Scalar, 3>> points,
                                                LoneDepthsWorkspace<Scalar>& workspace) {
  using Sample = typename LoneDepthsWorkspace<Scalar>::Sample;
  std::vector<Sample>& samples = workspace.samples;
  samples.clear();
  samples.reserve(pixels.size()), workspace.by_cell.reserve(pixels.size());
  workspace.cells.reserve(4 * pixels.size() + 8);  // more than any extent asks for
  const Scalar huge = std::numeric_limits<Scalar>::infinity();
  Vector2<Scalar> least(huge, huge), most = -least;
  Scalar nearest = huge, farthest = 0;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    if (!is_finite(points[i][0])) continue;
    samples.push_back({pixels(i, 0), pixels(i, 1), points[i][2], 0, 0, i});
    least = least.cwiseMin(pixels[i]), most = most.cwiseMax(pixels[i]);
    nearest = (std::min)(nearest, samples.back().depth), farthest = (std::max)(farthest, samples.back().depth);
  }
  const bool all_alike = farthest - nearest <= ratio * nearest;  // as all are where the motion is up to scale
  if (samples.empty() || ratio <= 0 || all_alike) return samples.size();
  const Vector2<Scalar> size = most - least;
  const Scalar reach = std::sqrt(Scalar(7) / 4 * size.prod() / static_cast<Scalar>(samples.size()));
  if (!(reach > 0) || !is_finite(reach)) return samples.size();
  count_neighbours(least, size, reach, ratio, workspace);
  const auto is_alone = [](const Sample& s) { return s.neighbours >= 2 && s.alike < 2; };
  const auto alone = static_cast<std::size_t>(std::count_if(samples.begin(), samples.end(), is_alone));
  if (3 * alone > samples.size()) return samples.size();
  for (const Sample& s : samples) {
    if (is_alone(s)) points[s.pair][0] = std::numeric_limits<Scalar>::quiet_NaN();
  }
  return samples.size() - alone;
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
