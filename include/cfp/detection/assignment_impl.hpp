/// @file assignment_impl.hpp
/// The machinery behind assignment.hpp; include that one.
#pragma once

#include <algorithm>
#include <limits>

#include "cfp/detection/assignment.hpp"

namespace cfp {
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
class AssignmentSearch {
 public:
  AssignmentSearch(Workspace& workspace, std::size_t columns, double gate, span<int> column_of_row)
      : w_(workspace), column_of_row_(column_of_row), columns_(columns), gate_(gate) {
    w_.distance.resize(columns);
    w_.open_saving.resize(columns);
    w_.row_of_column.assign(columns, unassigned);
    w_.visits.resize(column_of_row.size() + 1);
  }

  // The smallest reduced cost of a row that was searched, its dummy included.
  [[nodiscard]] double row_value(std::size_t row) const noexcept {
    const int j = column_of_row_[row];
    return j == unassigned ? gate_ : costs(row)[j] + w_.column_saving[std::size_t(j)];
  }

  // Optimal for all rows. Each takes its cheapest column while that is free; the rest are searched one by one.
  void solve() noexcept {
    for (const bool search : {false, true}) {
      for (std::size_t i = 0; i < column_of_row_.size(); ++i) {
        if (search && column_of_row_[i] == unassigned) augment(i);
        if (!search) take_cheapest(i);
      }
    }
  }

 private:
  using Visit = typename Workspace::Visit;
  using View = Eigen::Map<const Eigen::ArrayXd>;

  void pair(std::size_t row, std::size_t column) noexcept {
    column_of_row_[row] = static_cast<int>(column);
    w_.row_of_column[column] = static_cast<int>(row);
  }
  void take_cheapest(std::size_t row) noexcept {
    const double* const cost = costs(row);
    const double least = View(cost, static_cast<Eigen::Index>(columns_)).minCoeff();
    const auto j = static_cast<std::size_t>(std::find(cost, cost + columns_, least) - cost);
    if (least < infinity && w_.row_of_column[j] == unassigned) pair(row, j);
  }

  // Dijkstra from a row without a pair to the nearest free column, or to the dummy of any row on the way.
  void augment(std::size_t start) noexcept {
    std::fill(w_.distance.begin(), w_.distance.end(), infinity);
    std::copy(w_.column_saving.begin(), w_.column_saving.end(), w_.open_saving.begin());
    w_.visits[0] = {start, unassigned, 0, 0};
    std::size_t visits = 1, alone = 0;  // alone: the visit whose dummy is the nearest so far
    double dummy = gate_, length = 0;
    int sink = unassigned;
    for (;;) {
      const double least = relax(w_.visits[visits - 1]);
      length = (std::min)(least, dummy);
      if (dummy <= least) break;
      const auto j =
          static_cast<std::size_t>(std::find(w_.distance.begin(), w_.distance.end(), least) - w_.distance.begin());
      if (w_.row_of_column[j] == unassigned) {
        sink = static_cast<int>(j);
        break;
      }
      w_.open_saving[j] = w_.distance[j] = infinity;
      const auto row = static_cast<std::size_t>(w_.row_of_column[j]);
      const double offset = least - row_value(row);
      w_.visits[visits] = {row, static_cast<int>(j), least, offset};
      if (gate_ + offset < dummy) {
        dummy = gate_ + offset;
        alone = visits;
      }
      ++visits;
    }
    flip(sink, sink == unassigned ? alone : visits);
    for (std::size_t k = 1; k < visits; ++k)
      w_.column_saving[std::size_t(w_.visits[k].column)] += (std::max)(length - w_.visits[k].distance, 0.0);
  }

  [[nodiscard]] const double* costs(std::size_t row) const noexcept { return w_.costs.data() + row * columns_; }

  // Distances of all open columns through one more row, whose own distance is `offset` above its value. Returns the
  // smallest. The saving is infinite where closed.
  [[nodiscard]] double relax(const Visit& visit) noexcept {
    const auto n = static_cast<Eigen::Index>(columns_);
    const View cost(costs(visit.row), n), saving(w_.open_saving.data(), n);
    Eigen::Map<Eigen::ArrayXd> distance(w_.distance.data(), n);
    distance = (distance.min)(cost + saving + visit.offset);
    return distance.minCoeff();
  }

  // Swaps the pairs along the shortest path that ends in column `sink`, or in the dummy of visit `end` when there is no
  // sink. The row before a column is the one that gave it its distance, visited before the column closed.
  void flip(int sink, std::size_t end) noexcept {
    int j = sink;
    if (sink == unassigned) {
      column_of_row_[w_.visits[end].row] = unassigned;
      j = w_.visits[end].column;
    }
    while (j != unassigned) {
      std::size_t best = 0;
      double least = infinity;
      for (std::size_t k = 0; k < end; ++k) {
        const double through = costs(w_.visits[k].row)[j] + w_.column_saving[std::size_t(j)] + w_.visits[k].offset;
        if (!(through < least)) continue;
        least = through;
        best = k;
      }
      pair(w_.visits[best].row, static_cast<std::size_t>(j));
      j = w_.visits[best].column;
      end = best;
    }
  }

  Workspace& w_;
  span<int> column_of_row_;
  std::size_t columns_;
  double gate_;
};

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

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
  const Eigen::Map<const Eigen::ArrayXd> allowed(workspace.costs.data(), Eigen::Index(workspace.costs.size()));
  const double gate = detail::effective_gate(allowed, max_cost, (std::min)(costs.rows, costs.cols));
  detail::AssignmentSearch<AssignmentWorkspace> search(workspace, costs.cols, gate, column_of_row);
  if (costs.cols > 0) search.solve();
  for (std::size_t i = 0; i < costs.rows; ++i) {
    if (column_of_row[i] == unassigned) continue;
    result.cost += static_cast<double>(costs(i, static_cast<std::size_t>(column_of_row[i])));
    ++result.pairs;
  }
  return result;
}

}  // namespace CFP_ISA
}  // namespace cfp
