#include "cfp/clustering/adaptive.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "cfp/core/random.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"
#include "support/random_depths.hpp"

namespace {

constexpr cfp::AdaptiveRule rules[] = {cfp::AdaptiveRule::foreground_density, cfp::AdaptiveRule::fixed};

}  // namespace

TEST_CASE("The default's min_pts grows with n at unchanged shape", "[clustering]") {
  cfp::DbscanWorkspace<double> workspace;
  std::size_t before = 0;
  for (const int copies : {1, 2, 4, 8}) {
    std::vector<double> depths;
    for (int i = 0; i < 60; ++i)
      depths.insert(depths.end(), static_cast<std::size_t>(copies), i < 40 ? 2 + 0.01 * i : 5 + 0.01 * i);
    const cfp::DbscanOptions chosen = cfp::adaptive_options(depths, {}, workspace);
    CHECK(chosen.min_pts > before);
    before = chosen.min_pts;
  }
}

TEST_CASE("eps and min_pts of chosen depths are those of the documented rule", "[clustering]") {
  cfp::DbscanWorkspace<double> workspace;
  cfp::AdaptiveOptions options;
  options.noise_factor = 0;
  options.min_eps_m = 0.01;
  options.max_eps_m = 0.5;
  const auto ramp = [](std::size_t n, double step) {
    std::vector<double> depths(n);
    for (std::size_t i = 0; i < n; ++i) depths[i] = 1 + step * static_cast<double>(i);
    return depths;
  };
  const auto eps = [&](const std::vector<double>& depths) {
    return cfp::adaptive_options(depths, options, workspace).eps;
  };
  // The mean spacing of 8 depths on either side of the one at 15 %, of what there are at the ends.
  CHECK_THAT(eps(ramp(101, 0.02)), WithinAbs(0.06, 1e-12));
  CHECK_THAT(eps(ramp(4, 0.02)), WithinAbs(0.06, 1e-12));
  std::vector<double> uneven = ramp(101, 0.02);
  for (std::size_t i = 0; i < uneven.size(); ++i) uneven[i] += i > 15 ? 0.08 : 0;
  CHECK_THAT(eps(uneven), WithinAbs(3 * (16 * 0.02 + 0.08) / 16, 1e-12));
  CHECK(eps(ramp(101, 0.2)) == 0.5);
  CHECK(eps(ramp(101, 0.001)) == 0.01);
  options.noise_factor = 5;
  const double z = 1 + 0.02 * 15;
  CHECK_THAT(eps(ramp(101, 0.02)), WithinAbs(std::max(0.06, 5 * cfp::DepthNoise{}.sigma_m(z)), 1e-12));
  options.noise = {0.1, 0.0, 0.0};
  CHECK_THAT(eps(ramp(101, 0.02)), WithinAbs(0.5, 1e-12));
  // min_pts: of the largest count among what reaches to eps behind that depth, its end included.
  options.noise_factor = 0;
  options.min_share = 0;
  options.density = 1;
  options.min_eps_m = options.max_eps_m = 0.25;
  CHECK(cfp::adaptive_options(std::vector<double>{1, 1.25, 1.375, 1.5, 9, 9, 9, 9, 9, 9}, options, workspace).min_pts ==
        4);
  options.density = 0.5;
  CHECK(cfp::adaptive_options(std::vector<double>(9, 1.0), options, workspace).min_pts == 5);
}

TEMPLATE_TEST_CASE("Every rule keeps eps above the sensor's noise and survives hostile depths", "[clustering]", float,
                   double) {
  cfp::DbscanWorkspace<TestType> workspace;
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
      const cfp::DbscanOptions chosen = cfp::adaptive_options(input, options, workspace);
      CHECK(!invalid_field(chosen));
    }
    if (rule == cfp::AdaptiveRule::fixed) continue;
    cfp::AdaptiveOptions stereo;
    stereo.rule = rule;
    stereo.noise = {0.0, 0.02, 0.0};
    const std::vector<TestType> far(50, TestType(10));
    CHECK(cfp::adaptive_options(far, stereo, workspace).eps >= 3 * 0.02 * 100 - 1e-9);
  }
}

TEST_CASE("Adaptive options outside their range are named", "[clustering]") {
  CHECK(!invalid_field(cfp::AdaptiveOptions{}));
  const auto named = [](auto change) {
    cfp::AdaptiveOptions options;
    change(options);
    return invalid_field(options).string();
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(named([&](auto& o) { o.fixed.eps = nan; }) == "fixed.eps");
  CHECK(named([&](auto& o) { o.noise.quadratic = -1; }) == "noise.quadratic");
  CHECK(named([&](auto& o) { o.noise_factor = nan; }) == "noise_factor");
  CHECK(named([&](auto& o) { o.min_eps_m = 0; }) == "min_eps_m");
  CHECK(named([&](auto& o) { o.max_eps_m = 0.01; }) == "max_eps_m");
  CHECK(named([&](auto& o) { o.spacing_factor = nan; }) == "spacing_factor");
  CHECK(named([&](auto& o) { o.min_share = 1; }) == "min_share");
  CHECK(named([&](auto& o) { o.density = 0; }) == "density");
}

TEST_CASE("The noise model gives its published figure", "[clustering]") {
  CHECK_THAT(cfp::DepthNoise{}.sigma_m(3.0), WithinAbs(0.014044, 1e-9));
  CHECK_THAT(cfp::DepthNoise{}.sigma_m(0.4), WithinAbs(0.0012, 1e-12));
}

TEST_CASE("No rule allocates after warm-up", "[clustering]") {
  cfp::Random random(23, "allocation");
  const std::vector<double> first = cfp_test::random_depths(random, 600), second = cfp_test::random_depths(random, 500);
  for (const cfp::AdaptiveRule rule : rules) {
    cfp::DbscanWorkspace<double> workspace;
    cfp::AdaptiveOptions options;
    options.rule = rule;
    double keep = cfp::adaptive_options(first, options, workspace).eps;
    CHECK(cfp_test::allocations_in([&] {
            keep += cfp::adaptive_options(second, options, workspace).eps;
            keep += cfp::adaptive_options(first, options, workspace).eps;
          }) == 0);
    CHECK(keep > 0);
  }
}
