#include "cfp/probability/object.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "cfp/core/options.hpp"
#include "cfp/core/random.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"

namespace {

using cfp::ObjectProbability;
using cfp::ObjectProbabilityOptions;
using cfp::ObjectScore;

/// The paper's words: score every pair, sort ascending, mean of the scores at 0.1 M, 0.2 M, 0.3 M.
template <typename Scalar>
double by_sorting(const std::vector<Scalar>& distances, const ObjectProbabilityOptions& options) {
  std::vector<double> scores;
  for (const Scalar d : distances) {
    if (d >= 0 && std::isfinite(d)) scores.push_back(static_cast<double>(cfp::object_score(d, options)));
  }
  std::sort(scores.begin(), scores.end());
  double sum = 0;
  for (const double q : options.positions) {
    const auto position = static_cast<std::size_t>(std::ceil(q * static_cast<double>(scores.size()) - 1e-9));
    sum += scores[std::max<std::size_t>(position, 1) - 1];
  }
  return sum / 3;
}

template <typename Scalar>
std::vector<Scalar> static_distances(std::size_t n, double sigma, cfp::Random& random) {
  std::vector<Scalar> d(n);
  for (Scalar& x : d) x = static_cast<Scalar>(std::abs(sigma * random.normal()));
  return d;
}

template <typename Scalar>
ObjectProbability run(const std::vector<Scalar>& distances, const ObjectProbabilityOptions& options) {
  std::vector<Scalar> scratch(distances.size());
  return cfp::object_probability(distances, options, scratch);
}

}  // namespace

TEMPLATE_TEST_CASE("One pair's score is the chosen function of the chi-squared distribution", "[probability]", float,
                   double) {
  const TestType tolerance = std::is_same_v<TestType, float> ? TestType(1e-6) : TestType(1e-14);
  ObjectProbabilityOptions options;
  CHECK(cfp::object_score(TestType(0), options) == 1);
  for (const double d : {0.1, 0.46, 1.0, 2.5}) {
    const auto x = static_cast<TestType>(d);
    options = {};
    CHECK_THAT(cfp::object_score(x, options), WithinAbs(std::exp(-d * d / 2), tolerance));
    options.sigma_px = 2;
    CHECK_THAT(cfp::object_score(x, options), WithinAbs(std::exp(-d * d / 8), tolerance));
    options = {};
    options.score = ObjectScore::density;
    CHECK_THAT(cfp::object_score(x, options), WithinAbs(0.5 * std::exp(-d * d / 2), tolerance));
    options = {};
    options.degrees_of_freedom = 1;
    CHECK_THAT(cfp::object_score(x, options), WithinAbs(std::erfc(d / std::sqrt(2.0)), tolerance));
  }
}

TEST_CASE("As printed, no object can pass the paper's own threshold", "[probability]") {
  ObjectProbabilityOptions options;
  options.score = ObjectScore::density;
  CHECK(run(std::vector<double>(100, 1e-9), options).static_probability <= 0.5);
}

TEMPLATE_TEST_CASE("Selecting three order statistics equals scoring and sorting all pairs", "[probability]", float,
                   double) {
  cfp::Random random(7, "object selection");
  for (const ObjectScore score : {ObjectScore::survival, ObjectScore::density}) {
    for (const int k : {1, 2, 3, 5}) {
      for (const std::size_t n : {1U, 2U, 3U, 9U, 10U, 11U, 30U, 99U, 500U}) {
        ObjectProbabilityOptions options;
        options.score = score;
        options.degrees_of_freedom = k;
        options.min_pairs = 1;
        const std::vector<TestType> d = static_distances<TestType>(n, 1.5, random);
        const ObjectProbability result = run(d, options);
        INFO("n " << n << " k " << k << " score " << int(score));
        CHECK(result.status == cfp::Status::ok);
        CHECK(result.pairs == n);
        CHECK_THAT(result.static_probability, WithinAbs(by_sorting(d, options), 1e-6));
      }
    }
  }
}

TEST_CASE("A static object's score is the figure that the documentation states", "[probability]") {
  cfp::Random random(11, "static object");
  ObjectProbabilityOptions printed;
  printed.positions = {0.1, 0.2, 0.3};
  CHECK_THAT(run(static_distances<double>(200000, 1.0, random), printed).static_probability, WithinAbs(0.428, 0.005));
  CHECK_THAT(run(static_distances<double>(200000, 0.343, random), printed).static_probability, WithinAbs(0.9, 0.005));
  CHECK_THAT(cfp::object_score(0.459, ObjectProbabilityOptions{}), WithinAbs(0.9, 0.001));
}

