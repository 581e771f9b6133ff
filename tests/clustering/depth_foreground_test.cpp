#include "cfp/clustering/depth_foreground.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "cfp/core/random.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"

namespace {

using cfp::ForegroundStatus;

struct Outcome {
  cfp::ForegroundResult result;
  std::vector<char> mask;
};

template <typename Scalar>
Outcome run(const std::vector<Scalar>& depths, const cfp::ForegroundOptions& options = {}) {
  Outcome out;
  cfp::ForegroundWorkspace<Scalar> workspace;
  out.mask.assign(depths.size(), 9);
  out.result = cfp::depth_foreground(depths, options, workspace, out.mask);
  return out;
}

// n depths from `from`, `step` apart.
void add_layer(std::vector<double>& depths, std::size_t n, double from, double step) {
  for (std::size_t i = 0; i < n; ++i) depths.push_back(from + step * static_cast<double>(i));
}

std::size_t kept(const std::vector<char>& mask, std::size_t first, std::size_t count) {
  return static_cast<std::size_t>(std::count(mask.begin() + static_cast<std::ptrdiff_t>(first),
                                             mask.begin() + static_cast<std::ptrdiff_t>(first + count), 1));
}

cfp::ForegroundOptions fixed(double eps, std::size_t min_pts) {
  cfp::ForegroundOptions options;
  options.adaptive.rule = cfp::AdaptiveRule::fixed;
  options.adaptive.fixed = {eps, min_pts};
  options.sure_points = 0;
  return options;
}

}  // namespace

TEMPLATE_TEST_CASE("A person before a wall is parted from it", "[clustering]", float, double) {
  std::vector<double> depths;
  add_layer(depths, 40, 2.0, 0.01);
  add_layer(depths, 40, 4.0, 0.002);
  const Outcome out = run(std::vector<TestType>(depths.begin(), depths.end()));
  CHECK(out.result.status == ForegroundStatus::ok);
  CHECK(kept(out.mask, 0, 40) == 40);
  CHECK(kept(out.mask, 40, 40) == 0);
  CHECK(out.result.foreground == 40);
  CHECK(out.result.background == 40);
  CHECK(out.result.clusters == 2);
  CHECK_THAT(out.result.near_m, WithinAbs(2.0, 1e-6));
  CHECK_THAT(out.result.far_m, WithinAbs(2.39, 1e-6));
}

TEST_CASE("A small nearer cluster belongs to the foreground and does not win it", "[clustering]") {
  std::vector<double> depths;
  add_layer(depths, 8, 1.2, 0.005);  // a hand: a cluster of its own, 8 of 108 points
  add_layer(depths, 50, 2.0, 0.008);
  add_layer(depths, 50, 4.0, 0.002);
  const Outcome out = run(depths, fixed(0.1, 5));
  CHECK(out.result.clusters == 3);
  CHECK(kept(out.mask, 0, 58) == 58);
  CHECK(kept(out.mask, 58, 50) == 0);
  CHECK(kept(run(depths).mask, 0, 58) == 58);
  CHECK(run(depths).result.background == 50);
}

TEST_CASE("As printed, the cluster of the lowest mean depth is the foreground, however small", "[clustering]") {
  std::vector<double> depths;
  add_layer(depths, 8, 1.2, 0.005);
  add_layer(depths, 50, 2.0, 0.008);
  cfp::ForegroundOptions options = fixed(0.1, 5);
  options.adaptive.min_share = 0;
  options.merge_gap_m = 0;
  CHECK(run(depths, options).result.foreground == 8);
}

TEST_CASE("Noise nearer than the foreground's far end goes with it, noise behind does not", "[clustering]") {
  std::vector<double> depths{1.0, 1.5, 3.2, 3.6};
  add_layer(depths, 30, 2.0, 0.01);
  add_layer(depths, 30, 4.0, 0.01);
  const Outcome out = run(depths, fixed(0.1, 5));
  CHECK(std::vector<char>(out.mask.begin(), out.mask.begin() + 4) == std::vector<char>({1, 1, 0, 0}));
  CHECK(out.result.foreground == 32);
}

TEST_CASE("A near cluster joins within the merge gap, and only while a body could reach so far", "[clustering]") {
  const auto background = [](double gap, double second_length, double merge_gap) {
    std::vector<double> depths;
    add_layer(depths, 40, 2.0, 0.005);  // ends at 2.195
    add_layer(depths, 40, 2.195 + gap, second_length / 39);
    add_layer(depths, 40, 6.0, 0.001);
    cfp::ForegroundOptions options = fixed(0.05, 5);
    options.merge_gap_m = merge_gap;
    return run(depths, options).result.background;
  };
  CHECK(background(0.15, 0.05, 0.2) == 40);
  CHECK(background(0.15, 0.05, 0.0) == 80);
  CHECK(background(0.25, 0.05, 0.2) == 80);
  CHECK(background(0.15, 0.60, 0.2) == 80);  // reaches beyond body_depth_m
}

TEST_CASE("A body is parted from a slanted plane that begins at its back", "[clustering]") {
  std::vector<double> depths;
  add_layer(depths, 100, 2.0, 0.003);
  add_layer(depths, 100, 2.3, 0.03);  // a tenth of the body's density, no gap
  const Outcome out = run(depths);
  CHECK(out.result.status == ForegroundStatus::ok);
  CHECK(kept(out.mask, 0, 100) == 100);
  CHECK(kept(out.mask, 100, 100) <= 10);
}

