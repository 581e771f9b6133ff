/// @file image_parts_impl.hpp
/// Which parts of the image ask for another motion of the camera than the rest. What moves slowly and lies in no box
/// bends the motion until none of its pairs stands out; together they still pull more than noise does. Not an
/// interface.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "cfp/core/types.hpp"
#include "cfp/frame/point_grid_impl.hpp"
#include "cfp/math/normal_equations.hpp"
#include "cfp/math/uncertain_motion.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

/// For local use: alignment depends on flags.
struct ImagePart {
  NormalEquations<6> equations;  // of its pairs at a motion
  Vector6<double> own_step;      // from there to the motion of its pairs alone
  bool counts = true;

  /// Sets own_step, damped where its pairs do not tell; a part of which nothing can be had does not count.
  void solve() noexcept { counts = solve_normal_equations<6>(equations.H, equations.g, 1e-3, 0, own_step); }

  /// The squared Mahalanobis distance of the motion at `step` from its own.
  [[nodiscard]] double pull_sq(const Vector6<double>& step) const noexcept {
    const Vector6<double> apart = step - own_step;
    double sum = 0;
    for (int r = 0; r < 6; ++r) {
      for (int c = r; c < 6; ++c) sum += (c > r ? 2 : 1) * apart[r] * equations.H(r, c) * apart[c];
    }
    return sum;
  }
};

/// 4 x 4 parts of a grid. For local use: alignment depends on flags.
struct ImageParts {
  static constexpr std::size_t side = 4;
  std::array<ImagePart, side * side> parts;

  template <typename Scalar>
  [[nodiscard]] ImagePart& at(const PointGrid<Scalar>& grid, const typename PointGrid<Scalar>::Point& point) noexcept {
    constexpr std::size_t cells = PointGrid<Scalar>::side / side;
    const std::size_t row = cell_at(point.y - grid.top, grid.rows_per_px) / cells;
    return parts[row * side + cell_at(point.x - grid.left, grid.columns_per_px) / cells];
  }

  /// Leaves out the part that pulls most at what those that count agree to, until none pulls by more than one in a
  /// thousand, or a quarter are left out. `step` goes there from the motion, taken for what all agree to. False where
  /// all count.
  [[nodiscard]] bool leave_out_moving(Vector6<double>& step) noexcept {
    NormalEquations<6> rest;
    step.setZero();
    for (ImagePart& part : parts) {
      part.solve();
      if (part.counts) rest.H += part.equations.H;
    }
    const auto pull_sq = [&](const ImagePart& part) { return part.counts ? part.pull_sq(step) : 0; };
    const auto pulls_less = [&](const ImagePart& a, const ImagePart& b) { return pull_sq(a) < pull_sq(b); };
    std::size_t left_out = 0;
    for (; 4 * left_out < parts.size(); ++left_out) {
      ImagePart* const most = std::max_element(parts.begin(), parts.end(), pulls_less);
      if (!(pull_sq(*most) > most_motion_distance_sq)) break;
      rest.H -= most->equations.H, rest.g -= most->equations.g;
      Vector6<double> next;
      if (!solve_normal_equations<6>(rest.H, rest.g, 0, 1e-14, next)) break;
      most->counts = false, step = next;
    }
    return left_out > 0;
  }
};

}  // namespace CFP_ISA
}  // namespace cfp::detail
