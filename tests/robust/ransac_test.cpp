#include "cfp/robust/ransac.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include "support/catch.hpp"

namespace {

/// Models are the data's indices; each has a cost, and one after its local optimisation.
struct Costs {
  using Model = std::uint32_t;
  static constexpr std::size_t sample_size = 1;

  std::vector<double> plain, optimized, ones;
  double inlier_share = 0;
  mutable std::size_t solved = 0;
  mutable double lowest_plain = std::numeric_limits<double>::infinity(), lowest = lowest_plain;

  explicit Costs(std::size_t n) : plain(n, 1e3), optimized(n, 1e3), ones(n, 1.0) {}
  [[nodiscard]] std::size_t size() const { return ones.size(); }
  [[nodiscard]] cfp::span<const double> weights() const { return ones; }
  [[nodiscard]] double total_weight() const { return double(ones.size()); }
  template <typename Visit>
  void solve(const std::array<std::uint32_t, 1>& sample, Visit&& visit) const {
    ++solved;
    visit(sample[0]);
  }
  [[nodiscard]] double cost(std::uint32_t model, double) const {
    lowest_plain = (std::min)(lowest_plain, plain[model]);
    return plain[model];
  }
  void optimize(cfp::RansacCandidate<std::uint32_t>& candidate) const {
    candidate.cost = optimized[candidate.model];
    lowest = (std::min)(lowest, candidate.cost);
  }
  [[nodiscard]] auto inlier_test(std::uint32_t) const {
    return [this](std::size_t i) { return double(i) < inlier_share * double(size()); };
  }
};

cfp::RansacOptions draws(std::size_t least, std::size_t most) {
  cfp::RansacOptions options;
  options.min_iterations = least, options.max_iterations = most;
  return options;
}

cfp::RansacSearch<std::uint32_t> search(Costs& costs, const cfp::RansacOptions& options, std::uint64_t seed = 1) {
  cfp::Random random(seed, "ransac");
  std::vector<double> sums;
  return cfp::lo_ransac(costs, options, random, sums);
}

}  // namespace

TEST_CASE("The model found is the cheapest after local optimisation, wherever it came", "[robust]") {
  cfp::Random random(71, "ransac");
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    Costs costs(20);
    for (std::size_t i = 0; i < 20; ++i)
      costs.plain[i] = random.uniform(0, 30), costs.optimized[i] = costs.plain[i] * random.uniform(0.1, 1);
    const auto found = search(costs, draws(200, 200), seed);
    CHECK(found.iterations == 200);
    CHECK(costs.solved == 200);
    CHECK(found.best.cost == costs.lowest);
    CHECK(found.best.cost == costs.optimized[found.best.model]);
    CHECK(found.best.cost <= costs.lowest_plain);
  }
}

TEST_CASE("No cost below the total weight is no model", "[robust]") {
  Costs costs(20);
  std::fill(costs.plain.begin(), costs.plain.end(), 20.0);
  const auto none = search(costs, draws(10, 100));
  CHECK_FALSE(cfp::is_finite(none.best.cost));
  CHECK((none.iterations == 100 && !none.confident));
  costs.plain[3] = costs.optimized[3] = 19.5;
  CHECK(search(costs, draws(10, 1000)).best.model == 3);
}

TEST_CASE("The search ends with the confidence asked for, within its limits, and says whether it was reached",
          "[robust]") {
  for (const double share : {0.02, 0.1, 0.5, 1.0}) {
    Costs costs(100);
    std::fill(costs.plain.begin(), costs.plain.end(), 50.0);
    costs.optimized = costs.plain;
    costs.inlier_share = share;
    const cfp::RansacOptions options = draws(5, 100);
    const std::size_t needed = cfp::ransac_iterations(share, 1, options.confidence, 100);
    const auto found = search(costs, options);
    CAPTURE(share, needed);
    CHECK(found.iterations == (std::max)(needed, std::size_t(5)));
    CHECK(found.confident == (needed < 100));
    if (needed < 100) CHECK(search(costs, draws(1, needed)).confident);  // with the last sample allowed
    if (needed > 1) CHECK_FALSE(search(costs, draws(1, needed - 1)).confident);
  }
}
