/// @file assignment_impl.hpp
/// The machinery behind assignment.hpp; include that one.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "cfp/core/numeric.hpp"
#include "cfp/detection/assignment.hpp"

namespace cfp {
namespace detail {

inline constexpr double infinity = std::numeric_limits<double>::infinity();
inline constexpr std::size_t assignment_lanes = 4;  // columns are padded to this, so that the inner loops need no remainder
inline constexpr std::ptrdiff_t nobody = -1;

inline constexpr double assignment_largest_cost = 1e200;  // sums over any matrix stay finite

/// The cost in double, or infinity for a forbidden pair.
template <typename Scalar>
[[nodiscard]] double gated_cost(Scalar cost, double max_cost) noexcept {
  const double c = static_cast<double>(cost);
  const bool allowed = static_cast<int>(c < max_cost) & static_cast<int>(std::abs(c) <= assignment_largest_cost);
  return allowed ? c : infinity;
}

/// Smallest and largest allowed cost, in lanes so that compilers vectorise the loop without reordering permission.
struct CostRange {
  double low[assignment_lanes], high[assignment_lanes];

  CostRange() noexcept {
    std::fill(low, low + assignment_lanes, infinity);
    std::fill(high, high + assignment_lanes, -infinity);
  }
  /// Writes gated costs (padded with infinity to a multiple of the lanes) and takes them into the range.
  template <typename Scalar>
  void copy(const Scalar* costs, std::size_t step, std::size_t size, double max_cost, double* gated) noexcept {
    std::size_t j = 0;
    if (step == 1) {
      for (; j + assignment_lanes <= size; j += assignment_lanes) {
        for (std::size_t l = 0; l < assignment_lanes; ++l) gated[j + l] = gated_cost(costs[j + l], max_cost);
        include(gated + j);
      }
    }
    for (; j < size; j += assignment_lanes) {
      for (std::size_t l = 0; l < assignment_lanes; ++l) gated[j + l] = j + l < size ? gated_cost(costs[(j + l) * step], max_cost) : infinity;
      include(gated + j);
    }
  }
  void include(const double* gated) noexcept {
    for (std::size_t l = 0; l < assignment_lanes; ++l) {
      const double allowed = gated[l] < infinity ? gated[l] : -infinity;
      low[l] = gated[l] < low[l] ? gated[l] : low[l];
      high[l] = allowed > high[l] ? allowed : high[l];
    }
  }
  /// The gate that is really used for n pairs at most; -infinity: no pair is allowed. Above the bound below a gate means
  /// "as many pairs as possible" anyway, and a needlessly large one would only cost digits.
  [[nodiscard]] double gate(double max_cost, std::size_t n) const noexcept {
    const double least = *std::min_element(low, low + assignment_lanes);
    const double most = *std::max_element(high, high + assignment_lanes);
    if (!(least <= most)) return -infinity;
    // The magnitude takes part so that the bound exceeds `most` even after rounding when all costs are (nearly) equal.
    const double width = (std::max)({most - least, (std::max)(-least, most) / 4, (std::numeric_limits<double>::min)()});
    return (std::min)(max_cost, most + static_cast<double>(n) * width);
  }
};

/// One solve over the workspace, rows <= columns. Notation: price p_j <= 0, reduced cost c_ij - p_j, gate g. A row of a pair
/// always holds its column at its smallest reduced cost, which is at most g; a column without a row has price 0.
class AssignmentSolver {
 public:
  AssignmentSolver(AssignmentWorkspace& w, std::size_t rows, std::size_t cols, double gate) noexcept
      : w_(w), rows_(rows), cols_(cols), stride_(padded(cols)), gate_(gate) {}

  static std::size_t padded(std::size_t cols) noexcept { return (cols + assignment_lanes - 1) / assignment_lanes * assignment_lanes; }

  void solve() noexcept {
    const std::size_t left = bid();
    for (std::size_t k = 0; k < left; ++k) augment(w_.queue[k]);
  }
  /// The smallest reduced cost of a row, its dummy included.
  [[nodiscard]] double row_value(std::ptrdiff_t row) const noexcept {
    const std::ptrdiff_t j = at(w_.column_of_row, row);
    return j == nobody ? gate_ : costs(row)[j] - at(w_.price, j);
  }

