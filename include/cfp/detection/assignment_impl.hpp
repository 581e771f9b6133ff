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
#include "cfp/detection/assignment_solver_impl.hpp"

namespace cfp {
namespace detail {

inline constexpr double assignment_largest_cost = 1e200;  // sums over any matrix stay finite

/// What a cost has to be to allow its pair, as two comparisons that NaN fails.
struct CostLimits {
  double low = -assignment_largest_cost;  // inclusive
  double high;                            // exclusive

  explicit CostLimits(double max_cost) noexcept
      : high((std::min)(max_cost, std::nextafter(assignment_largest_cost, infinity))) {}
  /// The cost in double, or infinity for a forbidden pair.
  template <typename Scalar>
  [[nodiscard]] double operator()(Scalar cost) const noexcept {
    const double c = static_cast<double>(cost);
    const double below = c < high ? c : infinity;
    return c >= low ? below : infinity;
  }
};

/// std::vector::assign, but inline: for a handful of boxes the calls would count.
template <typename T>
void refill(std::vector<T>& v, std::size_t size, T value) {
  v.resize(size);
  std::fill_n(v.data(), size, value);
}

using RowView = Eigen::Map<const Eigen::ArrayXd>;

struct CostRange {
  double least, most;
};

/// Copies a row of costs, forbidden ones as infinity, padded to `stride` with infinity. Returns the least and the
/// largest one, which is infinite when a pair of the row is forbidden.
template <typename Scalar>
CostRange copy_costs(const Scalar* source, std::size_t step, std::size_t size, CostLimits limits, double* row,
                     std::size_t stride) noexcept {
  const double high = limits.high;  // a local: the stores might alias a member
  double least[assignment_lanes] = {infinity, infinity, infinity, infinity},
         most[assignment_lanes] = {-infinity, -infinity, -infinity, -infinity};
  std::size_t j = 0;
  if (step == 1) {
    for (; j + assignment_lanes <= size; j += assignment_lanes) {
      for (std::size_t k = 0; k < assignment_lanes; ++k) {
        const double c = static_cast<double>(source[j + k]);
        row[j + k] = c < high ? c : infinity;
        least[k] = smaller(row[j + k], least[k]);
        most[k] = larger(row[j + k], most[k]);
      }
    }
  }
  for (; j < size; ++j) {
    row[j] = limits(source[j * step]);
    least[0] = smaller(row[j], least[0]);
    most[0] = larger(row[j], most[0]);
  }
  std::fill(row + size, row + stride, infinity);
  const CostRange range{smaller(smaller(least[0], least[1]), smaller(least[2], least[3])),
                        larger(larger(most[0], most[1]), larger(most[2], most[3]))};
  if (range.least >= limits.low) return range;
  for (j = 0; j < size; ++j) row[j] = limits(row[j]);  // rare: something below the range
  return {RowView(row, static_cast<Eigen::Index>(stride)).minCoeff(), infinity};
}

/// The largest allowed cost of a row, -infinity when there is none.
[[nodiscard]] inline double largest_cost(const double* row, std::size_t size) noexcept {
  double allowed = -infinity;
  for (std::size_t j = 0; j < size; ++j) allowed = row[j] < infinity ? larger(allowed, row[j]) : allowed;
  return allowed;
}

/// Whether a gate is so near the least cost that it costs no digits. (A shortcut only: it saves a look at all costs.)
[[nodiscard]] inline bool is_moderate(double max_cost, double least) noexcept {
  return std::abs(max_cost) <= 1e3 * std::abs(least);
}

/// The gate that is really used for n pairs at most. Above the bound below a gate means "as many pairs as possible"
/// anyway, and a needlessly large one would only cost digits.
[[nodiscard]] inline double effective_gate(double max_cost, double least, double most, std::size_t n) noexcept {
  if (is_moderate(max_cost, least)) return max_cost;
  // The magnitude takes part so that the bound exceeds `most` even after rounding when all costs are (nearly) equal.
  const double width = (std::max)({most - least, (std::max)(-least, most) / 4, (std::numeric_limits<double>::min)()});
  return (std::min)(max_cost, most + static_cast<double>(n) * width);
}

}  // namespace detail

template <typename Scalar>
AssignmentResult solve_assignment(const CostMatrix<Scalar>& costs, double max_cost, span<int> column_of_row,
                                  AssignmentWorkspace& w) {
  CFP_ASSERT(column_of_row.size() == costs.rows);
  std::fill(column_of_row.begin(), column_of_row.end(), unassigned);
  detail::refill(w.row_saving, costs.rows, 0.0);
  detail::refill(w.column_saving, costs.cols, 0.0);
  AssignmentResult result;
  if (!(max_cost == max_cost)) {
    result.status = Status::invalid_input;
    return result;
  }
  const bool tall = costs.rows > costs.cols;  // the search costs rows^2 * columns: the shorter side goes first
  const std::size_t n = (std::min)(costs.rows, costs.cols);
  const std::size_t m = (std::max)(costs.rows, costs.cols);
  const std::size_t stride = detail::padded_columns(m);
  if (n == 0) return result;
  w.costs.resize(n * stride);
  double* row_least = (tall ? w.column_saving : w.row_saving).data();  // borrowed until the savings are known
  double least = detail::infinity, most = -detail::infinity;
  for (std::size_t i = 0; i < n; ++i) {
    const Scalar* source = costs.values.data() + (tall ? i : i * costs.cols);
    const detail::CostRange range = detail::copy_costs(source, tall ? costs.cols : 1, m, detail::CostLimits(max_cost),
                                                       w.costs.data() + i * stride, stride);
    row_least[i] = range.least;
    least = (std::min)(least, range.least);
    most = (std::max)(most, range.most);
  }
  if (!(least < detail::infinity)) {
    std::fill(row_least, row_least + n, 0.0);
    return result;
  }
  if (!(most < detail::infinity) && !detail::is_moderate(max_cost, least)) {
    most = least;
    for (std::size_t i = 0; i < n; ++i) most = (std::max)(most, detail::largest_cost(w.costs.data() + i * stride, m));
  }
  const double gate = detail::effective_gate(max_cost, least, most, n);
  w.distance.resize(stride);
  detail::refill(w.price, stride, 0.0);
  w.open_price.resize(stride);
  detail::refill(w.row_of_column, stride, detail::nobody);
  detail::refill(w.column_of_row, n, detail::nobody);
  w.queue.resize(n);
  w.visits.resize(n + 1);

  detail::AssignmentSolver<AssignmentWorkspace> solver(w, n, m, gate);
  solver.solve(row_least);

  std::vector<double>& short_side = tall ? w.column_saving : w.row_saving;
  std::vector<double>& long_side = tall ? w.row_saving : w.column_saving;
  for (std::size_t j = 0; j < m; ++j) long_side[j] = -w.price[j];
  for (std::size_t i = 0; i < n; ++i) {
    short_side[i] = (std::max)(gate - solver.row_value(static_cast<std::ptrdiff_t>(i)), 0.0);
    if (w.column_of_row[i] == detail::nobody) continue;
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
  const detail::CostLimits limited(max_cost);
  double least = detail::infinity, most = -detail::infinity;
  for (const Scalar cost : costs.values.subspan(0, costs.rows * costs.cols)) {
    const double c = limited(cost);
    if (!(c < detail::infinity)) continue;
    least = (std::min)(least, c);
    most = (std::max)(most, c);
  }
  if (!(least < detail::infinity)) least = most = 0;  // no pair is allowed
  const double gate = detail::effective_gate(max_cost, least, most, (std::min)(costs.rows, costs.cols));
  const auto saving_of = [&](std::size_t i, std::size_t j) {
    const double c = limited(costs(i, j));
    return c < detail::infinity ? gate - c : -detail::infinity;
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
    for (std::size_t k = 0; k < i; ++k) {
      if (column_of_row[k] == j) return detail::infinity;
    }
    gap -= saving_of(i, static_cast<std::size_t>(j));  // +infinity for a forbidden pair
  }
  return gap;
}

}  // namespace cfp
