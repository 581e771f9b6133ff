// The rules of the literature that the studies compare with (benchmarks/support/k_distance.hpp).
#include "../../benchmarks/support/k_distance.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "cfp/core/random.hpp"
#include "support/catch.hpp"
#include "support/random_depths.hpp"

namespace {

// All distances to the others, ascending; entry k - 1 is the k-distance.
std::vector<double> sorted_distances(const std::vector<double>& values, std::size_t of) {
  std::vector<double> distances;
  for (std::size_t j = 0; j < values.size(); ++j) {
    if (j != of) distances.push_back(std::abs(values[j] - values[of]));
  }
  std::sort(distances.begin(), distances.end());
  return distances;
}

}  // namespace

TEST_CASE("k-distances agree with sorting all distances", "[clustering]") {
  cfp::Random random(21, "k distances");
  for (int round = 0; round < 200; ++round) {
    const std::vector<double> values = cfp_test::random_depths(random, 2 + random.index(40));
    const std::size_t k = 1 + random.index(50), used = (std::min)(k, values.size() - 1);
    const std::vector<double> distances = cfp_study::k_distances(values, k);
    std::vector<double> expected;
    for (std::size_t i = 0; i < values.size(); ++i) {
      expected.push_back(sorted_distances(values, i)[used - 1]);
      REQUIRE(distances[i] == expected[i]);
    }
    std::sort(expected.begin(), expected.end());
    CHECK(cfp_study::median_k_distance(values, k) == expected[expected.size() / 2]);
  }
}

TEST_CASE("The knee is the corner of a two-slope curve", "[clustering]") {
  // Twenty values 0.01 apart, then five 1 apart: with k = 1 the curve is flat at 0.01, then at 1; its corner is the
  // last small one.
  std::vector<double> values;
  for (int i = 0; i < 20; ++i) values.push_back(1 + 0.01 * i);
  for (int i = 0; i < 5; ++i) values.push_back(3 + i);
  CHECK_THAT(cfp_study::knee_k_distance(values, 1), WithinAbs(0.01, 1e-9));
}

TEST_CASE("KANN-DBSCAN takes mean k-distance and mean neighbour count of the largest K of the first stable run",
          "[clustering]") {
  cfp::Random random(22, "kann");
  cfp::DbscanWorkspace<double> dbscan_workspace;
  for (int round = 0; round < 60; ++round) {
    const std::vector<double> values = cfp_test::random_depths(random, 10 + random.index(60));
    const std::size_t n = values.size(), max_k = n / 2, stable = 1 + random.index(6);
    // The definition, quadratic.
    cfp::DbscanOptions expected;
    std::size_t run = 0, before = 0;
    for (std::size_t k = 1; k <= max_k; ++k) {
      cfp::DbscanOptions trial{0.0, 0};
      for (std::size_t i = 0; i < n; ++i) trial.eps += sorted_distances(values, i)[k - 1] / static_cast<double>(n);
      double neighbours = 0;
      for (const double a : values) {
        for (const double b : values) neighbours += std::abs(a - b) <= trial.eps ? 1 : 0;
      }
      trial.min_pts = static_cast<std::size_t>(std::round(neighbours / static_cast<double>(n)));
      std::vector<int> labels(n);
      const std::size_t now = cfp::dbscan(values, trial, dbscan_workspace, labels).clusters;
      if (run >= stable && now != before) break;
      run = run > 0 && now == before ? run + 1 : 1;
      before = now;
      expected = trial;
    }
    const cfp::DbscanOptions chosen = cfp_study::kann_options(values, stable, max_k, {});
    CHECK_THAT(chosen.eps, WithinAbs(expected.eps, 1e-12));
    CHECK(chosen.min_pts == expected.min_pts);
  }
}