TEST_CASE("On the scale of the measured noise a static object scores the same at any noise", "[probability]") {
  cfp::Random random(12, "measured noise");
  for (const double sigma : {0.05, 0.2, 0.7}) {
    std::vector<double> point;
    for (int i = 0; i < 200000; ++i) point.push_back(sigma * std::hypot(random.normal(), random.normal()));
    const double o = run(point, cfp::scaled_to_noise(ObjectProbabilityOptions{}, sigma, 2)).static_probability;
    CHECK_THAT(o, WithinAbs(0.964, 0.002));
    const double on_line =
        run(static_distances<double>(200000, sigma, random), cfp::scaled_to_noise(ObjectProbabilityOptions{}, sigma, 1))
            .static_probability;
    CHECK_THAT(on_line, WithinAbs(o, 0.005));
  }
  ObjectProbabilityOptions as_printed;
  as_printed.noise_factor = 0;
  CHECK(cfp::scaled_to_noise(as_printed, 0.2, 2).sigma_px == 1);
  CHECK(cfp::scaled_to_noise(ObjectProbabilityOptions{}, 0, 2).sigma_px == 1);
  CHECK(cfp::scaled_to_noise(ObjectProbabilityOptions{}, std::numeric_limits<double>::quiet_NaN(), 2).sigma_px == 1);
}

TEST_CASE("An object is unknown with too few usable pairs, and says so", "[probability]") {
  ObjectProbabilityOptions options;
  options.min_pairs = 4;
  options.unknown_object_probability = 0.25;
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  const ObjectProbability result = run(std::vector<double>{0.1, nan, -1.0, inf, 0.1, 0.1}, options);
  CHECK(result.status == cfp::Status::not_enough_data);
  CHECK(result.pairs == 3);
  CHECK(result.static_probability == 0.25);
  CHECK(run(std::vector<double>{}, options).status == cfp::Status::not_enough_data);
}

TEMPLATE_TEST_CASE("Hostile distances give a probability in range", "[probability]", float, double) {
  using Limits = std::numeric_limits<TestType>;
  const std::vector<TestType> hostile = {TestType(0),        Limits::denorm_min(), Limits::min(),       Limits::max(),
                                         Limits::infinity(), -Limits::infinity(),  Limits::quiet_NaN(), TestType(1e30),
                                         TestType(-1),       TestType(1)};
  for (const ObjectScore score : {ObjectScore::survival, ObjectScore::density}) {
    for (const int k : {1, 2, 7, 100}) {
      ObjectProbabilityOptions options;
      options.score = score;
      options.degrees_of_freedom = k;
      options.min_pairs = 1;
      if (cfp::invalid_field(options)) continue;
      for (const TestType d : hostile) {
        const TestType s = cfp::object_score(d, options);
        CHECK((s >= 0 && s <= 1));
      }
      const double o = run(hostile, options).static_probability;
      CHECK((o >= 0 && o <= 1));
    }
  }
}

TEST_CASE("The object score allocates nothing", "[probability]") {
  cfp::Random random(3, "allocation");
  const std::vector<float> d = static_distances<float>(500, 1.0, random);
  std::vector<float> scratch(d.size());
  const ObjectProbabilityOptions options;
  CHECK(cfp_test::allocations_in([&] {
          volatile double keep = cfp::object_probability(d, options, scratch).static_probability;
          (void)keep;
        }) == 0);
}

TEST_CASE("Positions are shares in (0, 1] that ascend, equal ones included", "[probability]") {
  using Positions = std::array<double, 3>;
  const auto are_valid = [](const Positions& positions) {
    ObjectProbabilityOptions options;
    options.positions = positions;
    return !cfp::invalid_field(options);
  };
  for (const Positions& p : {Positions{1e-9, 0.5, 1}, Positions{0.3, 0.3, 0.3}, Positions{1, 1, 1}})
    CHECK(are_valid(p));
  for (const Positions& p : {Positions{0, 0.2, 0.3}, Positions{0.2, 0.1, 0.3}, Positions{0.1, 0.3, 0.2},
                             Positions{0.1, 0.2, 1.1}, Positions{0.4, 0.2, 0.3}})
    CHECK_FALSE(are_valid(p));
}

TEST_CASE("Object options outside their range are named", "[probability]") {
  CHECK(!cfp::invalid_field(ObjectProbabilityOptions{}));
  ObjectProbabilityOptions options;
  options.sigma_px = 0;
  CHECK_THROWS_WITH(cfp::validate(options), Catch::Matchers::Contains("sigma_px"));
  options = {};
  options.positions[1] = std::numeric_limits<double>::quiet_NaN();
  CHECK(cfp::invalid_field(options).string() == "positions");
  options = {};
  for (const int k : {-1, 0, 101}) {
    options.degrees_of_freedom = k;
    CHECK(cfp::invalid_field(options).string() == "degrees_of_freedom");
  }
  options = {};
  options.min_pairs = 0;
  CHECK(cfp::invalid_field(options).string() == "min_pairs");
  options = {};
  options.unknown_object_probability = 1.5;
  CHECK(cfp::invalid_field(options).string() == "unknown_object_probability");
}
