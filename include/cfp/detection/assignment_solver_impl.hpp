/// @file assignment_solver_impl.hpp
/// The search behind assignment.hpp (include that one): greedy start, row bids, shortest augmenting paths.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include "cfp/version.hpp"

namespace cfp {
namespace detail {

inline constexpr double infinity = std::numeric_limits<double>::infinity();
inline constexpr std::size_t assignment_lanes =
    4;  // columns are padded to this, so that the inner loops need no remainder
inline constexpr std::ptrdiff_t nobody = -1;

[[nodiscard]] inline std::size_t padded_columns(std::size_t cols) noexcept {
  return (cols + assignment_lanes - 1) / assignment_lanes * assignment_lanes;
}
[[nodiscard]] inline double smaller(double a, double b) noexcept { return a < b ? a : b; }
[[nodiscard]] inline double larger(double a, double b) noexcept { return a > b ? a : b; }

/// The two smallest of some numbers. Four of these side by side keep the processor busy where one would wait for
/// itself.
struct TwoLeast {
  double first = infinity, second = infinity;
  void add(double x) noexcept {
    second = smaller(second, larger(first, x));
    first = smaller(first, x);
  }
  void add(const TwoLeast& other) noexcept {
    second = smaller(smaller(second, other.second), larger(first, other.first));
    first = smaller(first, other.first);
  }
};

/// One solve over the workspace, rows <= columns. Notation: price p_j <= 0, reduced cost c_ij - p_j, gate g. A row of a
/// pair always holds its column at its smallest reduced cost, which is at most g; a column without a row has price 0.
template <typename Workspace>
class AssignmentSolver {
 public:
  AssignmentSolver(Workspace& w, std::size_t rows, std::size_t cols, double gate) noexcept
      : w_(w), rows_(rows), stride_(padded_columns(cols)), gate_(gate) {}

  void solve(const double* row_least) noexcept {
    const std::size_t left = bid(greet(row_least));
    for (std::size_t k = 0; k < left; ++k) augment(w_.queue[k]);
  }
  /// The smallest reduced cost of a row, its dummy included.
  [[nodiscard]] double row_value(std::ptrdiff_t row) const noexcept {
    const std::ptrdiff_t j = at(w_.column_of_row, row);
    return j == nobody ? gate_ : costs(row)[j] - at(w_.price, j);
  }

 private:
  template <typename T>
  static T& at(std::vector<T>& v, std::ptrdiff_t i) noexcept {
    return v[static_cast<std::size_t>(i)];
  }
  [[nodiscard]] const double* costs(std::ptrdiff_t row) const noexcept {
    return w_.costs.data() + static_cast<std::size_t>(row) * stride_;
  }

  struct Offer {
    double best, second;
    std::ptrdiff_t column, second_column;
  };

  /// The smallest and second smallest reduced cost of a row; the dummy takes part as the second.
  [[nodiscard]] Offer offer(std::ptrdiff_t row) const noexcept {
    const double* c = costs(row);
    const double* p = w_.price.data();
    TwoLeast t0{c[0] - p[0]}, t1{c[1] - p[1]}, t2{c[2] - p[2]}, t3{c[3] - p[3]};
    for (std::size_t j = assignment_lanes; j < stride_; j += assignment_lanes) {
      t0.add(c[j] - p[j]);
      t1.add(c[j + 1] - p[j + 1]);
      t2.add(c[j + 2] - p[j + 2]);
      t3.add(c[j + 3] - p[j + 3]);
    }
    t0.add(t1);
    t2.add(t3);
    t0.add(t2);
    Offer o{t0.first, t0.second, nobody, nobody};
    if (!(o.best < gate_)) return o;
    const bool tied = o.second == o.best;
    if (!(o.second < gate_)) o.second = gate_;
    o.column = find(c, p, o.best, 0);
    if (tied) o.second_column = find(c, p, o.best, o.column + 1);
    return o;
  }

  /// The first column from `j` on with the least reduced cost; there is one. (One comparison by order, not equality,
  /// which would look for NaN, too.)
  [[nodiscard]] static std::ptrdiff_t find(const double* c, const double* p, double reduced,
                                           std::ptrdiff_t j) noexcept {
    for (; j % 4 != 0; ++j) {
      if (c[j] - p[j] <= reduced) return j;
    }
    while (smaller(smaller(c[j] - p[j], c[j + 1] - p[j + 1]), smaller(c[j + 2] - p[j + 2], c[j + 3] - p[j + 3])) >
           reduced)
      j += 4;
    while (c[j] - p[j] > reduced) ++j;
    return j;
  }
  /// The same from the first column on while no column has a price.
  [[nodiscard]] static std::ptrdiff_t find(const double* c, double least) noexcept {
    std::ptrdiff_t j = 0;
    while (smaller(smaller(c[j], c[j + 1]), smaller(c[j + 2], c[j + 3])) > least) j += 4;
    while (c[j] > least) ++j;
    return j;
  }

