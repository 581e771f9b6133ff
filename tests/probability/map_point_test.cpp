#include "cfp/probability/map_point.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include "cfp/core/options.hpp"
#include "support/catch.hpp"

namespace {

cfp::MapPointOptions with(cfp::MapPointPolicy policy) {
  cfp::MapPointOptions options;
  options.policy = policy;
  return options;
}

}  // namespace

TEMPLATE_TEST_CASE("Each map-point policy is its formula", "[probability]", float, double) {
  const TestType m = TestType(0.6), k = TestType(0.1);
  CHECK(cfp::updated_map_point(k, m, with(cfp::MapPointPolicy::copy)) == k);
  cfp::MapPointOptions options = with(cfp::MapPointPolicy::exponential_mean);
  options.rate = 0.25;
  CHECK_THAT(cfp::updated_map_point(k, m, options), WithinAbs(0.475, 1e-6));
  options = with(cfp::MapPointPolicy::log_odds);
  options.rate = 1;
  // Odds multiply: (0.6 / 0.4) (0.1 / 0.9) = 1/6, probability 1/7.
  CHECK_THAT(cfp::updated_map_point(k, m, options), WithinAbs(1.0 / 7.0, 1e-6));
}

TEST_CASE("The mean converges to a constant K, the log-odds to its bound", "[probability]") {
  double mean = 1, odds = 1;
  for (int i = 0; i < 200; ++i) {
    mean = cfp::updated_map_point(0.4, mean, with(cfp::MapPointPolicy::exponential_mean));
    odds = cfp::updated_map_point(0.4, odds, with(cfp::MapPointPolicy::log_odds));
  }
  CHECK_THAT(mean, WithinAbs(0.4, 1e-12));
  CHECK_THAT(odds, WithinAbs(0.02, 1e-12));
}

TEST_CASE("Deletion and mismatch happen at the paper's and our thresholds", "[probability]") {
  const cfp::MapPointOptions options;
  CHECK(cfp::is_deletable(0.2999, options));
  CHECK_FALSE(cfp::is_deletable(0.3, options));
  CHECK(cfp::is_mismatch(1.0, 0.49, options));
  CHECK(cfp::is_mismatch(0.2, 0.71, options));
  CHECK_FALSE(cfp::is_mismatch(0.25, 0.75, options));
  CHECK(cfp::is_mismatch(std::numeric_limits<double>::quiet_NaN(), 0.5, options));
  CHECK(cfp::is_deletable(std::numeric_limits<double>::quiet_NaN(), options));
}

TEST_CASE("The printed weight is a product", "[probability]") {
  CHECK_THAT(cfp::observation_weight(0.5, 0.8), WithinAbs(0.4, 1e-15));
}

TEMPLATE_TEST_CASE("Map points and weights keep their range for hostile input", "[probability]", float, double) {
  using Limits = std::numeric_limits<TestType>;
  const std::vector<TestType> hostile = {TestType(0),        TestType(1),          TestType(-3),
                                         TestType(7),        Limits::denorm_min(), Limits::max(),
                                         Limits::infinity(), -Limits::infinity(),  Limits::quiet_NaN()};
  for (const TestType m : hostile) {
    for (const TestType k : hostile) {
      for (const auto policy :
           {cfp::MapPointPolicy::copy, cfp::MapPointPolicy::exponential_mean, cfp::MapPointPolicy::log_odds}) {
        const TestType updated = cfp::updated_map_point(k, m, with(policy));
        CHECK((updated >= 0 && updated <= 1));
      }
      const TestType w = cfp::observation_weight(k, m);
      CHECK((w >= 0 && w <= 1));
    }
  }
}

TEMPLATE_TEST_CASE("The posterior is Bayes' rule on the odds of M, E and K", "[probability]", float, double) {
  using S = TestType;
  cfp::MapPointOptions options;
  const auto posterior = [&](double k, double e, double m) {
    return static_cast<double>(cfp::posterior_probability(S(k), S(e), S(m), options));
  };
  for (const double power : {0.5, 1.0}) {
    options.constraint_power = power;
    for (double k = 0.05; k < 1; k += 0.05) {
      for (double e = 0.05; e < 1; e += 0.15) {
        for (double m = 0.05; m < 1; m += 0.15) {
          const double odds = std::pow(k / (1 - k), power) * (e / (1 - e)) * (m / (1 - m));
          CHECK(posterior(k, e, m) == Approx(odds / (1 + odds)).epsilon(1e-5));
        }
      }
      CHECK(posterior(0.5, 0.5, k) == Approx(k).epsilon(1e-5));  // nothing else is known
      CHECK(posterior(0.5, k, 0.5) == Approx(k).epsilon(1e-5));
    }
  }
  CHECK(posterior(1, 0.5, 0) == Approx(0.5).epsilon(1e-5));  // both at the bound
}