 private:
  template <typename T>
  static T& at(std::vector<T>& v, std::ptrdiff_t i) noexcept { return v[static_cast<std::size_t>(i)]; }
  [[nodiscard]] const double* costs(std::ptrdiff_t row) const noexcept { return w_.costs.data() + static_cast<std::size_t>(row) * stride_; }

  struct Offer {
    double best, second;
    std::ptrdiff_t column, second_column;
  };

  /// The smallest and second smallest reduced cost of a row; the dummy takes part as the second.
  [[nodiscard]] Offer offer(std::ptrdiff_t row) const noexcept {
    const double* c = costs(row);
    const double* p = w_.price.data();
    double first[assignment_lanes], second[assignment_lanes];
    std::fill(first, first + assignment_lanes, infinity);
    std::fill(second, second + assignment_lanes, infinity);
    for (std::size_t j = 0; j < stride_; j += assignment_lanes) {
      for (std::size_t l = 0; l < assignment_lanes; ++l) {
        const double r = c[j + l] - p[j + l];
        const double larger = r > first[l] ? r : first[l];
        second[l] = larger < second[l] ? larger : second[l];
        first[l] = r < first[l] ? r : first[l];
      }
    }
    Offer o{first[0], second[0], nobody, nobody};
    for (std::size_t l = 1; l < assignment_lanes; ++l) {
      o.second = (std::min)((std::max)(o.best, first[l]), (std::min)(o.second, second[l]));
      o.best = (std::min)(o.best, first[l]);
    }
    if (!(o.best < gate_)) return o;
    std::size_t j = 0;
    while (c[j] - p[j] != o.best) ++j;
    o.column = static_cast<std::ptrdiff_t>(j);
    if (!(o.second < gate_)) {
      o.second = gate_;
    } else if (o.second == o.best) {
      do ++j;
      while (c[j] - p[j] != o.best);
      o.second_column = static_cast<std::ptrdiff_t>(j);
    }
    return o;
  }

  /// Rows bid for their best column, lowering its price by what the second best leaves. Returns how many rows are left in
  /// the queue: those of a tie, and what the bounded number of bids did not settle.
  std::size_t bid() noexcept {
    std::size_t left = 0;
    std::size_t bids = 4 * rows_;
    for (std::size_t k = 0; k < rows_; ++k) {
      std::ptrdiff_t row = static_cast<std::ptrdiff_t>(k);
      while (row != nobody) {
        if (bids == 0) {
          w_.queue[left++] = row;
          break;
        }
        --bids;
        const Offer o = offer(row);
        if (o.column == nobody) break;
        std::ptrdiff_t j = o.column;
        if (o.second_column != nobody && at(w_.row_of_column, j) != nobody) j = o.second_column;
        const std::ptrdiff_t evicted = at(w_.row_of_column, j);
        if (evicted != nobody && !(o.best < o.second)) {
          w_.queue[left++] = row;
          break;
        }
        at(w_.price, j) -= o.second - o.best;
        at(w_.row_of_column, j) = row;
        at(w_.column_of_row, row) = j;
        if (evicted != nobody) at(w_.column_of_row, evicted) = nobody;
        row = evicted;
      }
    }
    return left;
  }

  /// Distances of all open columns through one more row, whose own distance is `offset` above its value. Returns the smallest.
  [[nodiscard]] double relax(std::ptrdiff_t row, double offset) noexcept {
    const double* c = costs(row);
    const double* p = w_.open_price.data();  // -infinity where closed, so that the sum below is infinite there
    double* d = w_.distance.data();
    std::ptrdiff_t* parent = w_.parent.data();
    double least[assignment_lanes];
    std::fill(least, least + assignment_lanes, infinity);
    for (std::size_t j = 0; j < stride_; j += assignment_lanes) {
      for (std::size_t l = 0; l < assignment_lanes; ++l) {
        const double through = (c[j + l] - p[j + l]) + offset;
        const bool shorter = through < d[j + l];
        d[j + l] = shorter ? through : d[j + l];
        parent[j + l] = shorter ? row : parent[j + l];
        least[l] = d[j + l] < least[l] ? d[j + l] : least[l];
      }
    }
    return (std::min)((std::min)(least[0], least[1]), (std::min)(least[2], least[3]));
  }

