#include "cfp/clustering/adaptive.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "cfp/core/random.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"

namespace {

constexpr cfp::AdaptiveRule rules[] = {cfp::AdaptiveRule::foreground_density, cfp::AdaptiveRule::k_distance_median,
                                       cfp::AdaptiveRule::k_distance_knee, cfp::AdaptiveRule::kann,
                                       cfp::AdaptiveRule::fixed};

std::vector<double> random_depths(cfp::Random& random, std::size_t n) {
  std::vector<double> depths;
  for (std::size_t i = 0; i < n; ++i)
    depths.push_back(random.index(2) == 0 ? 2 + 0.1 * random.normal() : random.uniform(0.5, 6));
  std::sort(depths.begin(), depths.end());
  return depths;
}

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
  cfp::KDistanceWorkspace<double> workspace;
  for (int round = 0; round < 200; ++round) {
    const std::vector<double> values = random_depths(random, 2 + random.index(40));
    const std::size_t k = 1 + random.index(50), used = (std::min)(k, values.size() - 1);
    cfp::k_distances<double>(values, k, workspace);
    std::vector<double> expected;
    for (std::size_t i = 0; i < values.size(); ++i) {
      expected.push_back(sorted_distances(values, i)[used - 1]);
      REQUIRE(workspace.distances[i] == expected[i]);
    }
    std::sort(expected.begin(), expected.end());
    CHECK(cfp::median_k_distance<double>(values, k, workspace) == expected[expected.size() / 2]);
  }
}

TEST_CASE("The knee is the corner of a two-slope curve", "[clustering]") {
  // Twenty values 0.01 apart, then five 1 apart: with k = 1 the curve is flat at 0.01, then at 1; its corner is the
  // last small one.
  std::vector<double> values;
  for (int i = 0; i < 20; ++i) values.push_back(1 + 0.01 * i);
  for (int i = 0; i < 5; ++i) values.push_back(3 + i);
  cfp::KDistanceWorkspace<double> workspace;
  CHECK_THAT(cfp::knee_k_distance<double>(values, 1, workspace), WithinAbs(0.01, 1e-9));
}

TEST_CASE("KANN-DBSCAN takes mean k-distance and mean neighbour count of the largest K of the first stable run",
          "[clustering]") {
  cfp::Random random(22, "kann");
  cfp::KDistanceWorkspace<double> workspace;
  cfp::DbscanWorkspace<double> dbscan_workspace;
  for (int round = 0; round < 60; ++round) {
    const std::vector<double> values = random_depths(random, 10 + random.index(60));
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
      const std::size_t now = cfp::dbscan<double>(values, trial, dbscan_workspace, labels).clusters;
      if (run >= stable && now != before) break;
      run = run > 0 && now == before ? run + 1 : 1;
      before = now;
      expected = trial;
    }
    const cfp::DbscanOptions chosen = cfp::kann_options<double>(values, stable, max_k, {}, workspace);
    CHECK_THAT(chosen.eps, WithinAbs(expected.eps, 1e-12));
    CHECK(chosen.min_pts == expected.min_pts);
  }
}

TEST_CASE("The default's min_pts grows with n at unchanged shape", "[clustering]") {
  cfp::AdaptiveWorkspace<double> workspace;
  std::size_t before = 0;
  for (const int copies : {1, 2, 4, 8}) {
    std::vector<double> depths;
    for (int i = 0; i < 60; ++i)
      depths.insert(depths.end(), static_cast<std::size_t>(copies), i < 40 ? 2 + 0.01 * i : 5 + 0.01 * i);
    const cfp::DbscanOptions chosen = cfp::adaptive_options<double>(depths, {}, workspace);
    CHECK(chosen.min_pts > before);
    before = chosen.min_pts;
  }
}

