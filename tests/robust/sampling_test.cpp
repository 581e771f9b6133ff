#include "cfp/robust/ransac.hpp"

#include <array>
#include <limits>
#include <set>
#include <vector>

#include "support/allocation_counter.hpp"
#include "support/catch.hpp"

TEST_CASE("Samples are distinct and in range with and without weights", "[robust]") {
  cfp::Random random(1, "sampling");
  for (const bool weighted : {false, true}) {
    for (const std::size_t n : {7U, 8U, 50U}) {
      std::vector<double> weights(weighted ? n : 0), sums;
      for (double& w : weights) w = random.uniform(0.001, 1);
      cfp::sum_weights(weights, sums);
      for (int i = 0; i < 500; ++i) {
        std::array<std::uint32_t, 7> sample{};
        REQUIRE(cfp::draw_sample(n, sums, random, sample));
        CHECK(std::set<std::uint32_t>(sample.begin(), sample.end()).size() == 7);
        for (const std::uint32_t k : sample) CHECK(k < n);
      }
    }
  }
}

TEST_CASE("Weighted draws come in proportion to the weights", "[robust]") {
  const std::vector<double> weights{1, 2, 3, 4, 0.5, 5.5};
  std::vector<double> sums;
  cfp::sum_weights(weights, sums);
  cfp::Random random(2, "sampling");
  std::array<double, 6> counts{};
  constexpr int draws = 200000;
  for (int i = 0; i < draws; ++i) {
    std::array<std::uint32_t, 1> k{};
    REQUIRE(cfp::draw_sample(weights.size(), sums, random, k));
    counts[k[0]] += 1;
  }
  for (std::size_t i = 0; i < weights.size(); ++i) CHECK_THAT(counts[i] / draws, WithinAbs(weights[i] / 16, 0.004));
}

TEST_CASE("Weights of any scale and inequality still give samples", "[robust]") {
  cfp::Random random(3, "sampling");
  for (const std::vector<double>& weights :
       {std::vector<double>{1e-310, 1e-310, 1e-310}, {1e308, 1e308, 1e308}, {1e308, 1e-308, 1e-308}, {5e-324, 1, 1}}) {
    std::vector<double> sums;
    cfp::sum_weights(weights, sums);
    std::array<std::uint32_t, 3> sample{};
    REQUIRE(cfp::draw_sample(3, sums, random, sample));
    CHECK(std::set<std::uint32_t>(sample.begin(), sample.end()).size() == 3);
  }
}

TEST_CASE("The number of draws follows the confidence formula and its limits", "[robust]") {
  CHECK(cfp::ransac_iterations(0.6, 7, 0.99, 1000) == 163);  // log(0.01) / log(1 - 0.6^7) = 162.2
  CHECK(cfp::ransac_iterations(0.4, 3, 0.99, 1000) == 70);   // log(0.01) / log(1 - 0.4^3) = 69.6
  CHECK(cfp::ransac_iterations(1.0, 7, 0.99, 1000) == 1);
  CHECK(cfp::ransac_iterations(0.0, 7, 0.99, 1000) == 1000);
  CHECK(cfp::ransac_iterations(-1.0, 7, 0.99, 1000) == 1000);
  CHECK(cfp::ransac_iterations(std::numeric_limits<double>::quiet_NaN(), 7, 0.99, 1000) == 1000);
}

TEST_CASE("Fewer data than a sample holds give no sample, with and without weights", "[robust]") {
  cfp::Random random(6, "sampling");
  std::vector<double> sums;
  for (const std::vector<double>& weights : {std::vector<double>{}, std::vector<double>{1, 2, 3}}) {
    std::array<std::uint32_t, 7> sample{};
    sample.fill(99);
    cfp::sum_weights(weights, sums);
    CHECK_FALSE(cfp::draw_sample(3, sums, random, sample));
    CHECK(sample[0] == 99);
    std::array<std::uint32_t, 3> all{};
    for (int i = 0; i < 10; ++i) CHECK(cfp::draw_sample(3, sums, random, all));
  }
}

TEST_CASE("Sampling from as many data as its memory has seen allocates nothing", "[robust]") {
  const std::vector<double> weights(200, 1.0), none;
  std::vector<double> sums;
  const auto draw = [&](const std::vector<double>& given) {
    cfp::sum_weights(given, sums);
    cfp::Random random(5);
    std::array<std::uint32_t, 7> sample{};
    for (int i = 0; i < 100; ++i) (void)cfp::draw_sample(200, sums, random, sample);
  };
  draw(weights);
  for (const std::vector<double>* given : {&weights, &none})
    CHECK(cfp_test::allocations_in([&] { draw(*given); }) == 0);
}
