/// @file assignment_impl.hpp
/// The machinery behind assignment.hpp; include that one.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include "cfp/detection/assignment.hpp"

namespace cfp {
namespace detail {
inline namespace CFP_ISA {

inline constexpr double infinity = std::numeric_limits<double>::infinity();
inline constexpr std::ptrdiff_t no_partner = -1;

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
template <typename Scalar>
[[nodiscard]] Scalar effective_gate(Scalar max_cost, Scalar least, Scalar most, std::size_t n) noexcept {
  const Scalar magnitude = (std::max)(-least, most) / 4;
  const Scalar width = (std::max)({most - least, magnitude, (std::numeric_limits<Scalar>::min)()});
  return (std::min)(max_cost, most + static_cast<Scalar>(n) * width);
}

// One search over the workspace's costs (rows <= columns). Notation: price p_j <= 0, reduced cost c_ij - p_j, gate g. A
// row of a pair always holds its column at its smallest reduced cost, which is at most g; a column without a row has
// price 0. Both hold when every row takes its cheapest column while that is free, which is the start.
template <typename Workspace>
class AssignmentSearch {
 public:
  AssignmentSearch(Workspace& workspace, std::size_t rows, std::size_t columns, double gate)
      : w_(workspace), columns_(static_cast<std::ptrdiff_t>(columns)), gate_(gate) {
    w_.distance.resize(columns);
    w_.price.assign(columns, 0.0);
    w_.open_price.resize(columns);
    w_.row_of_column.assign(columns, no_partner);
    w_.column_of_row.assign(rows, no_partner);
    w_.visits.resize(rows + 1);
  }
  void solve() noexcept {
    const auto rows = static_cast<std::ptrdiff_t>(w_.column_of_row.size());
    for (std::ptrdiff_t row = 0; row < rows; ++row) {
      const std::ptrdiff_t j = at(w_.cheapest, row);
      if (j != no_partner && at(w_.row_of_column, j) == no_partner) pair(row, j);
    }
    for (std::ptrdiff_t row = 0; row < rows; ++row) {
      if (at(w_.cheapest, row) != no_partner && at(w_.column_of_row, row) == no_partner) augment(row);
    }
  }
  // The smallest reduced cost of a row, its dummy included.
  [[nodiscard]] double row_value(std::ptrdiff_t row) const noexcept {
    const std::ptrdiff_t j = at(w_.column_of_row, row);
    return j == no_partner ? gate_ : costs(row)[j] - at(w_.price, j);
  }

 private:
  using View = Eigen::Map<Eigen::ArrayXd>;
  using ConstView = Eigen::Map<const Eigen::ArrayXd>;

  template <typename T>
  static T& at(std::vector<T>& v, std::ptrdiff_t i) noexcept {
    return v[static_cast<std::size_t>(i)];
  }
  void pair(std::ptrdiff_t row, std::ptrdiff_t column) noexcept {
    at(w_.row_of_column, column) = row;
    at(w_.column_of_row, row) = column;
  }
  [[nodiscard]] const double* costs(std::ptrdiff_t row) const noexcept { return w_.costs.data() + row * columns_; }

  // Distances of all open columns through one more row, whose own distance is `offset` above its value. Returns the
  // smallest. The open price is -infinity where closed, so that the sum is infinite there.
  [[nodiscard]] double relax(std::ptrdiff_t row, double offset) noexcept {
    View distance(w_.distance.data(), columns_);
    const ConstView cost(costs(row), columns_), price(w_.open_price.data(), columns_);
    distance = distance.min(cost - price + offset);
    return distance.minCoeff();
  }

  // The open column at that distance: the first free one, else the first.
  [[nodiscard]] std::ptrdiff_t nearest(double distance) const noexcept {
    std::ptrdiff_t first = no_partner;
    for (std::ptrdiff_t j = 0; j < columns_; ++j) {
      if (at(w_.distance, j) != distance) continue;
      if (at(w_.row_of_column, j) == no_partner) return j;
      if (first == no_partner) first = j;
    }
    return first;
  }

  // Dijkstra from a row without a pair to the nearest free column, or to the dummy of any row on the way.
  void augment(std::ptrdiff_t start) noexcept {
    std::fill(w_.distance.begin(), w_.distance.end(), infinity);
    std::copy(w_.price.begin(), w_.price.end(), w_.open_price.begin());
    w_.visits[0] = {start, no_partner, 0, 0};
    std::size_t visits = 1, alone = 0;  // alone: the visit whose dummy is the nearest so far
    double dummy = gate_, length = 0;
    std::ptrdiff_t sink = no_partner;
    for (;;) {
      const double least = relax(w_.visits[visits - 1].row, w_.visits[visits - 1].offset);
      length = (std::min)(least, dummy);
      if (dummy <= least) break;
      const std::ptrdiff_t j = nearest(least), row = at(w_.row_of_column, j);
      if (row == no_partner) {
        sink = j;
        break;
      }
      at(w_.open_price, j) = -infinity;
      at(w_.distance, j) = infinity;
      const double offset = least - row_value(row);
      w_.visits[visits] = {row, j, least, offset};
      if (gate_ + offset < dummy) {
        dummy = gate_ + offset;
        alone = visits;
      }
      ++visits;
    }
    flip(sink, sink == no_partner ? alone : visits);
    for (std::size_t k = 1; k < visits; ++k)
      at(w_.price, w_.visits[k].column) += (std::min)(w_.visits[k].distance - length, 0.0);
  }

  // Swaps the pairs along the shortest path that ends in column `sink`, or in the dummy of visit `end` when there is no
  // sink. The row before a column is the one that gave it its distance, visited before the column closed.
  void flip(std::ptrdiff_t sink, std::size_t end) noexcept {
    std::ptrdiff_t j = sink;
    if (sink == no_partner) {
      at(w_.column_of_row, w_.visits[end].row) = no_partner;
      j = w_.visits[end].column;
    }
    while (j != no_partner) {
      std::size_t best = 0;
      double least = infinity;
      for (std::size_t k = 0; k < end; ++k) {
        const double through = costs(w_.visits[k].row)[j] - at(w_.price, j) + w_.visits[k].offset;
        if (!(through < least)) continue;
        least = through;
        best = k;
      }
      pair(w_.visits[best].row, j);
      j = w_.visits[best].column;
      end = best;
    }
  }

  Workspace& w_;
  std::ptrdiff_t columns_;
  double gate_;
};

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

template <typename Scalar>
AssignmentResult solve_assignment(const CostMatrix<Scalar>& costs, double max_cost, AssignmentWorkspace& w,
                                  span<int> column_of_row) {
  CFP_ASSERT(column_of_row.size() == costs.rows);
  std::fill(column_of_row.begin(), column_of_row.end(), unassigned);
  w.row_saving.assign(costs.rows, 0.0);
  w.column_saving.assign(costs.cols, 0.0);
  AssignmentResult result;
  if (!(max_cost == max_cost)) {
    result.status = Status::invalid_input;
    return result;
  }
  const bool tall = costs.rows > costs.cols;  // the search costs rows^2 * columns: the shorter side goes first
  const std::size_t n = (std::min)(costs.rows, costs.cols), m = (std::max)(costs.rows, costs.cols);
  w.costs.resize(n * m);
  w.cheapest.assign(n, detail::no_partner);
  double least = detail::infinity, most = -detail::infinity;
  for (std::size_t i = 0; i < n; ++i) {
    double* row = w.costs.data() + i * m;
    const Scalar* from = costs.values.data() + (tall ? i : i * m);
    if (tall) {
      for (std::size_t j = 0; j < m; ++j) row[j] = detail::allowed_cost(from[j * n], max_cost);
    } else {
      for (std::size_t j = 0; j < m; ++j) row[j] = detail::allowed_cost(from[j], max_cost);
    }
    const Eigen::Map<const Eigen::ArrayXd> view(row, static_cast<std::ptrdiff_t>(m));
    const double least_of_row = view.minCoeff(), most_of_row = view.maxCoeff();
    if (!(least_of_row < detail::infinity)) continue;
    w.cheapest[i] = std::find(row, row + m, least_of_row) - row;
    least = (std::min)(least, least_of_row);
    const bool forbids = !(most_of_row < detail::infinity);
    most = (std::max)(most, forbids ? (view < detail::infinity).select(view, least_of_row).maxCoeff() : most_of_row);
  }
  if (!(least < detail::infinity)) return result;
  const double gate = detail::effective_gate(max_cost, least, most, n);
  detail::AssignmentSearch<AssignmentWorkspace> search(w, n, m, gate);
  search.solve();

  std::vector<double>& short_side = tall ? w.column_saving : w.row_saving;
  std::vector<double>& long_side = tall ? w.row_saving : w.column_saving;
  for (std::size_t j = 0; j < m; ++j) long_side[j] = -w.price[j];
  for (std::size_t i = 0; i < n; ++i) {
    short_side[i] = (std::max)(gate - search.row_value(static_cast<std::ptrdiff_t>(i)), 0.0);
    if (w.column_of_row[i] == detail::no_partner) continue;
    const std::size_t j = static_cast<std::size_t>(w.column_of_row[i]);
    const std::size_t r = tall ? j : i, c = tall ? i : j;
    column_of_row[r] = static_cast<int>(c);
    result.cost += static_cast<double>(costs(r, c));
    ++result.pairs;
  }
  return result;
}

template <typename Scalar>
double assignment_gap(const CostMatrix<Scalar>& costs, double max_cost, span<const int> column_of_row,
                      span<const double> column_saving) noexcept {
  CFP_ASSERT(column_of_row.size() == costs.rows && column_saving.size() == costs.cols);
  if (!(max_cost == max_cost)) return detail::infinity;
  double least = detail::infinity, most = -detail::infinity;
  for (const Scalar cost : costs.values.subspan(0, costs.rows * costs.cols)) {
    const double c = detail::allowed_cost(cost, max_cost);
    if (!(c < detail::infinity)) continue;
    least = (std::min)(least, c);
    most = (std::max)(most, c);
  }
  if (!(least < detail::infinity)) least = most = 0;  // no pair is allowed
  const double gate = detail::effective_gate(max_cost, least, most, (std::min)(costs.rows, costs.cols));
  const auto saving_of = [&](std::size_t i, std::size_t j) {
    return gate - detail::allowed_cost(costs(i, j), max_cost);
  };
  const auto price = [&](std::size_t j) { return column_saving[j] > 0 ? column_saving[j] : 0.0; };
  double gap = 0;  // weak duality: sum a_i + sum b_j >= saved, for a_i = max(0, max_j saving_ij - b_j)
  for (std::size_t j = 0; j < costs.cols; ++j) gap += price(j);
  for (std::size_t i = 0; i < costs.rows; ++i) {
    double row = 0;
    for (std::size_t j = 0; j < costs.cols; ++j) row = (std::max)(row, saving_of(i, j) - price(j));
    gap += row;
    const int j = column_of_row[i];
    if (j == unassigned) continue;
    if (j < 0 || static_cast<std::size_t>(j) >= costs.cols) return detail::infinity;
    if (std::find(column_of_row.begin(), column_of_row.begin() + i, j) != column_of_row.begin() + i)
      return detail::infinity;
    gap -= saving_of(i, static_cast<std::size_t>(j));  // +infinity for a forbidden pair
  }
  return gap;
}

}  // namespace CFP_ISA
}  // namespace cfp
