/// @file place_odds.hpp
/// Where the points lie in their box, a second axis beside their depth: as a person's do, and in its upper half.
#pragma once

#include <algorithm>
#include <vector>

#include "cfp/clustering/adaptive.hpp"
#include "cfp/clustering/sorted_values.hpp"
#include "cfp/core/span.hpp"
#include "cfp/geometry/box.hpp"

namespace cfp::detail {
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

}  // namespace CFP_ISA
}  // namespace cfp::detail
