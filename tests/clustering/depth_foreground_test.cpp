#include "cfp/clustering/depth_foreground.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
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
  out.result = cfp::depth_foreground({depths, {}, {}, 0}, options, workspace, out.mask);
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
  options.rule = cfp::ForegroundRule::dbscan;
  options.adaptive.rule = cfp::AdaptiveRule::fixed;
  options.adaptive.fixed = {eps, min_pts};
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
  CHECK_THAT(out.result.near_m, WithinAbs(2.0, 1e-6));
  CHECK_THAT(out.result.far_m, WithinAbs(2.39, 1e-6));
  CHECK_THAT(out.result.depth_m, WithinAbs(2.2, 1e-6));
}

TEST_CASE("A hand before the body belongs to the foreground", "[clustering]") {
  std::vector<double> depths;
  add_layer(depths, 8, 1.2, 0.005);  // 8 of 108 points
  add_layer(depths, 50, 2.0, 0.008);
  add_layer(depths, 50, 4.0, 0.002);
  const Outcome out = run(depths);
  CHECK(kept(out.mask, 0, 58) == 58);
  CHECK(kept(out.mask, 58, 50) == 0);
}

TEST_CASE("As printed, the cluster of the lowest mean depth is the foreground, however small", "[clustering]") {
  std::vector<double> depths{1.0, 3.2, 3.6};  // noise nearer than the foreground's far end goes with it
  add_layer(depths, 8, 1.2, 0.005);
  add_layer(depths, 50, 2.0, 0.008);
  const Outcome out = run(depths, fixed(0.1, 5));
  CHECK(out.result.foreground == 9);
  CHECK(std::vector<char>(out.mask.begin(), out.mask.begin() + 3) == std::vector<char>({1, 0, 0}));
  CHECK(out.result.dbscan.min_pts == 5);
}

TEST_CASE("The window ends at the widest gap behind the front, or at a fixed depth", "[clustering]") {
  std::vector<double> depths;
  add_layer(depths, 30, 2.0, 0.005);  // front at 2.02 or so, ends at 2.145
  add_layer(depths, 30, 2.25, 0.002);
  CHECK(run(depths).result.foreground == 30);
  depths.clear();
  add_layer(depths, 200, 2.0, 0.01);  // no gap: 2.3 + behind_m
  const Outcome out = run(depths);
  CHECK_THAT(out.result.far_m, WithinAbs(2.7, 0.011));
}

TEST_CASE("The window ends at the widest gap, and not a few points beyond, however many points there are",
          "[clustering]") {
  cfp::Random random(3, "empty gap");
  for (const std::size_t n : {100U, 149U, 150U, 300U, 601U, 2000U}) {
    for (const std::size_t behind : {n / 20, n / 5}) {
      std::vector<double> depths;
      for (std::size_t i = 0; i < n - behind; ++i) depths.push_back(2 + 0.08 * random.normal());
      for (std::size_t i = 0; i < behind; ++i) depths.push_back(random.uniform(3.5, 3.9));
      const Outcome out = run(depths);
      CAPTURE(n, behind);
      CHECK(kept(out.mask, 0, n - behind) == n - behind);
      CHECK(kept(out.mask, n - behind, behind) == 0);
    }
  }
}