TEST_CASE("The posterior is continuous, monotone and inside its range, and no evidence silences the rest",
          "[probability]") {
  const cfp::MapPointOptions options;
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  const auto posterior = [&](double k, double e, double m) { return cfp::posterior_probability(k, e, m, options); };
  for (const double m : {0.0, 0.02, 0.4, 0.98, 1.0}) {
    for (const double e : {0.0, 0.3, 0.5, 1.0}) {
      for (double k = 0; k < 1; k += 1e-3) {
        CHECK(posterior(k + 1e-3, e, m) >= posterior(k, e, m));
        CHECK(posterior(k + 1e-3, e, m) - posterior(k, e, m) < 0.02);
        CHECK(posterior(e, k + 1e-3, m) >= posterior(e, k, m));
        CHECK(posterior(e, m, k + 1e-3) >= posterior(e, m, k));
      }
      CHECK(posterior(std::numeric_limits<double>::denorm_min(), e, m) == posterior(0, e, m));
    }
  }
  CHECK(posterior(0, 0.5, 1) > 0.5);  // a map point confirmed over many frames survives one
  for (const double bad : {-1.0, 2.0, nan, infinity, -infinity}) {
    for (const double p : {posterior(bad, 0.4, 0.3), posterior(0.3, bad, 0.4), posterior(0.3, 0.4, bad)})
      CHECK((p > 0 && p < 1));
  }
  CHECK(posterior(nan, nan, nan) == posterior(0, 0, 0));
}

TEST_CASE("Map-point options outside their range are named", "[probability]") {
  cfp::MapPointOptions options;
  CHECK(!cfp::invalid_field(options));
  options.rate = 0;
  CHECK_THROWS_WITH(cfp::validate(options), Catch::Matchers::Contains("rate"));
  options = {};
  options.evidence_limit = 0.5;
  CHECK(cfp::invalid_field(options).string() == "evidence_limit");
  options = {};
  options.deletion_threshold = -0.1;
  CHECK(cfp::invalid_field(options).string() == "deletion_threshold");
  options = {};
  options.mismatch_threshold = 0;
  CHECK(cfp::invalid_field(options).string() == "mismatch_threshold");
  for (const double bad : {0.0, -1.0, 1.5, std::numeric_limits<double>::quiet_NaN()}) {
    options = {};
    options.constraint_power = bad;
    CHECK(cfp::invalid_field(options).string() == "constraint_power");
    options = {};
    options.foreground_prior = bad;
    CHECK(cfp::invalid_field(options).string() == "foreground_prior");
    options = {};
    options.background_prior = bad;
    CHECK(cfp::invalid_field(options).string() == "background_prior");
  }
}

TEST_CASE("A map point that was never in doubt keeps M = 1 under every policy", "[probability]") {
  for (const auto policy :
       {cfp::MapPointPolicy::copy, cfp::MapPointPolicy::exponential_mean, cfp::MapPointPolicy::log_odds}) {
    CHECK(cfp::updated_map_point(1.0, 1.0, with(policy)) == 1.0);
  }
}

TEMPLATE_TEST_CASE("A keypoint that is surely static never lowers M", "[probability]", float, double) {
  const cfp::MapPointOptions options = with(cfp::MapPointPolicy::log_odds);
  for (int i = 0; i <= 1000; ++i) {
    const TestType m = TestType(i) / 1000;
    CHECK(cfp::updated_map_point(TestType(1), m, options) >= m);
    CHECK(cfp::updated_map_point(TestType(0.985), m, options) >= m);
  }
}

TEMPLATE_TEST_CASE("M falls under doubt at the smallest evidence limit, and smaller ones are refused", "[probability]",
                   float, double) {
  cfp::MapPointOptions options;
  options.evidence_limit = 1e-4;
  CHECK(!cfp::invalid_field(options));
  TestType m = 1;
  for (int frame = 0; frame < 400; ++frame) {
    const TestType next = cfp::updated_map_point(TestType(0.45), m, options);
    REQUIRE(next < m);
    REQUIRE(next > 0);
    m = next;
  }
  CHECK(cfp::is_deletable(m, options));
  for (const double limit : {9e-5, 1e-8, 1e-46, 0.0, std::numeric_limits<double>::quiet_NaN()}) {
    options.evidence_limit = limit;
    CHECK(cfp::invalid_field(options).string() == "evidence_limit");
  }
}

TEST_CASE("Every function of K and M takes K first", "[probability]") {
  const cfp::MapPointOptions options = with(cfp::MapPointPolicy::copy);
  CHECK(cfp::updated_map_point(0.2, 0.9, options) == 0.2);
  // K counts by the root of its odds, M in full.
  CHECK(cfp::posterior_probability(0.2, 0.5, 0.9, options) > cfp::posterior_probability(0.9, 0.5, 0.2, options));
}