  /// Every row takes its cheapest column while that is free. Returns how many rows are left in the queue. In a frame of
  /// boxes that barely overlap this settles nearly all.
  std::size_t greet(const double* row_least) noexcept {
    std::size_t left = 0;
    for (std::size_t k = 0; k < rows_; ++k) {
      const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(k);
      const double least = row_least[k];
      if (!(least < gate_)) continue;
      const std::ptrdiff_t j = find(costs(row), least);
      if (at(w_.row_of_column, j) != nobody) {
        w_.queue[left++] = row;
        continue;
      }
      at(w_.row_of_column, j) = row;
      at(w_.column_of_row, row) = j;
    }
    return left;
  }

  /// Rows bid for their best column, lowering its price by what the second best leaves. Returns how many rows are left
  /// in the queue: those of a tie, and what the bounded number of bids did not settle.
  std::size_t bid(std::size_t waiting) noexcept {
    std::size_t left = 0;
    std::size_t bids = 4 * rows_;
    for (std::size_t k = 0; k < waiting; ++k) {
      std::ptrdiff_t row = w_.queue[k];
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

  /// Distances of all open columns through one more row, whose own distance is `offset` above its value. Returns the
  /// smallest.
  [[nodiscard]] double relax(std::ptrdiff_t row, double offset) noexcept {
    const double* c = costs(row);
    const double* p = w_.open_price.data();  // -infinity where closed, so that the sum below is infinite there
    double* d = w_.distance.data();
    double l0 = infinity, l1 = infinity, l2 = infinity, l3 = infinity;
    for (std::size_t j = 0; j < stride_; j += assignment_lanes) {
      d[j] = smaller(d[j], (c[j] - p[j]) + offset);
      d[j + 1] = smaller(d[j + 1], (c[j + 1] - p[j + 1]) + offset);
      d[j + 2] = smaller(d[j + 2], (c[j + 2] - p[j + 2]) + offset);
      d[j + 3] = smaller(d[j + 3], (c[j + 3] - p[j + 3]) + offset);
      l0 = smaller(l0, d[j]);
      l1 = smaller(l1, d[j + 1]);
      l2 = smaller(l2, d[j + 2]);
      l3 = smaller(l3, d[j + 3]);
    }
    return smaller(smaller(l0, l1), smaller(l2, l3));
  }

  /// The open column at that distance: the first free one, else the first.
  [[nodiscard]] std::ptrdiff_t nearest(double distance) const noexcept {
    const double* d = w_.distance.data();
    std::ptrdiff_t first = nobody;
    for (std::size_t j = 0; j < stride_; ++j) {
      if (d[j] != distance) continue;
      if (w_.row_of_column[j] == nobody) return static_cast<std::ptrdiff_t>(j);
      if (first == nobody) first = static_cast<std::ptrdiff_t>(j);
    }
    return first;
  }

  /// Dijkstra from a row without a pair to the nearest free column, or to the dummy of any row on the way.
  void augment(std::ptrdiff_t start) noexcept {
    std::fill(w_.distance.begin(), w_.distance.begin() + static_cast<std::ptrdiff_t>(stride_), infinity);
    std::copy(w_.price.begin(), w_.price.begin() + static_cast<std::ptrdiff_t>(stride_), w_.open_price.begin());
    w_.visits[0] = {start, nobody, 0, 0};
    std::size_t visits = 1, alone = 0;  // alone: the visit whose dummy is the nearest so far
    double dummy = gate_, length = 0;
    std::ptrdiff_t sink = nobody;
    for (;;) {
      const double least = relax(w_.visits[visits - 1].row, w_.visits[visits - 1].offset);
      length = (std::min)(least, dummy);
      if (dummy <= least) break;
      const std::ptrdiff_t j = nearest(least);
      const std::ptrdiff_t row = at(w_.row_of_column, j);
      if (row == nobody) {
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
    flip(sink, sink == nobody ? alone : visits);
    for (std::size_t k = 1; k < visits; ++k)
      at(w_.price, w_.visits[k].column) += (std::min)(w_.visits[k].distance - length, 0.0);
  }

  /// Swaps the pairs along the shortest path that ends in column `sink`, or in the dummy of visit `end` when there is
  /// no sink.
  void flip(std::ptrdiff_t sink, std::size_t end) noexcept {
    std::ptrdiff_t j = sink;
    if (sink == nobody) {
      at(w_.column_of_row, w_.visits[end].row) = nobody;
      j = w_.visits[end].column;
    }
    while (j !=
           nobody) {  // the row before a column is the one that gave it its distance, visited before the column closed
      std::size_t best = 0;
      double least = infinity;
      for (std::size_t k = 0; k < end; ++k) {
        const double through = (costs(w_.visits[k].row)[j] - at(w_.price, j)) + w_.visits[k].offset;
        if (!(through < least)) continue;
        least = through;
        best = k;
      }
      const auto& visit = w_.visits[best];
      at(w_.row_of_column, j) = visit.row;
      at(w_.column_of_row, visit.row) = j;
      j = visit.column;
      end = best;
    }
  }

  Workspace& w_;
  std::size_t rows_, stride_;
  double gate_;
};

}  // namespace detail
}  // namespace cfp