TEST_CASE("Every end of the window belongs to it, what lies a little beyond does not", "[clustering]") {
  constexpr double little = 1e-9;
  std::vector<double> depths;
  add_layer(depths, 65, 2.0, 1.0 / 32);  // to 4 m, without a gap
  cfp::ForegroundWorkspace<double> workspace;
  std::vector<char> mask;
  const auto range = [&](const cfp::ForegroundOptions& options, double previous_m = 0) {
    mask.resize(depths.size());
    const auto result = cfp::depth_foreground({depths, {}, {}, previous_m}, options, workspace, mask);
    return std::array<double, 2>{result.near_m, result.far_m};
  };
  cfp::ForegroundOptions options;
  options.near_share = 0, options.behind_m = 0.5;  // the front is the nearest depth
  CHECK(range(options)[1] == 2.5);
  options.behind_m = 0.5 - little;
  CHECK(range(options)[1] == 2.5 - 1.0 / 32);

  options.half_body_m = 0.25, options.before_m = 0.5;
  CHECK(range(options, 3.25)[0] == 2.5);
  options.before_m = 0.5 - little;
  CHECK(range(options, 3.25)[0] == 2.5 + 1.0 / 32);

  add_layer(depths, 20, 5.0, 1.0 / 32);  // a gap of 1 m behind 4 m
  options.last_gap_m = 3, options.first_gap_m = 2;
  CHECK(range(options)[1] == 4);
  options.last_gap_m = 2;
  CHECK(range(options)[1] == 4);
  options.last_gap_m = 2 - little, options.first_gap_m = 0;
  CHECK(range(options)[1] < 2.5);
  options.first_gap_m = options.last_gap_m = 3;
  CHECK(range(options)[1] == 4);
  options.first_gap_m = options.last_gap_m = 3 + little;
  CHECK(range(options)[1] < 2.5);
  options.first_gap_m = 0, options.min_gap_m = 1;
  CHECK(range(options)[1] < 2.5);
  options.min_gap_m = 1 - little;
  CHECK(range(options)[1] == 4);
}

TEST_CASE("Something stands before the person only where the upper half begins farther by more than obstacle_m",
          "[clustering]") {
  std::vector<double> depths(20, 2.0);
  depths.resize(40, 2.25);
  std::vector<std::array<double, 2>> pixels(20, {101, 190});  // a corner at the bottom, where people seldom are
  pixels.resize(40, {120, 100});
  cfp::ForegroundWorkspace<double> workspace;
  std::vector<char> mask(depths.size());
  cfp::ForegroundOptions options;
  options.before_m = 0.125, options.min_gap_m = 0.5;
  const auto nearest = [&](double obstacle_m) {
    options.obstacle_m = obstacle_m;
    return cfp::depth_foreground({depths, pixels, {100, 50, 140, 200}, 0}, options, workspace, mask).near_m;
  };
  CHECK(nearest(0.25) == 2);
  CHECK(nearest(0.25 - 1e-9) == 2.25);
}

TEST_CASE("The short end of the window is taken where what lies behind it is seldom a person's", "[clustering]") {
  std::vector<double> depths;
  add_layer(depths, 64, 2.0, 1.0 / 64);
  cfp::ForegroundWorkspace<double> workspace;
  std::vector<char> mask(depths.size());
  cfp::ForegroundOptions options;
  options.near_share = 0, options.behind_m = 0.5, options.short_m = 0.25;
  const auto farthest = [&](double side_from_m) {
    std::vector<std::array<double, 2>> pixels;
    for (const double depth : depths) pixels.push_back({depth > side_from_m ? 101.0 : 120.0, 150.0});
    return cfp::depth_foreground({depths, pixels, {100, 50, 140, 200}, 0}, options, workspace, mask).far_m;
  };
  CHECK(farthest(9) == 2.5);
  CHECK(farthest(2.25) == 2.25);
}

TEMPLATE_TEST_CASE("A desk before a person is background when the pixels are known", "[clustering]", float, double) {
  std::vector<double> depths;
  std::vector<std::array<TestType, 2>> pixels;
  add_layer(depths, 30, 1.4, 0.01);  // the desk, in the lower half of the box
  add_layer(depths, 30, 2.4, 0.01);
  add_layer(depths, 20, 4.0, 0.01);
  for (std::size_t i = 0; i < depths.size(); ++i) {
    const double y = i < 30 ? 160 + 0.1 * static_cast<double>(i) : 60 + static_cast<double>(i % 40);
    // The desk is as wide as the box, the person in its middle, the wall beside.
    const double x = i < 30 ? 101 + 1.3 * static_cast<double>(i) : i < 60 ? 120 : i % 2 == 0 ? 104 : 136;
    pixels.push_back({TestType(x), TestType(y)});
  }
  const std::vector<TestType> typed(depths.begin(), depths.end());
  cfp::ForegroundWorkspace<TestType> workspace;
  std::vector<char> mask(depths.size());
  cfp::ForegroundInput<TestType> in;
  in.depths_m = typed;
  in.pixels = pixels;
  cfp::depth_foreground(in, {}, workspace, mask);
  CHECK(kept(mask, 0, 30) == 30);  // without a box the nearest layer is the person
  in.box = {100, 50, 140, 200};
  cfp::depth_foreground(in, {}, workspace, mask);
  CHECK(kept(mask, 0, 30) == 0);
  CHECK(kept(mask, 30, 30) == 30);
  CHECK(kept(mask, 60, 20) == 0);
}

