#include "cfp/clustering/dbscan.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp_testing/dbscan_verifier.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"

namespace {

template <typename Scalar>
struct Labelled {
  std::vector<int> labels;
  cfp::DbscanResult result;
};

template <typename Scalar>
Labelled<Scalar> cluster(const std::vector<Scalar>& values, double eps, std::size_t min_pts) {
  Labelled<Scalar> out;
  cfp::DbscanWorkspace<Scalar> workspace;
  out.labels.assign(values.size(), 77);
  out.result = cfp::dbscan(values, {eps, min_pts}, workspace, out.labels);
  return out;
}

// Layers, a uniform part, repeated values and ties on a grid, in random order.
template <typename Scalar>
std::vector<Scalar> random_values(cfp::Random& random, std::size_t n) {
  std::vector<Scalar> values;
  const bool grid = random.index(2) == 0;
  while (values.size() < n) {
    double value = random.index(3) == 0 ? random.uniform(0, 8) : 1.0 + random.index(3) + 0.1 * random.normal();
    if (grid) value = std::round(value * 16) / 16;
    values.push_back(static_cast<Scalar>(value));
  }
  return values;
}

}  // namespace

TEMPLATE_TEST_CASE("DBSCAN agrees with the definition", "[clustering]", float, double) {
  cfp::Random random(11, "definition");
  for (int round = 0; round < 3000; ++round) {
    const std::size_t n = random.index(61);
    const std::vector<TestType> values = random_values<TestType>(random, n);
    // Multiples of 1/16 meet the grid's distances exactly: the inclusive border of eps is exercised.
    const double eps = random.index(2) == 0 ? random.index(8) / 16.0 : random.uniform(0, 0.5);
    const std::size_t min_pts = 1 + random.index(12);
    const auto out = cluster(values, eps, min_pts);
    const cfp_testing::DbscanVerdict verdict = cfp_testing::verify_dbscan(values, {eps, min_pts}, out.labels);
    INFO("round " << round << " n " << n << " eps " << eps << " min_pts " << min_pts << " at " << verdict.index);
    REQUIRE(verdict.fault == cfp_testing::DbscanFault::none);
    REQUIRE(out.result.status == cfp::Status::ok);
    REQUIRE(out.result.noise ==
            static_cast<std::size_t>(std::count(out.labels.begin(), out.labels.end(), cfp::dbscan_noise)));
    const int highest = out.labels.empty() ? -1 : *std::max_element(out.labels.begin(), out.labels.end());
    REQUIRE(out.result.clusters == static_cast<std::size_t>(highest + 1));
  }
}

TEMPLATE_TEST_CASE("DBSCAN agrees with the definition for many values and a wild outlier", "[clustering]", float,
                   double) {
  cfp::Random random(12, "sizes");
  for (const std::size_t n : std::vector<std::size_t>{40, 300, 1500, 2500}) {
    std::vector<TestType> values = random_values<TestType>(random, n);
    if (n == 300) values[7] = static_cast<TestType>(1e30);  // far from all others
    const auto out = cluster(values, 0.05, 4);
    CHECK(cfp_testing::verify_dbscan(values, {0.05, 4}, out.labels).fault == cfp_testing::DbscanFault::none);
  }
}

TEST_CASE("A border point joins its nearest core point and the lower one of two", "[clustering]") {
  // Core points: 0 and 1 alone; each sees its group of three, itself and the border point between.
  CHECK(cluster<double>({-0.375, -0.375, -0.125, 0, 0.5, 1, 1.125, 1.375, 1.375}, 0.5, 5).labels ==
        std::vector<int>({0, 0, 0, 0, 0, 1, 1, 1, 1}));
  CHECK(cluster<double>({1.375, 1.375, 1.125, 1, 0.5, 0, -0.125, -0.375, -0.375}, 0.5, 5).labels ==
        std::vector<int>({1, 1, 1, 1, 0, 0, 0, 0, 0}));
  CHECK(cluster<double>({-0.375, -0.375, -0.125, 0, 0.5625, 1, 1.125, 1.375, 1.375}, 0.5625, 5).labels ==
        std::vector<int>({0, 0, 0, 0, 1, 1, 1, 1, 1}));
}

TEST_CASE("A border point may be exactly eps away, on either side", "[clustering]") {
  cfp::DbscanWorkspace<double> workspace;
  std::vector<int> labels(5);
  const std::vector<double> values{-0.25, 0, 0.125, 0.25, 0.5};
  const auto result = cfp::dbscan(values, {0.25, 4}, workspace, labels);
  CHECK(result.core_points == 2);  // 0 and 0.25; between them 0.125 has three neighbours
  CHECK(labels == std::vector<int>(5, 0));
}

