/// @file assignment.hpp
/// Gated minimum-cost assignment between rows and columns of a rectangular cost matrix (the Hungarian step of paper
/// IV-A).
///
/// One objective: minimise  sum of cost(i, j) over the pairs  +  max_cost * (min(rows, cols) - number of pairs).
/// Leaving a pair out costs `max_cost`, the gate. So a pair takes part only when its cost is below max_cost, and
/// two cheap pairs are never sacrificed for a third one that is not worth it. With a large gate (infinity is welcome)
/// the same objective means: as many pairs as possible, and among those matchings the cheapest.
#pragma once

#include <type_traits>
#include <utility>
#include <vector>

#include "cfp/core/span.hpp"
#include "cfp/core/status.hpp"

namespace cfp {

/// View of rows x cols costs, row after row. A cost that is NaN, infinite or beyond +-1e200 forbids its pair; negative
/// costs are welcome.
template <typename Scalar>
struct CostMatrix {
  span<const Scalar> values;
  std::size_t rows = 0;
  std::size_t cols = 0;

  CostMatrix(span<const Scalar> row_major, std::size_t row_count, std::size_t col_count) noexcept
      : values(row_major), rows(row_count), cols(col_count) {
    CFP_ASSERT(row_major.size() >= row_count * col_count);
  }
  [[nodiscard]] Scalar operator()(std::size_t row, std::size_t col) const noexcept { return values[row * cols + col]; }
};
template <typename C>
CostMatrix(const C&, std::size_t, std::size_t)
    -> CostMatrix<std::remove_cv_t<std::remove_pointer_t<decltype(std::declval<const C&>().data())>>>;

inline constexpr int unassigned = -1;  ///< the column of a row that stays alone

struct AssignmentResult {
  Status status = Status::ok;  ///< invalid_input: max_cost is NaN, and every row stays alone. An empty matrix is ok.
  std::size_t pairs = 0;
  double cost = 0;  ///< sum of the costs of the pairs
};

/// Grows to the largest problem seen, then allocates nothing. After a call `column_saving` is the dual solution, with
/// which cfp_testing/assignment_gap.hpp proves the optimum.
struct AssignmentWorkspace {
  std::vector<double> column_saving;  ///< b_j >= 0, one per column

  struct Visit {
    std::size_t row;
    int column;
    double distance, offset;
  };
  std::vector<double> costs, open_saving, distance;
  std::vector<int> row_of_column;
  std::vector<Visit> visits;
};

inline namespace CFP_ISA {

/// Fills column_of_row (size rows) with the optimal column of each row, or `unassigned`. Exact up to the rounding of
/// double.
///
/// Terminates on any input after at most rows * min(rows, cols + 1) * cols additions, whatever the costs hold.
/// Ties: equal input gives equal output; among equally cheap partners the one of the lower index is tried first.
/// Allocates only while the workspace grows.
///
/// Source: shortest augmenting paths with prices, R. Jonker and A. Volgenant, "A shortest augmenting path algorithm for
/// dense and sparse linear assignment problems", Computing 38, 1987. Departure: every row owns a dummy column of cost
/// max_cost, which makes the problem rectangular and gated by itself. The paper says "Hungarian algorithm" and neither
/// cost nor gate.
template <typename Scalar>
AssignmentResult solve_assignment(const CostMatrix<Scalar>& costs, double max_cost, AssignmentWorkspace& workspace,
                                  span<int> column_of_row);

}  // namespace CFP_ISA
}  // namespace cfp

#include "cfp/detection/assignment_impl.hpp"
