#include "cfp/robust/sampling.hpp"

#include <array>
#include <limits>
#include <numeric>
#include <set>
#include <vector>

#include "support/allocation_counter.hpp"
#include "support/catch.hpp"

using cfp::MinimalSampler;
using cfp::Sampling;

TEST_CASE("Samples are distinct and in range for every policy", "[robust]") {
  cfp::Random random(1, "sampling");
  for (const Sampling policy : {Sampling::uniform, Sampling::weighted, Sampling::progressive}) {
    for (const std::size_t n : {7U, 8U, 50U}) {
      std::vector<double> weights(n);
      for (double& w : weights) w = random.uniform(0.001, 1);
      cfp::SamplingWorkspace workspace;
      MinimalSampler<7> sampler(n, weights, policy, 1000, workspace);
      for (int i = 0; i < 500; ++i) {
        std::array<std::uint32_t, 7> sample{};
        REQUIRE(sampler.draw(random, sample));
        CHECK(std::set<std::uint32_t>(sample.begin(), sample.end()).size() == 7);
        for (const std::uint32_t k : sample) CHECK(k < n);
      }
    }
  }
}

TEST_CASE("Weighted draws come in proportion to the weights", "[robust]") {
  const std::vector<double> weights{1, 2, 3, 4, 0.5, 5.5};
  cfp::SamplingWorkspace workspace;
  MinimalSampler<1> sampler(weights.size(), weights, Sampling::weighted, 1000, workspace);
  cfp::Random random(2, "sampling");
  std::array<double, 6> counts{};
  constexpr int draws = 200000;
  for (int i = 0; i < draws; ++i) {
    std::array<std::uint32_t, 1> k{};
    REQUIRE(sampler.draw(random, k));
    counts[k[0]] += 1;
  }
  for (std::size_t i = 0; i < weights.size(); ++i) CHECK_THAT(counts[i] / draws, WithinAbs(weights[i] / 16, 0.004));
}

TEST_CASE("Weights of any scale and inequality still give samples", "[robust]") {
  cfp::Random random(3, "sampling");
  for (const std::vector<double>& weights :
       {std::vector<double>{1e-310, 1e-310, 1e-310}, {1e308, 1e308, 1e308}, {1e308, 1e-308, 1e-308}, {5e-324, 1, 1}}) {
    cfp::SamplingWorkspace workspace;
    MinimalSampler<3> sampler(3, weights, Sampling::weighted, 1000, workspace);
    std::array<std::uint32_t, 3> sample{};
    REQUIRE(sampler.draw(random, sample));
    CHECK(std::set<std::uint32_t>(sample.begin(), sample.end()).size() == 3);
  }
}

TEST_CASE("Progressive samples begin with the best and end with all", "[robust]") {
  const std::size_t n = 100;
  std::vector<double> weights(n);
  for (std::size_t i = 0; i < n; ++i) weights[i] = static_cast<double>((i * 37) % n + 1);
  cfp::SamplingWorkspace workspace;
  MinimalSampler<3> sampler(n, weights, Sampling::progressive, 2000, workspace);
  cfp::Random random(4, "sampling");
  std::array<std::uint32_t, 3> sample{};
  REQUIRE(sampler.draw(random, sample));
  for (const std::uint32_t k : sample) CHECK(weights[k] > 97);
  std::set<std::uint32_t> seen;
  for (int i = 0; i < 5000; ++i) {
    REQUIRE(sampler.draw(random, sample));
    seen.insert(sample.begin(), sample.end());
  }
  CHECK(seen.size() == n);
}

TEST_CASE("The number of draws follows the confidence formula and its limits", "[robust]") {
  CHECK(cfp::ransac_iterations(0.6, 7, 0.99, 1000) == 163);  // log(0.01) / log(1 - 0.6^7) = 162.2
  CHECK(cfp::ransac_iterations(0.4, 3, 0.99, 1000) == 70);   // log(0.01) / log(1 - 0.4^3) = 69.6
  CHECK(cfp::ransac_iterations(1.0, 7, 0.99, 1000) == 1);
  CHECK(cfp::ransac_iterations(0.0, 7, 0.99, 1000) == 1000);
  CHECK(cfp::ransac_iterations(-1.0, 7, 0.99, 1000) == 1000);
  CHECK(cfp::ransac_iterations(std::numeric_limits<double>::quiet_NaN(), 7, 0.99, 1000) == 1000);
  // The first 20 of 100 are inliers: a prefix decides, where the whole set would ask for far more.
  std::vector<std::uint32_t> order(100);
  std::iota(order.begin(), order.end(), 0U);
  const auto first = [](std::uint32_t i) { return i < 20; };
  CHECK(cfp::progressive_ransac_iterations(order, first, 3, 0.99, 1000) == 1);
  CHECK(cfp::progressive_ransac_iterations(
            order, [](std::uint32_t) { return false; }, 3, 0.99, 1000) == 1000);
}

TEST_CASE("Fewer data than a sample holds give no sample, whatever the policy and the horizon", "[robust]") {
  cfp::Random random(6, "sampling");
  cfp::SamplingWorkspace workspace;
  const std::vector<double> weights{1, 2, 3};
  for (const Sampling policy : {Sampling::uniform, Sampling::weighted, Sampling::progressive}) {
    std::array<std::uint32_t, 7> sample{};
    sample.fill(99);
    MinimalSampler<7> sampler(3, weights, policy, 1000, workspace);
    CHECK_FALSE(sampler.draw(random, sample));
    CHECK(sample[0] == 99);
    MinimalSampler<3> whole(3, weights, policy, std::numeric_limits<std::size_t>::max(), workspace);
    std::array<std::uint32_t, 3> all{};
    for (int i = 0; i < 10; ++i) CHECK(whole.draw(random, all));
  }
}

TEST_CASE("A horizon beyond every number of draws keeps the best data for ever", "[robust]") {
  cfp::SamplingWorkspace workspace;
  MinimalSampler<3> sampler(1000, {}, Sampling::progressive, std::numeric_limits<std::size_t>::max(), workspace);
  cfp::Random random(7, "sampling");
  std::array<std::uint32_t, 3> sample{};
  for (int i = 0; i < 1000; ++i) {
    REQUIRE(sampler.draw(random, sample));
    for (const std::uint32_t k : sample) REQUIRE(k < 10);
  }
}

TEST_CASE("A sampler of a size that its workspace has seen allocates nothing", "[robust]") {
  std::vector<double> weights(200, 1.0);
  cfp::SamplingWorkspace workspace;
  const auto draw = [&](Sampling policy) {
    MinimalSampler<7> sampler(200, weights, policy, 1000, workspace);
    cfp::Random random(5);
    std::array<std::uint32_t, 7> sample{};
    for (int i = 0; i < 100; ++i) (void)sampler.draw(random, sample);
  };
  for (const Sampling policy : {Sampling::weighted, Sampling::progressive}) draw(policy);
  for (const Sampling policy : {Sampling::weighted, Sampling::progressive, Sampling::uniform})
    CHECK(cfp_test::allocations_in([&] { draw(policy); }) == 0);
}
