#include "support/generators.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "cfp/detection/assignment.hpp"
#include "cfp_testing/assignment_gap.hpp"
#include "support/brute_force_assignment.hpp"

namespace {

/// Costs with many ties, some forbidden.
std::vector<double> costs_of(std::size_t size) {
  return *rc::gen::container<std::vector<double>>(size, rc::gen::map(rc::gen::inRange(-3, 13), [](int k) {
                                                    return k == 12 ? std::numeric_limits<double>::infinity() : 0.25 * k;
                                                  }));
}

}  // namespace

TEST_CASE("Properties of the assignment", "[properties]") {
  rc::prop("the objective equals brute force", [] {
    const std::size_t rows = *rc::gen::inRange<std::size_t>(0, 6), cols = *rc::gen::inRange<std::size_t>(0, 6);
    const std::vector<double> values = costs_of(rows * cols);
    const double gate = *rc::gen::element(std::numeric_limits<double>::infinity(), 3.0, 1.0, 0.5, 0.0);
    const cfp::CostMatrix costs(values, rows, cols);
    cfp::AssignmentWorkspace workspace;
    std::vector<int> columns(rows);
    const cfp::AssignmentResult result = cfp::solve_assignment(costs, gate, workspace, columns);
    const cfp_test::BestAssignment best = cfp_test::brute_force_assignment(costs, gate);
    if (std::isinf(gate)) {
      RC_ASSERT(result.pairs == best.pairs);
      RC_ASSERT(std::abs(result.cost - best.cost) < 1e-12);
    } else {
      const double ours = result.cost - gate * static_cast<double>(result.pairs),
                   theirs = best.cost - gate * static_cast<double>(best.pairs);
      RC_ASSERT(std::abs(ours - theirs) < 1e-12);
    }
    RC_ASSERT(std::abs(cfp_testing::assignment_gap(costs, gate, columns, workspace.column_saving)) < 1e-12);
  });

  rc::prop("permuting and transposing the matrix does not change the cost", [] {
    const std::size_t rows = *rc::gen::inRange<std::size_t>(1, 20), cols = *rc::gen::inRange<std::size_t>(1, 20);
    const std::vector<double> values = costs_of(rows * cols);
    const double gate = *rc::gen::element(std::numeric_limits<double>::infinity(), 2.0, 0.5);
    std::vector<std::size_t> row_order(rows), col_order(cols);
    std::iota(row_order.begin(), row_order.end(), 0);
    std::iota(col_order.begin(), col_order.end(), 0);
    for (std::size_t i = rows; i > 1; --i) std::swap(row_order[i - 1], row_order[*rc::gen::inRange<std::size_t>(0, i)]);
    for (std::size_t j = cols; j > 1; --j) std::swap(col_order[j - 1], col_order[*rc::gen::inRange<std::size_t>(0, j)]);
    std::vector<double> permuted(rows * cols), transposed(rows * cols);
    for (std::size_t i = 0; i < rows; ++i) {
      for (std::size_t j = 0; j < cols; ++j) {
        permuted[i * cols + j] = values[row_order[i] * cols + col_order[j]];
        transposed[j * rows + i] = values[i * cols + j];
      }
    }
    cfp::AssignmentWorkspace workspace;
    std::vector<int> columns(rows), flipped(cols);
    const auto objective = [&](const cfp::AssignmentResult& r) {
      return r.cost - (std::isinf(gate) ? 1e3 : gate) * static_cast<double>(r.pairs);
    };
    const double a = objective(cfp::solve_assignment(cfp::CostMatrix(values, rows, cols), gate, workspace, columns));
    const double b = objective(cfp::solve_assignment(cfp::CostMatrix(permuted, rows, cols), gate, workspace, columns));
    const double c =
        objective(cfp::solve_assignment(cfp::CostMatrix(transposed, cols, rows), gate, workspace, flipped));
    RC_ASSERT(std::abs(a - b) < 1e-9);
    RC_ASSERT(std::abs(a - c) < 1e-9);
  });

  rc::prop("it ends on any doubles, with an assignment of allowed pairs", [] {
    const std::size_t rows = *rc::gen::inRange<std::size_t>(0, 12), cols = *rc::gen::inRange<std::size_t>(0, 12);
    std::vector<double> values(rows * cols);
    for (double& v : values) v = cfp_test::any_number();
    const double gate = cfp_test::any_number();
    const cfp::CostMatrix costs(values, rows, cols);
    cfp::AssignmentWorkspace workspace;
    std::vector<int> columns(rows);
    const cfp::AssignmentResult result = cfp::solve_assignment(costs, gate, workspace, columns);
    RC_ASSERT(result.status == (gate == gate ? cfp::Status::ok : cfp::Status::invalid_input));
    RC_ASSERT(std::isfinite(result.cost));
    std::vector<int> used(cols, 0);
    for (std::size_t i = 0; i < rows; ++i) {
      if (columns[i] == cfp::unassigned) continue;
      RC_ASSERT(++used[static_cast<std::size_t>(columns[i])] == 1);
      RC_ASSERT(costs(i, static_cast<std::size_t>(columns[i])) < gate);
    }
  });
}