TEST_CASE("The depth of the frame before decides between layers, while somebody is there", "[clustering]") {
  std::vector<double> depths;
  add_layer(depths, 40, 1.4, 0.01);
  add_layer(depths, 40, 2.4, 0.01);
  cfp::ForegroundWorkspace<double> workspace;
  std::vector<char> mask(depths.size());
  const auto with = [&](double previous) {
    return cfp::depth_foreground({depths, {}, {}, previous}, {}, workspace, mask);
  };
  CHECK_THAT(with(2.5).near_m, WithinAbs(2.4, 1e-9));
  CHECK_THAT(with(2.5).depth_m, WithinAbs(2.6, 1e-9));
  CHECK_THAT(with(1.5).far_m, WithinAbs(1.79, 1e-9));
  for (const double unknown : {0.0, -1.0, 9.0, std::numeric_limits<double>::quiet_NaN()})
    CHECK_THAT(with(unknown).far_m, WithinAbs(1.79, 1e-9));
}

TEST_CASE("A wall beside a person's shoulders is not taken for the person", "[clustering]") {
  std::vector<double> depths;
  std::vector<std::array<double, 2>> pixels;
  add_layer(depths, 60, 2.0, 0.005);  // sits in the middle of the box, mostly in its lower half
  for (int i = 0; i < 60; ++i) pixels.push_back({110.0 + i % 20, i < 3 ? 90.0 : 130.0 + i});
  add_layer(depths, 40, 3.0, 0.002);  // fills the corners of the upper half
  for (int i = 0; i < 40; ++i) pixels.push_back({i % 2 == 0 ? 101.0 : 139.0, 55.0 + i});
  cfp::ForegroundWorkspace<double> workspace;
  std::vector<char> mask(depths.size());
  const auto result = cfp::depth_foreground({depths, pixels, {100, 50, 140, 200}, 0}, {}, workspace, mask);
  CHECK(result.status == ForegroundStatus::ok);
  CHECK(kept(mask, 0, 60) == 60);
  CHECK(kept(mask, 60, 40) == 0);
}

TEST_CASE("A person whose depths err by more than he is deep stays whole, and a wall far behind apart",
          "[clustering]") {
  cfp::Random random(8, "stereo");
  std::size_t person = 0, person_as_exact = 0, wall = 0;  // of 1200, 1200 and 800
  for (int trial = 0; trial < 40; ++trial) {
    std::vector<double> depths;
    for (int i = 0; i < 30; ++i) depths.push_back(10 + 0.8 * random.normal());
    for (int i = 0; i < 20; ++i) depths.push_back(20 + 3.2 * random.normal());
    cfp::ForegroundInput<double> in{depths, {}, {}, 0};
    std::vector<char> mask(depths.size());
    cfp::ForegroundWorkspace<double> workspace;
    cfp::depth_foreground(in, {}, workspace, mask);
    person_as_exact += kept(mask, 0, 30);
    in.depth_noise = {0, 0.008, 0};
    cfp::depth_foreground(in, {}, workspace, mask);
    person += kept(mask, 0, 30), wall += 20 - kept(mask, 30, 20);
  }
  CHECK(person_as_exact < 720);
  CHECK(person > 1116);
  CHECK(wall > 720);
}

TEST_CASE("A depth noise of infinity or none leaves the window as it is", "[clustering]") {
  std::vector<double> depths;
  add_layer(depths, 30, 2, 0.01), add_layer(depths, 30, 4, 0.01);
  cfp::ForegroundInput<double> in{depths, {}, {}, 0};
  std::vector<char> mask(depths.size());
  cfp::ForegroundWorkspace<double> workspace;
  for (const double constant_m : {0.0, 1e-6, std::numeric_limits<double>::infinity()}) {
    in.depth_noise = {constant_m, 0, 0};
    cfp::depth_foreground(in, {}, workspace, mask);
    CHECK(kept(mask, 0, 30) == 30);
    CHECK(kept(mask, 30, 30) == 0);
  }
}