TEST_CASE("The point counts itself in min_pts", "[clustering]") {
  CHECK(cluster<double>({3.0}, 0.1, 1).labels == std::vector<int>({0}));
  CHECK(cluster<double>({3.0}, 0.1, 2).labels == std::vector<int>({-1}));
  CHECK(cluster<double>({3.0, 3.0625}, 0.0625, 2).labels == std::vector<int>({0, 0}));
  CHECK(cluster<double>({3.0, 3.0625}, 0.0624, 2).result.noise == 2);
  CHECK(cluster<double>({}, 0.1, 1).result.clusters == 0);
}

TEMPLATE_TEST_CASE("DBSCAN survives hostile input", "[clustering]", float, double) {
  using Limits = std::numeric_limits<TestType>;
  const TestType nan = Limits::quiet_NaN(), inf = Limits::infinity(), big = (Limits::max)(),
                 tiny = Limits::denorm_min();
  const std::vector<TestType> values{nan,  1,     inf, big, -big, -inf, 1, TestType(0), TestType(-0.0),
                                     tiny, -tiny, 1,   nan, big,  2};
  const auto out = cluster(values, 0.5, 2);
  CHECK(out.result.invalid == 4);
  CHECK(cfp_testing::verify_dbscan(values, {0.5, 2}, out.labels).fault == cfp_testing::DbscanFault::none);
  CHECK(out.labels == std::vector<int>({-1, 1, -1, 2, -1, -1, 1, 0, 0, 0, 0, 1, -1, 2, -1}));

  std::vector<TestType> repeated;
  for (int i = 0; i < 20; ++i) repeated.insert(repeated.end(), values.begin(), values.end());
  CHECK(cfp_testing::verify_dbscan(repeated, {0.5, 30}, cluster(repeated, 0.5, 30).labels).fault ==
        cfp_testing::DbscanFault::none);
  const std::vector<TestType> equal(500, TestType(1.7));
  CHECK(cluster(equal, 0.0, 500).labels == std::vector<int>(500, 0));
  CHECK(cluster(equal, 0.0, 501).result.noise == 500);
  const std::vector<TestType> all_invalid(30, nan);
  CHECK(cluster(all_invalid, 0.1, 1).result.invalid == 30);
  std::vector<TestType> denormal(100);
  for (std::size_t i = 0; i < denormal.size(); ++i) denormal[i] = tiny * static_cast<TestType>(99 - i);
  CHECK(cluster(denormal, 0.0, 1).result.clusters == 100);
}

TEST_CASE("Options outside their range make everything noise and are named", "[clustering]") {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  for (const double eps : {nan, -0.1, inf}) {
    const auto out = cluster<double>({1, 1, 1}, eps, 2);
    CHECK(out.result.status == cfp::Status::invalid_input);
    CHECK(out.labels == std::vector<int>(3, -1));
    CHECK(invalid_field(cfp::DbscanOptions{eps, 2}).string() == "eps");
  }
  CHECK(invalid_field(cfp::DbscanOptions{0.1, 0}).string() == "min_pts");
  CHECK(cluster<double>({1, 1, 1}, 0.1, 0).result.status == cfp::Status::invalid_input);
  CHECK(!invalid_field(cfp::DbscanOptions{}));
}

TEMPLATE_TEST_CASE("DBSCAN allocates nothing after warm-up", "[clustering]", float, double) {
  cfp::Random random(13, "allocation");
  cfp::DbscanWorkspace<TestType> workspace;
  std::vector<int> labels(3000);
  std::vector<std::vector<TestType>> inputs;
  for (const std::size_t n : std::vector<std::size_t>{3000, 40, 2999, 0, 700})
    inputs.push_back(random_values<TestType>(random, n));
  inputs.back()[3] = TestType(1e25);
  cfp::dbscan(inputs[0], {0.1, 5}, workspace, labels);
  const std::size_t allocations = cfp_test::allocations_in([&] {
    for (const auto& input : inputs)
      cfp::dbscan(input, {0.1, 5}, workspace, cfp::span<int>(labels.data(), input.size()));
  });
  CHECK(allocations == 0);
}

TEST_CASE("float and double give the same labels where rounding cannot decide", "[clustering]") {
  cfp::Random random(14, "scalars");
  for (int round = 0; round < 300; ++round) {
    // Values and eps on a grid that both types hold exactly, eps off the grid: no distance equals it.
    std::vector<float> values;
    for (const double value : random_values<double>(random, 80))
      values.push_back(static_cast<float>(std::round(value * 1024) / 1024));
    const double eps = (random.index(300) + 0.5) / 1024;
    CHECK(cluster(values, eps, 4).labels == cluster(std::vector<double>(values.begin(), values.end()), eps, 4).labels);
  }
}
