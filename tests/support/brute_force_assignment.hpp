// The assignment oracle: every injective partial map of rows to columns is tried. For matrices up to about 7 x 7.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include "cfp/detection/assignment.hpp"

namespace cfp_test {

struct BestAssignment {
  std::size_t pairs = 0;
  double cost = 0;
};

namespace detail {
template <typename Scalar>
void try_row(const cfp::CostMatrix<Scalar>& costs, double max_cost, std::size_t row, std::vector<char>& used,
             BestAssignment now, bool most_pairs, BestAssignment& best) {
  if (row == costs.rows) {
    const bool better =
        now.pairs != best.pairs && most_pairs
            ? now.pairs > best.pairs
            : now.cost - best.cost < max_cost * (static_cast<double>(now.pairs) - static_cast<double>(best.pairs));
    if (better || (most_pairs && now.pairs == best.pairs && now.cost < best.cost)) best = now;
    return;
  }
  try_row(costs, max_cost, row + 1, used, now, most_pairs, best);
  for (std::size_t j = 0; j < costs.cols; ++j) {
    const double c = static_cast<double>(costs(row, j));
    if (used[j] || !(c < max_cost) || !(c >= -1e200 && c <= 1e200)) continue;
    used[j] = 1;
    try_row(costs, max_cost, row + 1, used, {now.pairs + 1, now.cost + c}, most_pairs, best);
    used[j] = 0;
  }
}
}  // namespace detail

/// The optimum of solve_assignment's objective; of several, one.
template <typename Scalar>
BestAssignment brute_force_assignment(const cfp::CostMatrix<Scalar>& costs, double max_cost) {
  BestAssignment best;
  std::vector<char> used(costs.cols, 0);
  detail::try_row(costs, max_cost, 0, used, {}, !(max_cost < std::numeric_limits<double>::infinity()), best);
  return best;
}

}  // namespace cfp_test
