/// @file pnp_crowd_impl.hpp
/// Observations of pnp_ransac.hpp that crowd in a part of the image: whether the support of a pose exceeds what
/// crowding alone gives, and how crowded observations share their weight. Not an interface.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "cfp/core/span.hpp"
#include "cfp/core/types.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/robust/pnp_observations_impl.hpp"
#include "cfp/robust/ransac_data_impl.hpp"

namespace cfp::detail {

inline namespace CFP_ISA {

// The squared distances from their projections of `count` evenly chosen observations, k in.size / count is the k-th.
inline void list_distances(const ObservationArrays& in, const SE3<double>& pose, std::size_t count,
                           std::vector<double>& squared) {
  squared.clear();
  for (std::size_t k = 0; k < count; ++k)
    squared.push_back(LinearReprojection<double>(in, pose, k * in.size / count).distance_sq);
}

// Makes of these distances the indices of those up to six thresholds; the inliers, counted, first.
inline std::size_t list_near(const ObservationArrays& in, double limit, std::vector<double>& list) {
  std::size_t inliers = 0, near = 0;
  for (std::size_t k = 0; k < list.size(); ++k) {
    const double squared = list[k];
    if (!(squared <= 36 * limit)) continue;
    list[near] = static_cast<double>(k * in.size / list.size());
    if (squared <= limit) std::swap(list[near], list[inliers++]);
    ++near;
  }
  list.resize(near);
  return inliers;
}

// Nats by which it is unlikely that as many of the observations listed are within the threshold, the first ones, if all
// of them exchanged their pixels: mismatches that crowd in a patch of the image lie near whatever is projected there.
// Of `most` evenly chosen ones, each with the pixels of up to 15 others; three fit by construction, and one pair more
// than counted is taken to fit.
[[nodiscard]] inline double exchange_nats(const ObservationArrays& in, const SE3<double>& pose, double limit,
                                          const std::vector<double>& list, std::size_t inliers, std::size_t most,
                                          bool weighed) noexcept {
  constexpr std::size_t others = 15;
  const std::size_t size = (std::min)(list.size(), most), step = (std::max)(size / (others + 1), std::size_t(1));
  const auto listed = [&](std::size_t k) { return k * list.size() / size; };
  const auto weight_of = [&](std::size_t i) { return weighed ? in.weights()[i] : 1.0; };
  double sum = 0, squares = 0, near = 0, near_pairs = 0, pairs = 0;
  for (std::size_t k = 0; k < size; ++k) {
    const auto i = static_cast<std::size_t>(list[listed(k)]);
    const double w = weight_of(i);
    sum += w, squares += w * w, near += listed(k) < inliers ? w : 0.0;
    const LinearReprojection<double> projected(in, pose, i);
    for (std::size_t d = 1; d <= others && d < size; ++d) {
      const auto j = static_cast<std::size_t>(list[listed((k + d * step) % size)]);
      const double dx = projected.x - in.row(ray_x)[j], dy = projected.y - in.row(ray_y)[j],
                   u = in.row(s11)[j] * dx + in.row(s12)[j] * dy, v = in.row(s22)[j] * dy;
      pairs += w * weight_of(j);
      if (u * u + v * v <= limit) near_pairs += w * weight_of(j);
    }
  }
  const double unit = squares / sum, one = unit * unit, chance = (near_pairs + one) / (pairs + one);
  return near > 0 ? binomial_nats(near / unit - 3, sum / unit - 3, chance) : 0.0;
}

// Where more than three pixels lie in one cell their weights become those of one. False where there is no such cell.
template <typename Scalar>
[[nodiscard]] bool share_weights(const PointSpan<Scalar, 2>& pixels, double cell_px, ObservationArrays& in,
                                 CellCounts& cells) {
  const auto cell = [&](Scalar px) {
    return static_cast<std::uint64_t>(std::clamp(static_cast<double>(px) / cell_px, -1e6, 1e6) + 2e6);
  };
  cells.begin(in.size);
  for (std::size_t i = 0; i < in.size; ++i) cells.enter(i, cell(pixels(in.index[i], 0)), cell(pixels(in.index[i], 1)));
  bool shared = false;
  for (std::size_t i = 0; i < in.size; ++i) {
    const std::uint32_t n = cells.beside(i);
    if (n > 3) in.row(observation_weight_row)[i] /= static_cast<double>(n), shared = true;
  }
  if (shared) finish(in);
  return shared;
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