TEMPLATE_TEST_CASE("Points without a valid depth follow the documented rule and change nothing else", "[clustering]",
                   float, double) {
  std::vector<double> valid;
  add_layer(valid, 30, 2.0, 0.01);
  add_layer(valid, 30, 4.0, 0.01);
  const TestType nan = std::numeric_limits<TestType>::quiet_NaN(), inf = std::numeric_limits<TestType>::infinity();
  std::vector<TestType> depths(valid.begin(), valid.end());
  const Outcome without = run(depths);
  depths.insert(depths.end(), {nan, TestType(0), TestType(-0.0), TestType(-1), inf, -inf});
  const Outcome safe = run(depths);
  cfp::ForegroundOptions options;
  options.invalid_is_foreground = false;
  const Outcome bold = run(depths, options);
  CHECK(safe.result.invalid == 6);
  CHECK(kept(safe.mask, 60, 6) == 6);
  CHECK(kept(bold.mask, 60, 6) == 0);
  CHECK(std::equal(without.mask.begin(), without.mask.end(), safe.mask.begin()));
  CHECK(std::equal(without.mask.begin(), without.mask.end(), bold.mask.begin()));
  CHECK(safe.result.foreground == without.result.foreground);
  CHECK(safe.result.background == without.result.background);
}

TEST_CASE("Whatever cannot be told is foreground, with the reason", "[clustering]") {
  const auto all_foreground = [](const Outcome& out, ForegroundStatus status) {
    CHECK(out.result.status == status);
    CHECK(kept(out.mask, 0, out.mask.size()) == out.mask.size());
    CHECK(out.result.background == 0);
  };
  all_foreground(run<double>({}), ForegroundStatus::too_few_points);
  all_foreground(run<double>({2.0}), ForegroundStatus::too_few_points);
  all_foreground(run<double>({2, 2, 2, 4, 4}), ForegroundStatus::too_few_points);
  all_foreground(run<double>(std::vector<double>(40, 0.0)), ForegroundStatus::too_few_points);
  std::vector<double> spread;
  add_layer(spread, 40, 1.0, 0.2);
  all_foreground(run(spread, fixed(0.05, 3)), ForegroundStatus::no_cluster);
  // Twelve points whose gap of 0.3 m is a gap or not as the radius has it.
  const std::vector<double> sparse{2.0, 2.1, 2.2, 2.3, 2.4, 2.5, 2.8, 2.9, 3.0, 3.1, 3.2, 3.3};
  all_foreground(run(sparse), ForegroundStatus::unstable);
}

TEST_CASE("Twelve points with a clear gap can be told apart, and one layer is all foreground", "[clustering]") {
  std::vector<double> clear;
  add_layer(clear, 6, 2.0, 0.03);
  add_layer(clear, 6, 4.0, 0.01);
  CHECK(run(clear).result.status == ForegroundStatus::ok);
  CHECK(run(clear).result.background == 6);
  const Outcome one = run(std::vector<double>(50, 2.5));
  CHECK(one.result.status == ForegroundStatus::ok);
  CHECK(one.result.foreground == 50);
}

TEMPLATE_TEST_CASE("Depth foreground survives hostile depths", "[clustering]", float, double) {
  const TestType nan = std::numeric_limits<TestType>::quiet_NaN(), big = (std::numeric_limits<TestType>::max)(),
                 tiny = std::numeric_limits<TestType>::denorm_min();
  cfp::Random random(31, "hostile");
  for (int round = 0; round < 300; ++round) {
    std::vector<TestType> depths(random.index(80));
    for (TestType& depth : depths) {
      const TestType choices[] = {nan,
                                  0,
                                  -1,
                                  big,
                                  -big,
                                  tiny,
                                  TestType(2),
                                  TestType(2.1),
                                  TestType(1e30F),
                                  static_cast<TestType>(random.uniform(0.5, 6))};
      depth = choices[random.index(10)];
    }
    const Outcome out = run(depths);
    CHECK(out.result.foreground + out.result.background + out.result.invalid == depths.size());
    CHECK(std::all_of(out.mask.begin(), out.mask.end(), [](char m) { return m == 0 || m == 1; }));
    CHECK((out.result.near_m <= out.result.far_m && cfp::is_finite(out.result.near_m) &&
           cfp::is_finite(out.result.far_m)));
    CHECK(!invalid_field(out.result.dbscan));
  }
}

TEMPLATE_TEST_CASE("Depth foreground allocates nothing after warm-up", "[clustering]", float, double) {
  cfp::Random random(32, "allocation");
  std::vector<TestType> large(800), small(300);
  for (TestType& depth : large) depth = static_cast<TestType>(random.uniform(1, 5));
  for (TestType& depth : small) depth = static_cast<TestType>(random.index(2) == 0 ? 2.0 : random.uniform(1, 5));
  cfp::ForegroundWorkspace<TestType> workspace;
  std::vector<char> mask(800);
  cfp::depth_foreground(large, {}, workspace, mask);
  CHECK(cfp_test::allocations_in([&] {
          cfp::depth_foreground(small, {}, workspace, cfp::span<char>(mask.data(), small.size()));
          cfp::depth_foreground(large, {}, workspace, mask);
        }) == 0);
}

TEST_CASE("Foreground options outside their range are named", "[clustering]") {
  CHECK(!invalid_field(cfp::ForegroundOptions{}));
  cfp::ForegroundOptions options;
  options.merge_gap_m = std::numeric_limits<double>::quiet_NaN();
  CHECK(invalid_field(options).string() == "merge_gap_m");
  options = {};
  options.min_points = 0;
  CHECK(invalid_field(options).string() == "min_points");
  options = {};
  options.adaptive.min_share = -0.1;
  CHECK(invalid_field(options).string() == "adaptive.min_share");
  options.adaptive.min_share = 0;
  options.merge_gap_m = 0;
  CHECK(!invalid_field(options));
}
