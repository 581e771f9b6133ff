/// @file fundamental_pairs_impl.hpp
/// Pairs of fundamental_ransac.hpp as structure of arrays, copies among them sharing their weight. Not an interface.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "cfp/core/types.hpp"
#include "cfp/geometry/point_pairs.hpp"
#include "cfp/robust/ransac_data_impl.hpp"

namespace cfp::detail {

// Coordinates are centred per image and scaled by one common factor, so that distances are pixels times `factor`. Pairs
// that begin or end in one cell share weight: copies, or mismatches that all end in one place, are no support. In the
// score they have the weight of three at most, as evidence that of one. A place may lie across the cells of one grid,
// so there are two, half a cell apart.
enum PairRow : std::size_t { prev_x, prev_y, cur_x, cur_y, score_weight, evidence_weight, own_weight, pair_rows };

struct PairArrays : RansacColumns<pair_rows> {
  static constexpr std::size_t enough = 256;       // pairs, to refine a candidate
  static constexpr std::size_t window_cells = 16;  // of the previous image, either way
  static constexpr std::size_t person_cells = 5;   // that somebody may be wide; as high as the image

  PairScaling scaling;
  double factor = 0;  // 0: the points of an image coincide, nothing else is set
  // Pitch of the cells by which places in the previous image are told apart, along either axis. Of the spread of the
  // points, so that in an image of 640 x 480 px full of them cells are squares of some 48 px.
  double window_pitch[2] = {1, 1};
  double grid_sq = 0;          // squared pitch of the grid that all coordinates lie on, scaled; 0 without one
  double total_shared = 0;     // sum of the weights in the score
  std::vector<float> thinned;  // see thinned_columns
  CellCounts cells[2][2];      // of either image, of either grid
};

inline namespace CFP_ISA {

// The rows up to score_weight in one precision.
template <typename T>
struct PairColumns {
  const T* row[5];
  std::size_t size;
};

template <typename T>
[[nodiscard]] PairColumns<T> pair_columns(const T* first, std::size_t length, std::size_t size) noexcept {
  return {{first, first + length, first + 2 * length, first + 3 * length, first + 4 * length}, size};
}
[[nodiscard]] inline PairColumns<double> exact_columns(const PairArrays& pairs) noexcept {
  return pair_columns(pairs.exact.data(), pairs.capacity, pairs.size);
}
[[nodiscard]] inline PairColumns<float> fast_columns(const PairArrays& pairs) noexcept {
  return pair_columns(pairs.fast.data(), pairs.capacity, pairs.size);
}
// Evenly chosen ones, or all where they are few; the number of the k-th of them.
[[nodiscard]] inline PairColumns<float> thinned_columns(const PairArrays& pairs) noexcept {
  constexpr std::size_t enough = PairArrays::enough;
  return pairs.size > enough ? pair_columns(pairs.thinned.data(), enough, enough) : fast_columns(pairs);
}
[[nodiscard]] inline std::size_t thinned_index(const PairArrays& pairs, std::size_t k) noexcept {
  return pairs.size > PairArrays::enough ? k * pairs.size / PairArrays::enough : k;
}

// What pair i is of a distinct one: an n-th, of n pairs that share their weight.
[[nodiscard]] inline double distinct_share(const PairArrays& pairs, std::size_t i) noexcept {
  return pairs.row(evidence_weight)[i] / pairs.weights()[i];
}

template <typename T>
[[nodiscard]] Vector3<T> previous_point(const PairArrays& pairs, std::size_t i) noexcept {
  return {pairs.row(prev_x)[i], pairs.row(prev_y)[i], T(1)};
}
template <typename T>
[[nodiscard]] Vector3<T> current_point(const PairArrays& pairs, std::size_t i) noexcept {
  return {pairs.row(cur_x)[i], pairs.row(cur_y)[i], T(1)};
}

// Column (axis 0) or row (1) of a place in the previous image; the outermost ones hold all beyond.
[[nodiscard]] inline std::size_t window_cell(const PairArrays& pairs, std::size_t axis, double along) noexcept {
  constexpr double middle = PairArrays::window_cells / 2;
  const double pitch = pairs.window_pitch[axis];
  return pitch > 0 ? static_cast<std::size_t>(std::clamp(along / pitch + middle, 0.0, 2 * middle - 0.01)) : 0;
}

// Enters every pair's point of one image, the first row of which is given, into both grids of cells of 1 /
// inverse_size. A centred point over no size at all is not a number: the order of the arguments sends it to the lower
// end.
inline void count_cells(const PairArrays& pairs, std::size_t row, double inverse_size,
                        CellCounts (&grids)[2]) noexcept {
  const auto half_cells = [&](double x) {
    return static_cast<std::uint64_t>((std::min)((std::max)(-1e9, 2 * x * inverse_size), 1e9) + 2e9);
  };
  for (std::size_t i = 0; i < pairs.size; ++i) {
    const std::uint64_t x = half_cells(pairs.row(row)[i]), y = half_cells(pairs.row(row + 1)[i]);
    for (std::size_t half = 0; half < 2; ++half) grids[half].enter(i, (x + half) / 2, (y + half) / 2);
  }
}

// Shares the weights among the pairs that begin in one cell, or end in one.
inline void share_weights(PairArrays& pairs, double cell_size) noexcept {
  for (std::size_t image = 0; image < 2; ++image) count_cells(pairs, 2 * image, 1 / cell_size, pairs.cells[image]);
  pairs.total_shared = 0;
  float* const fast = pairs.fast.data() + score_weight * pairs.capacity;
  for (std::size_t i = 0; i < pairs.size; ++i) {
    std::uint32_t most = 1;
    for (const auto& grids : pairs.cells) {
      for (const CellCounts& cells : grids) most = (std::max)(most, cells.beside(i));
    }
    const double n = most, w = pairs.weights()[i], shared = w * (std::min)(3 / n, 1.0);
    pairs.row(score_weight)[i] = shared, fast[i] = static_cast<float>(shared), pairs.row(evidence_weight)[i] = w / n;
    pairs.total_shared += shared;
  }
}

// The coarsest grid of 4 px to 1/4 px that all coordinates lie on; 0 without one.
template <typename Scalar>
[[nodiscard]] double grid_px(const PointPairs<Scalar>& input) {
  double px = 4;
  for_each_pair(input, [&](std::size_t, const Vector2<double>& previous, const Vector2<double>& current, double) {
    const auto off_grid = [&] {
      const Eigen::Array4d steps = Eigen::Array4d(previous.x(), previous.y(), current.x(), current.y()) / px;
      return (steps != steps.floor()).any();
    };
    while (px > 0 && off_grid()) px = px > 0.25 ? px / 2 : 0;
  });
  return px;
}

// cell_px: of the cells of PairArrays, > 0.
template <typename Scalar>
void load_pairs(const PointPairs<Scalar>& input, double cell_px, PairArrays& pairs) {
  pairs.scaling = scale_pairs(input);
  pairs.factor = 0;
  pairs.begin(input.previous.size());
  for (auto& grids : pairs.cells) {
    for (CellCounts& cells : grids) cells.begin(input.previous.size());
  }
  pairs.size = pairs.scaling.used;
  pairs.thinned.resize(5 * PairArrays::enough);
  if (!pairs.scaling.valid()) return;
  pairs.size = 0;
  pairs.factor = std::sqrt(pairs.scaling.previous.factor * pairs.scaling.current.factor);
  pairs.scaling.previous.factor = pairs.scaling.current.factor = pairs.factor;
  for_each_pair(input, [&](std::size_t i, const Vector2<double>& previous, const Vector2<double>& current, double w) {
    const Vector3<double> p = scaled(pairs.scaling.previous, previous), q = scaled(pairs.scaling.current, current);
    pairs.push(i, {p.x(), p.y(), q.x(), q.y(), w, w, w});
  });
  const double cells_of_spread[2] = {0.298, 0.396};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    double spread = 0;
    for (std::size_t i = 0; i < pairs.size; ++i) spread += std::abs(pairs.row(prev_x + axis)[i]);
    pairs.window_pitch[axis] = cells_of_spread[axis] * spread / static_cast<double>(pairs.size);
  }
  const double grid = grid_px(input) * pairs.factor;
  pairs.grid_sq = grid * grid;
  finish(pairs);
  share_weights(pairs, cell_px * pairs.factor);
  constexpr std::size_t enough = PairArrays::enough;
  for (std::size_t k = 0; k < 5 * enough && pairs.size > enough; ++k)
    pairs.thinned[k] = pairs.column<float>(k / enough)[thinned_index(pairs, k % enough)];
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
