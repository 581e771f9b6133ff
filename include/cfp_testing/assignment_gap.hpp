/// @file assignment_gap.hpp
/// Checks a gated assignment (cfp/detection/assignment.hpp), whoever made it, against its optimum.
#pragma once

#include <algorithm>
#include <cstddef>

#include <Eigen/Core>

#include "cfp/detection/assignment.hpp"

namespace cfp_testing {

/// How far an assignment may be from the optimum: its objective minus a lower bound that holds by duality for any
/// `column_saving` (negative or NaN entries count as 0). 0, up to rounding, proves the optimum; the savings that
/// solve_assignment leaves in its workspace do. Infinite for an assignment that uses a column twice, a column that does
/// not exist, or a forbidden pair. O(rows * cols + cols^2); allocates nothing.
template <typename Scalar>
[[nodiscard]] double assignment_gap(const cfp::CostMatrix<Scalar>& costs, double max_cost,
                                    cfp::span<const int> column_of_row,
                                    cfp::span<const double> column_saving) noexcept {
  CFP_ASSERT(column_of_row.size() == costs.rows && column_saving.size() == costs.cols);
  if (!(max_cost == max_cost)) return cfp::detail::infinity;
  const Eigen::Map<const Eigen::Array<Scalar, Eigen::Dynamic, 1>> values(costs.values.data(),
                                                                         Eigen::Index(costs.rows * costs.cols));
  const auto allowed = values.unaryExpr([=](Scalar cost) { return cfp::detail::allowed_cost(cost, max_cost); });
  const double gate = cfp::detail::effective_gate(allowed, max_cost, (std::min)(costs.rows, costs.cols));
  const auto saving_of = [&](std::size_t i, std::size_t j) {
    return gate - cfp::detail::allowed_cost(costs(i, j), max_cost);
  };
  const auto price = [&](std::size_t j) { return column_saving[j] > 0 ? column_saving[j] : 0.0; };
  double gap = 0;  // weak duality: sum a_i + sum b_j >= saved, for a_i = max(0, max_j saving_ij - b_j)
  for (std::size_t j = 0; j < costs.cols; ++j) gap += price(j);
  for (std::size_t i = 0; i < costs.rows; ++i) {
    double row = 0;
    for (std::size_t j = 0; j < costs.cols; ++j) row = (std::max)(row, saving_of(i, j) - price(j));
    gap += row;
    const int j = column_of_row[i];
    if (j == cfp::unassigned) continue;
    if (j < 0 || static_cast<std::size_t>(j) >= costs.cols) return cfp::detail::infinity;
    if (std::find(column_of_row.begin(), column_of_row.begin() + i, j) != column_of_row.begin() + i)
      return cfp::detail::infinity;
    gap -= saving_of(i, static_cast<std::size_t>(j));  // +infinity for a forbidden pair
  }
  return gap;
}

}  // namespace cfp_testing