  /// The open column at that distance: the first free one, else the first.
  [[nodiscard]] std::ptrdiff_t nearest(double distance) const noexcept {
    std::ptrdiff_t first = nobody;
    for (std::size_t j = 0; j < cols_; ++j) {
      if (w_.distance[j] != distance) continue;
      if (w_.row_of_column[j] == nobody) return static_cast<std::ptrdiff_t>(j);
      if (first == nobody) first = static_cast<std::ptrdiff_t>(j);
    }
    return first;
  }

  /// Dijkstra from a row without a pair to the nearest free column, or to the dummy of any row on the way.
  void augment(std::ptrdiff_t start) noexcept {
    std::fill(w_.distance.begin(), w_.distance.begin() + static_cast<std::ptrdiff_t>(stride_), infinity);
    std::copy(w_.price.begin(), w_.price.begin() + static_cast<std::ptrdiff_t>(stride_), w_.open_price.begin());
    std::size_t closed = 0;
    std::ptrdiff_t alone = start;  // the row whose dummy is the nearest so far
    double dummy = gate_;
    std::ptrdiff_t row = start;
    double offset = 0;
    std::ptrdiff_t sink = nobody;
    double length = 0;
    for (;;) {
      const double least = relax(row, offset);
      if (dummy < least) {
        length = dummy;
        break;
      }
      const std::ptrdiff_t j = nearest(least);
      if (at(w_.row_of_column, j) == nobody) {
        length = least;
        sink = j;
        break;
      }
      w_.closed[closed] = j;
      w_.closed_distance[closed++] = least;
      at(w_.open_price, j) = -infinity;
      at(w_.distance, j) = infinity;
      row = at(w_.row_of_column, j);
      offset = least - row_value(row);
      if (gate_ + offset < dummy) {
        dummy = gate_ + offset;
        alone = row;
      }
    }
    for (std::size_t k = 0; k < closed; ++k) at(w_.price, w_.closed[k]) += (std::min)(w_.closed_distance[k] - length, 0.0);
    std::ptrdiff_t j = sink;
    if (sink == nobody) {
      j = at(w_.column_of_row, alone);
      at(w_.column_of_row, alone) = nobody;
    }
    while (j != nobody) {
      const std::ptrdiff_t parent = at(w_.parent, j);
      at(w_.row_of_column, j) = parent;
      std::swap(at(w_.column_of_row, parent), j);
    }
  }

  AssignmentWorkspace& w_;
  std::size_t rows_, cols_, stride_;
  double gate_;
};

}  // namespace detail

template <typename Scalar>
AssignmentResult solve_assignment(const CostMatrix<Scalar>& costs, double max_cost, span<int> column_of_row, AssignmentWorkspace& w) {
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
  const std::size_t n = (std::min)(costs.rows, costs.cols);
  const std::size_t m = (std::max)(costs.rows, costs.cols);
  const std::size_t stride = detail::AssignmentSolver::padded(m);
  w.costs.resize(n * stride);
  detail::CostRange range;
  for (std::size_t i = 0; i < n; ++i) {
    range.copy(costs.values.data() + (tall ? i : i * costs.cols), tall ? costs.cols : 1, m, max_cost, w.costs.data() + i * stride);
  }
  const double gate = range.gate(max_cost, n);
  if (!(gate > -detail::infinity)) return result;
  w.price.assign(stride, 0.0);
  w.open_price.resize(stride);
  w.distance.resize(stride);
  w.parent.assign(stride, detail::nobody);
  w.row_of_column.assign(stride, detail::nobody);
  w.column_of_row.assign(n, detail::nobody);
  w.queue.resize(n);
  w.closed.resize(n);
  w.closed_distance.resize(n);

  detail::AssignmentSolver solver(w, n, m, gate);
  solver.solve();

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
double assignment_gap(const CostMatrix<Scalar>& costs, double max_cost, span<const int> column_of_row, span<const double> column_saving) noexcept {
  CFP_ASSERT(column_of_row.size() == costs.rows && column_saving.size() == costs.cols);
  if (!(max_cost == max_cost)) return detail::infinity;
  detail::CostRange range;
  for (const Scalar& cost : costs.values.subspan(0, costs.rows * costs.cols)) {
    double gated[detail::assignment_lanes];
    range.copy(&cost, 1, 1, max_cost, gated);
  }
  const double gate = range.gate(max_cost, (std::min)(costs.rows, costs.cols));
  const auto saving_of = [&](std::size_t i, std::size_t j) {
    const double c = detail::gated_cost(costs(i, j), max_cost);
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