TEMPLATE_TEST_CASE("Every rule keeps eps above the sensor's noise and survives hostile depths", "[clustering]", float,
                   double) {
  cfp::AdaptiveWorkspace<TestType> workspace;
  const TestType big = (std::numeric_limits<TestType>::max)(), tiny = std::numeric_limits<TestType>::denorm_min();
  const std::vector<std::vector<TestType>> inputs{{},
                                                  {TestType(1)},
                                                  {1, 1},
                                                  std::vector<TestType>(100, TestType(3)),
                                                  {tiny, tiny, 1, big},
                                                  {tiny, tiny, tiny, 2 * tiny},
                                                  {1, 2, 3, big, big, big},
                                                  {1, 1, 1, 1, 1, 1, 1, 1e30F}};
  for (const cfp::AdaptiveRule rule : rules) {
    for (const auto& input : inputs) {
      cfp::AdaptiveOptions options;
      options.rule = rule;
      const cfp::DbscanOptions chosen = cfp::adaptive_options<TestType>(input, options, workspace);
      CHECK(invalid_field(chosen) == nullptr);
    }
    if (rule == cfp::AdaptiveRule::fixed) continue;
    cfp::AdaptiveOptions stereo;
    stereo.rule = rule;
    stereo.noise = {0.0, 0.02, 0.0};
    const std::vector<TestType> far(50, TestType(10));
    CHECK(cfp::adaptive_options<TestType>(far, stereo, workspace).eps >= 3 * 0.02 * 100 - 1e-9);
  }
}

TEST_CASE("Adaptive options outside their range are named", "[clustering]") {
  CHECK(invalid_field(cfp::AdaptiveOptions{}) == nullptr);
  const auto named = [](auto change) {
    cfp::AdaptiveOptions options;
    change(options);
    const char* field = invalid_field(options);
    return std::string(field == nullptr ? "" : field);
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(named([&](auto& o) { o.fixed.eps = nan; }) == "eps");
  CHECK(named([&](auto& o) { o.noise.quadratic = -1; }) == "noise");
  CHECK(named([&](auto& o) { o.noise_factor = nan; }) == "noise_factor");
  CHECK(named([&](auto& o) { o.min_eps_m = 0; }) == "min_eps_m");
  CHECK(named([&](auto& o) { o.max_eps_m = 0.01; }) == "max_eps_m");
  CHECK(named([&](auto& o) { o.spacing_factor = nan; }) == "spacing_factor");
  CHECK(named([&](auto& o) { o.min_share = 1; }) == "min_share");
  CHECK(named([&](auto& o) { o.min_density = 0; }) == "min_density");
  CHECK(named([&](auto& o) { o.max_density = 0.01; }) == "max_density");
  CHECK(named([&](auto& o) { o.body_depth_m = nan; }) == "body_depth_m");
  CHECK(named([&](auto& o) { o.k_factor = 0; }) == "k_factor");
  CHECK(named([&](auto& o) { o.k_fraction = nan; }) == "k_fraction");
}

TEST_CASE("The noise model gives its published figure", "[clustering]") {
  CHECK_THAT(cfp::DepthNoise{}.sigma_m(3.0), WithinAbs(0.014044, 1e-9));
  CHECK_THAT(cfp::DepthNoise{}.sigma_m(0.4), WithinAbs(0.0012, 1e-12));
}

TEST_CASE("No rule allocates after warm-up", "[clustering]") {
  cfp::Random random(23, "allocation");
  const std::vector<double> first = random_depths(random, 600), second = random_depths(random, 500);
  for (const cfp::AdaptiveRule rule : rules) {
    cfp::AdaptiveWorkspace<double> workspace;
    cfp::AdaptiveOptions options;
    options.rule = rule;
    double keep = cfp::adaptive_options<double>(first, options, workspace).eps;
    CHECK(cfp_test::allocations_in([&] {
            keep += cfp::adaptive_options<double>(second, options, workspace).eps;
            keep += cfp::adaptive_options<double>(first, options, workspace).eps;
          }) == 0);
    CHECK(keep > 0);
  }
}
