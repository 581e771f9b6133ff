#include "cfp/optimization/least_squares.hpp"

#include <limits>
#include <string>
#include <vector>

#include "cfp/core/types.hpp"
#include "support/catch.hpp"

namespace {

// A problem whose steps have the gains it is told, and which writes down the dampings it is asked for.
struct Script {
  std::vector<double> gains, dampings;
  double cost = 1e6;

  double linearize() const { return cost; }
  double propose(double damping) {
    dampings.push_back(damping);
    return 1;
  }
  double linearize_trial() const { return cost - gains[dampings.size() - 1]; }
  void accept() { cost = linearize_trial(); }
};

cfp::LeastSquaresResult follow(Script& script, cfp::LevenbergMarquardtOptions options) {
  options.max_iterations = static_cast<int>(script.gains.size());
  options.min_relative_decrease = options.min_absolute_decrease = 0;
  return minimize_least_squares(script, options);
}

const double nan_gain = std::numeric_limits<double>::quiet_NaN();

}  // namespace

TEST_CASE("The damping follows Nielsen's rule", "[optimization][least_squares]") {
  cfp::LevenbergMarquardtOptions options;
  options.initial_damping = 1;
  Script script{{1, 0.5, 0.25, 0, nan_gain, -1, 1e5, 1}, {}};
  const cfp::LeastSquaresResult result = follow(script, options);
  const double peak = 1.125 / 3 * 2 * 4 * 8,
               expected[] = {1, 1.0 / 3, 1.0 / 3, 1.125 / 3, 1.125 / 3 * 2, 1.125 / 3 * 2 * 4, peak, peak / 3};
  REQUIRE(script.dampings.size() == 8);
  for (std::size_t i = 0; i < 8; ++i) CHECK_THAT(script.dampings[i], WithinAbs(expected[i], 1e-12));
  CHECK(result.accepted == 5);
  CHECK(result.status == cfp::SolverStatus::iteration_limit);
}

TEST_CASE("The damping stays in its range, and a refusal at the limit ends the loop", "[optimization][least_squares]") {
  cfp::LevenbergMarquardtOptions options;
  options.min_damping = 0.5;
  options.initial_damping = 1;
  options.max_damping = 4;
  Script script{{1, 1, 1, 1, 1, -1, -1, -1, 1, 1}, {}};
  const cfp::LeastSquaresResult result = follow(script, options);
  CHECK(script.dampings == std::vector<double>{1, 0.5, 0.5, 0.5, 0.5, 0.5, 1, 4});
  CHECK(result.status == cfp::SolverStatus::no_decrease);
}

TEST_CASE("A refused step raises the damping to its floor, and small damping falls to the minimum",
          "[optimization][least_squares]") {
  cfp::LevenbergMarquardtOptions options;
  options.initial_damping = 0;
  options.min_damping = 0;
  options.rejected_damping = 1e-3;
  Script script{{-1, -1, 1, 1, 1}, {}};
  (void)follow(script, options);
  CHECK(script.dampings == std::vector<double>{0, 1e-3, 4e-3, 4e-3 * (1.0 / 3), 0});
}

TEST_CASE("A step that was damped tells of no minimum by how little it brings", "[optimization][least_squares]") {
  cfp::LevenbergMarquardtOptions options;
  options.initial_damping = 1;
  options.min_relative_decrease = 1e-4;
  Script script{{-1, 0.05, 1, 1, 0.05, 1}, {}, 1e3};
  const cfp::LeastSquaresResult result = minimize_least_squares(script, options);
  CHECK(result.status == cfp::SolverStatus::converged);
  CHECK(result.iterations == 5);  // the first below the damping of the start that brings less than 1e-4
  CHECK(script.dampings[1] > 1);
  CHECK(script.dampings[4] < 1);
}

namespace {

// Rosenbrock's valley, r = (1 - x, 10 (y - x^2)), from the far side.
struct Valley {
  int evaluations = 0;
  double linearize(const cfp::Vector2<double>& p, cfp::detail::NormalEquations<2>& equations) {
    ++evaluations;
    Eigen::Matrix2d J;
    J.row(0) = cfp::Vector2<double>(-1, 0);
    J.row(1) = cfp::Vector2<double>(-20 * p.x(), 10);
    const cfp::Vector2<double> r(1 - p.x(), 10 * (p.y() - p.x() * p.x()));
    equations.H = J.transpose() * J;
    equations.g = J.transpose() * r;
    return r.squaredNorm();
  }
  static cfp::Vector2<double> moved(const cfp::Vector2<double>& p, const cfp::Vector2<double>& step) {
    return p + step;
  }
};

template <typename Model>
cfp::LeastSquaresResult minimize(Model& model, cfp::Vector2<double>& p, double damping, int iterations = 100) {
  cfp::LevenbergMarquardtOptions options;
  options.initial_damping = options.min_damping = damping;
  options.max_iterations = iterations;
  cfp::detail::DenseLeastSquares<2, cfp::Vector2<double>, Model> problem{model, p};
  const cfp::LeastSquaresResult result = minimize_least_squares(problem, options);
  p = problem.state;
  return result;
}

}  // namespace

