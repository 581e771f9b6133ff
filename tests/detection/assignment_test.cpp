#include "cfp/detection/assignment.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp_testing/assignment_gap.hpp"
#include "support/allocation_counter.hpp"
#include "support/brute_force_assignment.hpp"
#include "support/catch.hpp"
#include "support/numbers.hpp"

using cfp_test::nan_value;

namespace {

constexpr double inf = std::numeric_limits<double>::infinity();

/// The objective of the header, for comparison with the oracle.
double objective(double cost, std::size_t pairs, double gate) { return cost - gate * static_cast<double>(pairs); }

enum class Kind { uniform, integer_ties, overlap, negative, sparse };

template <typename Scalar>
std::vector<Scalar> random_costs(cfp::Random& random, std::size_t size, Kind kind) {
  std::vector<Scalar> costs(size);
  for (Scalar& c : costs) {
    switch (kind) {
      case Kind::uniform:
        c = Scalar(random.uniform());
        break;
      case Kind::integer_ties:
        c = Scalar(random.index(4));
        break;
      case Kind::overlap:
        c = random.uniform() < 0.7 ? Scalar(1) : Scalar(random.uniform());
        break;
      case Kind::negative:
        c = Scalar(random.normal());
        break;
      case Kind::sparse:
        c = random.uniform() < 0.6 ? Scalar(inf)
                                   : (random.uniform() < 0.2 ? Scalar(nan_value) : Scalar(random.uniform()));
        break;
    }
  }
  return costs;
}

}  // namespace

TEMPLATE_TEST_CASE("The assignment is optimal: brute force up to 6 x 7, all gates", "[detection]", float, double) {
  cfp::Random random(1, "assignment brute force");
  cfp::AssignmentWorkspace workspace;
  for (const Kind kind : {Kind::uniform, Kind::integer_ties, Kind::overlap, Kind::negative, Kind::sparse}) {
    for (int repetition = 0; repetition < 300; ++repetition) {
      const std::size_t rows = random.index(7), cols = random.index(repetition % 10 == 0 ? 8 : 6);
      const std::vector<TestType> values = random_costs<TestType>(random, rows * cols, kind);
      const cfp::CostMatrix costs(values, rows, cols);
      for (const double gate : {inf, 1e300, 2.0, 0.5, 0.1, -0.5, -inf}) {
        std::vector<int> columns(rows, 77);
        const cfp::AssignmentResult result = cfp::solve_assignment(costs, gate, workspace, columns);
        const cfp_test::BestAssignment best = cfp_test::brute_force_assignment(costs, gate);
        CAPTURE(static_cast<int>(kind), repetition, rows, cols, gate);
        REQUIRE(result.status == cfp::Status::ok);
        if (gate > 1e200) {
          REQUIRE(result.pairs == best.pairs);
          REQUIRE_THAT(result.cost, WithinAbs(best.cost, 1e-12));
        } else if (gate > -inf) {
          REQUIRE_THAT(objective(result.cost, result.pairs, gate),
                       WithinAbs(objective(best.cost, best.pairs, gate), 1e-12));
        } else {
          REQUIRE(result.pairs == 0);
        }
        REQUIRE(std::abs(cfp_testing::assignment_gap(costs, gate, columns, workspace.column_saving)) < 1e-12);
        double cost = 0;
        for (std::size_t i = 0; i < rows; ++i) {
          if (columns[i] == cfp::unassigned) continue;
          const double c = static_cast<double>(costs(i, static_cast<std::size_t>(columns[i])));
          REQUIRE(c < gate);
          cost += c;
        }
        REQUIRE_THAT(cost, WithinAbs(result.cost, 1e-12));
      }
    }
  }
}

