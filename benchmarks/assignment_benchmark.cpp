// Rectangular assignment beside dlib (square integer matrices: costs x 1e6, padded). Inputs rotate, so that the branch
// predictor learns nothing. Quality: `cost` is the mean optimal cost, equal for both (dlib to 1e-6 per pair).
// benchmarks/peers/scipy_assignment.py times scipy on the same kinds of matrices.
#include <benchmark/benchmark.h>

#include <limits>
#include <utility>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/detection/assignment.hpp"
#include "cfp/geometry/box.hpp"

#ifdef CFP_HAVE_DLIB
#include <dlib/optimization/max_cost_assignment.h>
#endif

namespace {

/// 1 - IoU of boxes spread over an image against the same boxes moved, plus surplus boxes (kind 0), or uniform (kind
/// 1).
std::vector<std::vector<double>> problems(std::size_t rows, std::size_t cols, int kind) {
  std::vector<std::vector<double>> all(64);
  cfp::Random random(7, "assignment benchmark");
  for (std::vector<double>& costs : all) {
    std::vector<cfp::Box<double>> left(rows), right(cols);
    const auto random_box = [&] {
      const double x = random.uniform(0, 580), y = random.uniform(0, 380), w = random.uniform(30, 120),
                   h = random.uniform(60, 240);
      return cfp::Box<double>{x, y, x + w, y + h};
    };
    for (cfp::Box<double>& b : left) b = random_box();
    for (std::size_t j = 0; j < cols; ++j) {
      right[j] = random_box();
      if (j >= rows) continue;
      const double dx = 6 * random.normal(), dy = 6 * random.normal();
      right[j] = {left[j].x1 + dx, left[j].y1 + dy, left[j].x2 + dx, left[j].y2 + dy};
    }
    for (std::size_t j = cols; j > 1; --j) std::swap(right[j - 1], right[random.index(static_cast<std::uint32_t>(j))]);
    costs.resize(rows * cols);
    for (std::size_t i = 0; i < rows; ++i) {
      for (std::size_t j = 0; j < cols; ++j)
        costs[i * cols + j] = kind == 0 ? 1 - cfp::iou(left[i], right[j]) : random.uniform();
    }
  }
  return all;
}

void solve(benchmark::State& state, double gate) {
  const std::size_t rows = static_cast<std::size_t>(state.range(0)), cols = static_cast<std::size_t>(state.range(1));
  const std::vector<std::vector<double>> all = problems(rows, cols, static_cast<int>(state.range(2)));
  cfp::AssignmentWorkspace workspace;
  std::vector<int> columns(rows);
  std::size_t k = 0;
  double cost = 0;
  for (auto _ : state) {
    cost += cfp::solve_assignment(cfp::CostMatrix(all[k], rows, cols), gate, workspace, columns).cost;
    k = (k + 1) % all.size();
  }
  state.counters["cost"] = cost / static_cast<double>(state.iterations());
}

void cfp_most_pairs(benchmark::State& state) { solve(state, std::numeric_limits<double>::infinity()); }
void cfp_gated_0_7(benchmark::State& state) { solve(state, 0.7); }

#ifdef CFP_HAVE_DLIB
void dlib_max_cost(benchmark::State& state) {
  const long rows = state.range(0), cols = state.range(1);
  const std::vector<std::vector<double>> all =
      problems(static_cast<std::size_t>(rows), static_cast<std::size_t>(cols), static_cast<int>(state.range(2)));
  const long n = (std::max)(rows, cols);
  dlib::matrix<int> savings(n, n);
  std::size_t k = 0;
  double cost = 0;
  for (auto _ : state) {
    savings = 0;
    for (long i = 0; i < rows; ++i) {
      for (long j = 0; j < cols; ++j)
        savings(i, j) = static_cast<int>(1e6 - 1e6 * all[k][static_cast<std::size_t>(i * cols + j)] + 0.5);
    }
    const std::vector<long> columns = dlib::max_cost_assignment(savings);
    for (long i = 0; i < rows; ++i) {
      const long j = columns[static_cast<std::size_t>(i)];
      if (j < cols) cost += all[k][static_cast<std::size_t>(i * cols + j)];
    }
    k = (k + 1) % all.size();
  }
  state.counters["cost"] = cost / static_cast<double>(state.iterations());
}
#endif

void sizes(benchmark::internal::Benchmark* b) {
  for (const int kind : {0, 1}) {
    for (const auto& [rows, cols] :
         {std::pair<int, int>{5, 5}, {5, 8}, {10, 10}, {10, 15}, {50, 50}, {50, 80}, {200, 200}, {200, 300}})
      b->Args({rows, cols, kind});
  }
  b->ArgNames({"rows", "cols", "uniform"});
}

}  // namespace

BENCHMARK(cfp_most_pairs)->Apply(sizes);
BENCHMARK(cfp_gated_0_7)->Apply(sizes);
#ifdef CFP_HAVE_DLIB
BENCHMARK(dlib_max_cost)->Apply(sizes);
#endif
BENCHMARK_MAIN();