TEST_CASE("A gap that flying pixels bridge parts a person from a wall, the thin end of the wall does not",
          "[clustering]") {
  std::vector<double> depths;
  add_layer(depths, 1000, 3.0, 0.00015);
  add_layer(depths, 50, 3.15, 0.002);  // 3 cm for as many as a gap holds
  add_layer(depths, 930, 3.25, 0.00015);
  add_layer(depths, 20, 3.39, 0.01);
  const Outcome out = run(depths);
  CHECK(kept(out.mask, 0, 1000) == 1000);
  CHECK(kept(out.mask, 1050, 950) == 0);
}

TEST_CASE("Evenly spread depths have no gap, however few or many", "[clustering]") {
  for (const std::size_t n : {12U, 100U, 1000U}) {
    std::vector<double> depths;
    add_layer(depths, n, 2.0, 2.0 / static_cast<double>(n));
    CHECK_THAT(run(depths).result.far_m, WithinAbs(2.7, 2.5 / static_cast<double>(n)));
  }
}

TEST_CASE("A body is parted from a slanted plane that begins at its back", "[clustering]") {
  std::vector<double> depths;
  add_layer(depths, 100, 2.0, 0.003);
  add_layer(depths, 100, 2.3, 0.03);  // a tenth of the body's density, no gap
  const Outcome out = run(depths);
  CHECK(out.result.status == ForegroundStatus::ok);
  CHECK(kept(out.mask, 0, 100) == 100);
  CHECK(kept(out.mask, 100, 100) <= 10);  // 0.4 m behind the front, at 0.03 m each
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
  CHECK(safe.result.invalid == 6);
  CHECK(kept(safe.mask, 60, 6) == 6);
  CHECK(std::equal(without.mask.begin(), without.mask.end(), safe.mask.begin()));
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
  cfp::depth_foreground({large, {}, {}, 0}, {}, workspace, mask);
  CHECK(cfp_test::allocations_in([&] {
          cfp::depth_foreground({small, {}, {}, 0}, {}, workspace, cfp::span<char>(mask.data(), small.size()));
          cfp::depth_foreground({large, {}, {}, 0}, {}, workspace, mask);
        }) == 0);
}

TEST_CASE("Permuting the points permutes the mask, equal depths included", "[clustering]") {
  cfp::Random random(41, "permuted");
  for (int scene = 0; scene < 300; ++scene) {
    std::vector<double> depths;
    for (int i = 0; i < 300; ++i) {
      const double z = random.uniform() < 0.5 ? 1.5 + 0.12 * random.normal() : random.uniform(2, 2.6);
      depths.push_back(0.01 * std::round(100 * z));
    }
    std::vector<std::size_t> order(depths.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    for (std::size_t i = order.size() - 1; i > 0; --i)
      std::swap(order[i], order[random.index(static_cast<std::uint32_t>(i + 1))]);
    std::vector<double> permuted;
    for (const std::size_t i : order) permuted.push_back(depths[i]);
    const std::vector<char> mask = run(depths).mask, found = run(permuted).mask;
    std::size_t differ = 0;
    for (std::size_t i = 0; i < order.size(); ++i) differ += found[i] != mask[order[i]] ? 1U : 0U;
    CHECK(differ == 0);
  }
}

TEST_CASE("Foreground options outside their range are named", "[clustering]") {
  CHECK(!invalid_field(cfp::ForegroundOptions{}));
  cfp::ForegroundOptions options;
  options.behind_m = std::numeric_limits<double>::quiet_NaN();
  CHECK(invalid_field(options).string() == "behind_m");
  options = {};
  options.last_gap_m = 0.1;
  CHECK(invalid_field(options).string() == "last_gap_m");
  options = {};
  options.near_share = 1;
  CHECK(invalid_field(options).string() == "near_share");
  options = {};
  options.min_points = 0;
  CHECK(invalid_field(options).string() == "min_points");
  options = {};
  options.adaptive.min_share = -0.1;
  CHECK(invalid_field(options).string() == "adaptive.min_share");
  options.adaptive.min_share = 0;
  options.near_share = 0;
  CHECK(!invalid_field(options));
}