TEST_CASE("The loop finds the end of Rosenbrock's valley with and without damping", "[optimization][least_squares]") {
  for (const double damping : {0.0, 1e-4}) {
    Valley valley;
    cfp::Vector2<double> p(-1.2, 1);
    const cfp::LeastSquaresResult result = minimize(valley, p, damping);
    CHECK(result.status == cfp::SolverStatus::converged);
    CHECK_THAT(result.initial_cost, WithinAbs(24.2, 1e-12));
    CHECK(result.final_cost < 1e-9);
    CHECK((p - cfp::Vector2<double>(1, 1)).norm() < 1e-4);
    CHECK(result.accepted <= result.iterations);
    CHECK(valley.evaluations <= result.iterations + 1);
  }
}

TEST_CASE("The cost never rises, however early the loop is stopped", "[optimization][least_squares]") {
  double last = 24.2;
  for (int iterations = 1; iterations < 20; ++iterations) {
    Valley valley;
    cfp::Vector2<double> p(-1.2, 1);
    const cfp::LeastSquaresResult result = minimize(valley, p, 0, iterations);
    CHECK(result.final_cost <= last);
    cfp::detail::NormalEquations<2> equations;
    CHECK(valley.linearize(p, equations) == result.final_cost);
    last = result.final_cost;
  }
}

TEST_CASE("A system without a solution is degenerate, a start without a cost is refused",
          "[optimization][least_squares]") {
  struct Flat : Valley {
    double linearize(const cfp::Vector2<double>&, cfp::detail::NormalEquations<2>& equations) {
      equations = {};
      equations.H(0, 0) = 1;
      return 1;
    }
  } flat;
  struct Infinite : Valley {
    double linearize(const cfp::Vector2<double>&, cfp::detail::NormalEquations<2>&) {
      return std::numeric_limits<double>::infinity();
    }
  } infinite;
  cfp::Vector2<double> p(3, 4);
  CHECK(minimize(flat, p, 0).status == cfp::SolverStatus::degenerate);
  CHECK(minimize(flat, p, 1e-8).status == cfp::SolverStatus::no_decrease);
  CHECK(minimize(infinite, p, 0).status == cfp::SolverStatus::not_finite);
  CHECK(p == cfp::Vector2<double>(3, 4));
}

TEST_CASE("A trial that has no cost is refused", "[optimization][least_squares]") {
  struct Wall : Valley {
    double linearize(const cfp::Vector2<double>& p, cfp::detail::NormalEquations<2>& equations) {
      const double cost = Valley::linearize(p, equations);
      return p.x() > -1 ? std::numeric_limits<double>::quiet_NaN() : cost;
    }
  } wall;
  cfp::Vector2<double> p(-1.2, 1);
  const cfp::LeastSquaresResult result = minimize(wall, p, 0);
  CHECK(p.x() <= -1);
  CHECK(result.final_cost < result.initial_cost);
}

TEST_CASE("Options outside their range are named", "[optimization][least_squares]") {
  using Options = cfp::LevenbergMarquardtOptions;
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  const auto bad = [](auto member, auto value) {
    Options options;
    options.*member = value;
    return invalid_field(options).string();
  };
  CHECK(!invalid_field(Options{}));
  CHECK(bad(&Options::max_iterations, -1) == "max_iterations");
  for (const double value : {0.0, -1.0, nan, inf}) {
    CHECK(bad(&Options::rejected_damping, value) == "rejected_damping");
    CHECK(bad(&Options::max_damping, value) == "max_damping");
  }
  for (const double value : {-1.0, nan, inf}) {
    CHECK(bad(&Options::initial_damping, value) == "initial_damping");
    CHECK(bad(&Options::min_damping, value) == "min_damping");
    CHECK(bad(&Options::min_relative_decrease, value) == "min_relative_decrease");
    CHECK(bad(&Options::min_absolute_decrease, value) == "min_absolute_decrease");
  }
  Options crossed;
  crossed.min_damping = 2 * crossed.max_damping;
  CHECK(invalid_field(crossed).string() == "max_damping");
}