TEST_CASE("The optimum is scipy's", "[detection]") {
  std::ifstream file(std::string(CFP_SOURCE_DIR) +
                     "/tests/data/assignment_scipy.csv");  // tests/data/generate_assignment_scipy.py
  REQUIRE(file);
  cfp::AssignmentWorkspace workspace;
  int problems = 0;
  for (std::string line; std::getline(file, line);) {
    if (line[0] == '#') continue;
    std::stringstream fields(line);
    std::vector<double> numbers;
    for (std::string field; std::getline(fields, field, ',');) numbers.push_back(std::stod(field));
    const std::size_t rows = static_cast<std::size_t>(numbers[0]), cols = static_cast<std::size_t>(numbers[1]);
    const double gate = numbers[2];
    const std::vector<double> values(numbers.begin() + 4, numbers.end());
    REQUIRE(values.size() == rows * cols);
    std::vector<int> columns(rows);
    const cfp::AssignmentResult result =
        cfp::solve_assignment(cfp::CostMatrix(values, rows, cols), gate, workspace, columns);
    const double left_out = static_cast<double>((std::min)(rows, cols) - result.pairs);
    CAPTURE(problems, rows, cols, gate);
    CHECK_THAT(result.cost + (left_out > 0 ? gate * left_out : 0.0), WithinAbs(numbers[3], 1e-12));
    ++problems;
  }
  CHECK(problems == 63);
}

TEST_CASE("Large assignments carry a proof: the duality gap vanishes", "[detection]") {
  cfp::Random random(2, "assignment duality");
  cfp::AssignmentWorkspace workspace;
  for (const auto& [rows, cols] :
       {std::pair<std::size_t, std::size_t>{60, 60}, {40, 90}, {90, 40}, {200, 200}, {1, 300}, {300, 1}}) {
    for (const Kind kind : {Kind::uniform, Kind::integer_ties, Kind::overlap, Kind::negative, Kind::sparse}) {
      const std::vector<double> values = random_costs<double>(random, rows * cols, kind);
      const cfp::CostMatrix costs(values, rows, cols);
      for (const double gate : {inf, 0.7, 0.02}) {
        std::vector<int> columns(rows);
        const cfp::AssignmentResult result = cfp::solve_assignment(costs, gate, workspace, columns);
        CAPTURE(rows, cols, static_cast<int>(kind), gate);
        CHECK(std::abs(cfp_testing::assignment_gap(costs, gate, columns, workspace.column_saving)) < 1e-9);
        if (kind == Kind::uniform && gate == inf) CHECK(result.pairs == (std::min)(rows, cols));
      }
    }
  }
}

TEST_CASE("The verifier refuses what is not optimal or not an assignment", "[detection]") {
  const std::vector<double> values{0.1, 0.5, 0.2, 0.9, 0.8, inf};
  const cfp::CostMatrix costs(values, 2, 3);
  cfp::AssignmentWorkspace workspace;
  std::array<int, 2> columns{};
  cfp::solve_assignment(costs, 1.0, workspace, columns);
  CHECK(columns == std::array<int, 2>{0, 1});  // 0.1 + 0.8 equals 0.2 + 0.9 - 0.2
  CHECK(cfp_testing::assignment_gap(costs, 1.0, columns, workspace.column_saving) < 1e-15);
  const auto gap = [&](int a, int b) {
    return cfp_testing::assignment_gap(costs, 1.0, std::array<int, 2>{a, b}, workspace.column_saving);
  };
  CHECK_THAT(gap(0, -1), WithinAbs(0.2, 1e-12));
  CHECK_THAT(gap(1, 0), WithinAbs(0.5, 1e-12));
  CHECK_THAT(gap(-1, -1), WithinAbs(1.1, 1e-12));
  CHECK(gap(0, 0) == inf);
  CHECK(gap(0, 2) == inf);
  CHECK(gap(0, 3) == inf);
  CHECK(gap(-2, 0) == inf);
  // Any savings give a valid bound: never below the true gap.
  for (const std::vector<double>& saving : {std::vector<double>{0, 0, 0}, {nan_value, -1, 5}, {0.3, 0.3, 0.3}}) {
    CHECK(cfp_testing::assignment_gap(costs, 1.0, std::array<int, 2>{0, -1}, saving) >= 0.2 - 1e-12);
  }
}

