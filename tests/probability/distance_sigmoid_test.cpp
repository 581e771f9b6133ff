#include "cfp/probability/distance_sigmoid.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "cfp/core/options.hpp"
#include "cfp/core/random.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"

namespace {

template <typename Scalar>
cfp::ConstraintModel<Scalar> fit(const std::vector<Scalar>& d, const cfp::ConstraintOptions& options = {}) {
  std::vector<Scalar> scratch(d.size());
  return cfp::fit_constraint(d, options, scratch);
}

template <typename Scalar>
std::vector<Scalar> random_distances(std::size_t n, const char* stream) {
  cfp::Random random(17, stream);
  std::vector<Scalar> d(n);
  for (Scalar& x : d) x = static_cast<Scalar>(std::hypot(random.normal(), random.normal()));
  return d;
}

}  // namespace

TEMPLATE_TEST_CASE("The sigmoid's threshold is the 0.8 order statistic and its minimum the least distance",
                   "[probability]", float, double) {
  for (const std::size_t n : {10U, 11U, 64U, 100U, 1001U}) {
    std::vector<TestType> d = random_distances<TestType>(n, "threshold");
    const cfp::ConstraintModel<TestType> model = fit(d);
    std::sort(d.begin(), d.end());
    INFO("n " << n);
    CHECK(model.status == cfp::Status::ok);
    CHECK(model.samples == n);
    CHECK(model.minimum_px == d.front());
    CHECK(model.threshold_px == d[static_cast<std::size_t>(std::ceil(0.8 * static_cast<double>(n) - 1e-9)) - 1]);
  }
}

TEMPLATE_TEST_CASE("K is one half at the threshold and logistic(5) at the minimum", "[probability]", float, double) {
  const cfp::ConstraintModel<TestType> model = fit(random_distances<TestType>(200, "anchors"));
  CHECK_THAT(cfp::static_probability(model, model.threshold_px), WithinAbs(0.5, 1e-6));
  CHECK_THAT(cfp::static_probability(model, model.minimum_px), WithinAbs(0.99330715, 1e-6));
  const TestType d = TestType(2) * model.threshold_px - model.minimum_px;
  CHECK_THAT(cfp::static_probability(model, d), WithinAbs(0.00669285, 1e-6));
}

TEMPLATE_TEST_CASE("A probability does not rise with the distance, and what is no distance has none", "[probability]",
                   float, double) {
  const cfp::ConstraintModel<TestType> model = fit(random_distances<TestType>(300, "model"));
  using Limits = std::numeric_limits<TestType>;
  std::vector<TestType> ascending = random_distances<TestType>(200, "ascending");
  for (const TestType d : {Limits::denorm_min(), Limits::max(), Limits::infinity()}) ascending.push_back(d);
  std::sort(ascending.begin(), ascending.end());
  for (const cfp::Status status : {cfp::Status::ok, cfp::Status::degenerate, cfp::Status::not_enough_data}) {
    cfp::ConstraintModel<TestType> m = model;
    m.status = status;
    TestType last = 1;
    for (const TestType d : ascending) {
      INFO("status " << cfp::to_string(status) << " d " << d);
      const TestType k = cfp::static_probability(m, d);
      CHECK((k >= 0 && k <= last));
      last = k;
    }
    CHECK(last == 0);
    CHECK(cfp::static_probability(m, TestType(-1)) == 0);
    CHECK(cfp::static_probability(m, Limits::quiet_NaN()) == 0);
  }
}

TEST_CASE("Equal distances make a step with one half at the threshold", "[probability]") {
  const cfp::ConstraintModel<double> model = fit(std::vector<double>(20, 0.7));
  CHECK(model.status == cfp::Status::degenerate);
  CHECK(model.slope_per_px == 0);
  CHECK(cfp::static_probability(model, 0.69) == 1);
  CHECK(cfp::static_probability(model, 0.7) == 0.5);
  CHECK(cfp::static_probability(model, 0.71) == 0);
  const cfp::ConstraintModel<double> zero = fit(std::vector<double>(20, 0.0));
  CHECK(zero.status == cfp::Status::degenerate);
  CHECK(cfp::static_probability(zero, 0.0) == 0.5);
  CHECK(zero.calculation_confidence == 0);
}

TEST_CASE("Too few distances outside the boxes leave the constraint without a say", "[probability]") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> d(30, nan);
  for (std::size_t i = 0; i < 9; ++i) d[i] = 0.1 * static_cast<double>(i);
  const cfp::ConstraintModel<double> model = fit(d);
  CHECK(model.status == cfp::Status::not_enough_data);
  CHECK(model.samples == 9);
  CHECK(cfp::static_probability(model, 0.0) == 0);
  CHECK(fit(std::vector<double>{}).status == cfp::Status::not_enough_data);
}

TEST_CASE("The calculation confidence is the printed formula over distances below the threshold", "[probability]") {
  const std::vector<double> d = {0.5, 1.0, -1.0, 1.5, 2.0, 7.0, std::numeric_limits<double>::quiet_NaN()};
  // Below 2: 0.5, 1.0, 1.5: 1 - 3 / (3 * 2).
  CHECK_THAT(cfp::calculation_confidence(d, 2.0), WithinAbs(0.5, 1e-15));
  CHECK(cfp::calculation_confidence(d, 0.5) == 0);
  CHECK(cfp::calculation_confidence(std::vector<double>{0, 0.5, 0}, 1.0) == 1 - 0.5 / 3);  // 0 is below, too
  CHECK(cfp::calculation_confidence(d, std::numeric_limits<double>::infinity()) == 0);
  CHECK(cfp::calculation_confidence(d, std::numeric_limits<double>::quiet_NaN()) == 0);
  // Ideal 2-D noise gives about 0.44 (Rayleigh distances below their 0.8 quantile).
  CHECK_THAT(fit(random_distances<double>(200000, "ideal")).calculation_confidence, WithinAbs(0.44, 0.01));
}

TEMPLATE_TEST_CASE("Fitting survives hostile distances", "[probability]", float, double) {
  using Limits = std::numeric_limits<TestType>;
  std::vector<TestType> d = {Limits::max(),      Limits::denorm_min(), TestType(0),
                             Limits::infinity(), -Limits::infinity(),  Limits::quiet_NaN()};
  for (int i = 0; i < 12; ++i) d.push_back(Limits::max());
  const cfp::ConstraintModel<TestType> model = fit(d);
  for (const TestType x : d) {
    const TestType k = cfp::static_probability(model, x);
    CHECK((k >= 0 && k <= 1));
  }
  CHECK((model.calculation_confidence >= 0 && model.calculation_confidence <= 1));
}

TEST_CASE("Fitting and evaluating allocate nothing", "[probability]") {
  const std::vector<float> d = random_distances<float>(1000, "allocation");
  std::vector<float> scratch(d.size());
  CHECK(cfp_test::allocations_in([&] {
          const auto model = cfp::fit_constraint(d, cfp::ConstraintOptions{}, scratch);
          for (const float distance : d) (void)cfp::static_probability(model, distance);
        }) == 0);
}

TEST_CASE("Constraint options outside their range are named", "[probability]") {
  cfp::ConstraintOptions options;
  CHECK(!cfp::invalid_field(options));
  options.quantile = 0;
  CHECK_THROWS_WITH(cfp::validate(options), Catch::Matchers::Contains("quantile"));
  options = {};
  options.steepness = -1;
  CHECK(cfp::invalid_field(options).string() == "steepness");
  options = {};
  options.min_samples = 0;
  CHECK(cfp::invalid_field(options).string() == "min_samples");
}
