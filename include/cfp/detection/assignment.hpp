/// @file assignment.hpp
/// Gated minimum-cost assignment between rows and columns of a rectangular cost matrix (the Hungarian step of paper
/// IV-A).
///
/// One objective: minimise  sum of cost(i, j) over the pairs  +  max_cost * (min(rows, cols) - number of pairs).
/// Leaving a pair out costs `max_cost`, the gate. So a pair takes part only when its cost is below max_cost, and
/// two cheap pairs are never sacrificed for a third one that is not worth it. With a large gate (infinity is welcome)
/// the same objective means: as many pairs as possible, and among those matchings the cheapest.
#pragma once

#include <algorithm>
#include <limits>
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
CostMatrix(const C&, std::size_t, std::size_t) -> CostMatrix<range_value_t<C>>;

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

namespace detail {
inline namespace CFP_ISA {

inline constexpr double infinity = std::numeric_limits<double>::infinity();

// The cost in double, or infinity for a forbidden pair. Sums of what is allowed stay finite over any matrix.
template <typename Scalar>
[[nodiscard]] double allowed_cost(Scalar cost, double max_cost) noexcept {
  const double c = static_cast<double>(cost);
  const bool allowed = (c >= -1e200) & (c <= 1e200) & (c < max_cost);  // no branches: the loop over a row vectorises
  return allowed ? c : infinity;
}

// The gate that is really used for n pairs at most. Above the bound below a gate means "as many pairs as possible"
// anyway, and a needlessly large one would only cost digits. The magnitude of the costs takes part so that the bound
// exceeds the largest one, also after rounding, when all costs are (nearly) equal.
template <typename Costs>
[[nodiscard]] double effective_gate(const Eigen::ArrayBase<Costs>& allowed, double max_cost, std::size_t n) noexcept {
  const double least = n > 0 ? allowed.minCoeff() : infinity;
  if (!(least < infinity)) return (std::min)(max_cost, 1.0);  // no pair is allowed: any gate will do
  double most = allowed.maxCoeff();
  if (!(most < infinity)) most = (allowed < infinity).select(allowed, least).maxCoeff();
  const double width = (std::max)({most - least, -least / 4, most / 4, (std::numeric_limits<double>::min)()});
  return (std::min)(max_cost, most + static_cast<double>(n) * width);
}

// One search over the workspace's costs. Notation: saving b_j >= 0 of a column, reduced cost c_ij + b_j, gate g. A row
// of a pair always holds its column at its smallest reduced cost, which is at most g; a column without a row has saving
// 0. Both hold at the start, without pairs.
template <typename Workspace>
struct AssignmentSearch {
  using Visit = typename Workspace::Visit;
  using View = Eigen::Map<const Eigen::ArrayXd>;

  Workspace& w;
  span<int> column_of_row;
  double gate;
  std::size_t columns = w.column_saving.size();

  // The reduced cost of a pair, `offset` above the row's own distance.
  [[nodiscard]] double through(const Visit& visit, std::size_t column) const noexcept {
    return w.costs[visit.row * columns + column] + w.column_saving[column] + visit.offset;
  }

  // Distances of all open columns through one more row. Returns the smallest. The saving is infinite where closed.
  [[nodiscard]] double relax(const Visit& visit) noexcept {
    const auto n = static_cast<Eigen::Index>(columns);
    const View cost(w.costs.data() + visit.row * columns, n), saving(w.open_saving.data(), n);
    Eigen::Map<Eigen::ArrayXd> distance(w.distance.data(), n);
    distance = (distance.min)(cost + saving + visit.offset);
    return distance.minCoeff();
  }

  // Dijkstra from a row without a pair to the nearest free column, or to the dummy of any row on the way.
  void augment(std::size_t start) noexcept {
    std::fill(w.distance.begin(), w.distance.end(), infinity);
    std::copy(w.column_saving.begin(), w.column_saving.end(), w.open_saving.begin());
    w.visits[0] = {start, unassigned, 0, 0};
    std::size_t visits = 1, alone = 0;  // alone: the visit whose dummy is the nearest so far
    for (double dummy = gate;;) {
      const double least = relax(w.visits[visits - 1]);
      if (dummy <= least) {
        column_of_row[w.visits[alone].row] = unassigned;
        return finish(w.visits[alone].column, alone, visits, dummy);
      }
      const auto j =
          static_cast<std::size_t>(std::find(w.distance.begin(), w.distance.end(), least) - w.distance.begin());
      const int row = w.row_of_column[j];
      if (row == unassigned) return finish(static_cast<int>(j), visits, visits, least);
      w.open_saving[j] = w.distance[j] = infinity;
      Visit next{static_cast<std::size_t>(row), static_cast<int>(j), least, 0};
      next.offset = least - through(next, j);
      if (gate + next.offset < dummy) dummy = gate + next.offset, alone = visits;
      w.visits[visits++] = next;
    }
  }

  // Swaps the pairs along the shortest path, of this length, that ends in `column`. The row before a column is the one
  // that gave it its distance, visited before the column closed: among the first `end` visits.
  void finish(int column, std::size_t end, std::size_t visits, double length) noexcept {
    while (column != unassigned) {
      const auto j = static_cast<std::size_t>(column);
      const auto nearer = [&](const Visit& a, const Visit& b) { return through(a, j) < through(b, j); };
      end = static_cast<std::size_t>(
          std::min_element(w.visits.begin(), w.visits.begin() + std::ptrdiff_t(end), nearer) - w.visits.begin());
      const Visit& before = w.visits[end];
      column_of_row[before.row] = column;
      w.row_of_column[j] = static_cast<int>(before.row);
      column = before.column;
    }
    for (std::size_t k = 1; k < visits; ++k)
      w.column_saving[std::size_t(w.visits[k].column)] += (std::max)(length - w.visits[k].distance, 0.0);
  }
};

}  // namespace CFP_ISA
}  // namespace detail

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
                                  span<int> column_of_row) {
  CFP_ASSERT(column_of_row.size() == costs.rows);
  std::fill(column_of_row.begin(), column_of_row.end(), unassigned);
  workspace.column_saving.assign(costs.cols, 0.0);
  AssignmentResult result;
  if (!(max_cost == max_cost)) {
    result.status = Status::invalid_input;
    return result;
  }
  workspace.costs.resize(costs.rows * costs.cols);
  for (std::size_t k = 0; k < workspace.costs.size(); ++k)
    workspace.costs[k] = detail::allowed_cost(costs.values[k], max_cost);
  workspace.distance.resize(costs.cols);
  workspace.open_saving.resize(costs.cols);
  workspace.row_of_column.assign(costs.cols, unassigned);
  workspace.visits.resize(costs.rows);  // a search visits every row once at most
  const Eigen::Map<const Eigen::ArrayXd> allowed(workspace.costs.data(), Eigen::Index(workspace.costs.size()));
  const double gate = detail::effective_gate(allowed, max_cost, (std::min)(costs.rows, costs.cols));
  detail::AssignmentSearch<AssignmentWorkspace> search{workspace, column_of_row, gate};
  for (std::size_t i = 0; i < costs.rows && costs.cols > 0; ++i) search.augment(i);
  for (std::size_t i = 0; i < costs.rows; ++i) {
    if (column_of_row[i] == unassigned) continue;
    result.cost += static_cast<double>(costs(i, static_cast<std::size_t>(column_of_row[i])));
    ++result.pairs;
  }
  return result;
}

}  // namespace CFP_ISA
}  // namespace cfp