TEST_CASE("The gate is the price of a pair left out", "[detection]") {
  // Two pairs for 0.9 + 0.9 or one for 0.1: with gate 1 two pairs save 0.2, one saves 0.9.
  const std::vector<double> values{0.1, 0.9, 0.9, inf};
  const cfp::CostMatrix costs(values, 2, 2);
  cfp::AssignmentWorkspace workspace;
  std::array<int, 2> columns{};
  cfp::solve_assignment(costs, 1.0, workspace, columns);
  CHECK(columns == std::array<int, 2>{0, -1});
  cfp::solve_assignment(costs, 2.0, workspace, columns);
  CHECK(columns == std::array<int, 2>{1, 0});
  cfp::solve_assignment(costs, 0.1, workspace, columns);  // a pair at the gate is not taken
  CHECK(columns == std::array<int, 2>{-1, -1});
}

TEST_CASE("Hostile costs end: NaN, infinities, extremes, empty", "[detection]") {
  cfp::AssignmentWorkspace workspace;
  cfp::Random random(3, "assignment hostile");
  const std::array<double, 13> extremes{nan_value, inf,     -inf, 1.7e308, -1.7e308, 1e200, -1e200,
                                        5e-324,    -5e-324, 0.0,  -0.0,    1.0,      1e-300};
  for (int repetition = 0; repetition < 2000; ++repetition) {
    const std::size_t rows = random.index(6), cols = random.index(6);
    std::vector<double> values(rows * cols);
    for (double& c : values) c = extremes[random.index(13)];
    std::vector<int> columns(rows);
    const double gate = extremes[random.index(13)];
    const cfp::CostMatrix costs(values, rows, cols);
    const cfp::AssignmentResult result = cfp::solve_assignment(costs, gate, workspace, columns);
    REQUIRE(result.status == (gate == gate ? cfp::Status::ok : cfp::Status::invalid_input));
    for (std::size_t i = 0; i < rows; ++i) {
      if (columns[i] == cfp::unassigned) continue;
      const double c = costs(i, static_cast<std::size_t>(columns[i]));
      REQUIRE((c < gate && std::abs(c) <= 1e200));
    }
    if (gate == gate) REQUIRE(cfp_testing::assignment_gap(costs, gate, columns, workspace.column_saving) < 1e186);
    REQUIRE(cfp::is_finite(result.cost));
    const std::size_t most = cfp_test::brute_force_assignment(costs, inf).pairs;
    cfp::solve_assignment(costs, inf, workspace, columns);
    REQUIRE(static_cast<std::size_t>(std::count_if(columns.begin(), columns.end(), [](int j) { return j >= 0; })) ==
            most);
  }
}

TEST_CASE("Empty matrices need no memory", "[detection]") {
  for (const auto& [rows, cols] : {std::pair<std::size_t, std::size_t>{0, 0}, {0, 3}, {3, 0}}) {
    cfp::AssignmentWorkspace fresh;
    std::vector<int> columns(rows, 5);
    const cfp::AssignmentResult result =
        cfp::solve_assignment(cfp::CostMatrix(std::vector<double>{}, rows, cols), 1.0, fresh, columns);
    CHECK(result.status == cfp::Status::ok);
    CHECK(columns == std::vector<int>(rows, cfp::unassigned));
    CHECK(cfp_testing::assignment_gap(cfp::CostMatrix(std::vector<double>{}, rows, cols), 1.0, columns,
                                      fresh.column_saving) == 0);
  }
}

TEST_CASE("Equal input gives equal assignments, and warm calls allocate nothing", "[detection]") {
  cfp::Random random(4, "assignment repeat");
  const std::vector<double> values = random_costs<double>(random, 30 * 40, Kind::integer_ties);
  cfp::AssignmentWorkspace warm, fresh;
  std::vector<int> first(40), second(40), third(30);
  cfp::solve_assignment(cfp::CostMatrix(values, 40, 30), 2.5, warm, first);
  cfp::solve_assignment(cfp::CostMatrix(values, 30, 40), 2.5, warm, third);
  CHECK(cfp_test::allocations_in([&] {
          cfp::solve_assignment(cfp::CostMatrix(values, 40, 30), 2.5, warm, second);
          cfp::solve_assignment(cfp::CostMatrix(values, 30, 40), inf, warm, third);
        }) == 0);
  CHECK(first == second);
  cfp::solve_assignment(cfp::CostMatrix(values, 40, 30), 2.5, fresh, second);
  CHECK(first == second);
}
