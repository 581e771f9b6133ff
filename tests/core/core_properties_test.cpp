// Properties of numbers and of the random generator, for whatever the generators make.
#include "cfp/core/numeric.hpp"
#include "cfp/core/random.hpp"
#include "cfp_testing/numbers.hpp"
#include "support/properties.hpp"

using cfp::Random;

CFP_PROPERTIES("Properties of numbers", "[core]",
               {"clamping gives a probability, once and for all", 1000,
                [](Random& random) {
                  const double p = cfp::clamp_probability(cfp_testing::any_number<double>(random));
                  return p >= 0 && p <= 1 && cfp::clamp_probability(p) == p;
                }},
               {"clamping keeps the order", 1000,
                [](Random& random) {
                  const double a = random.uniform(-2, 2), b = a + random.uniform(0, 2);
                  return cfp::clamp_probability(a) <= cfp::clamp_probability(b);
                }},
               {"a valid depth is finite and positive", 1000,
                [](Random& random) {
                  const float d = cfp_testing::any_number<float>(random);
                  return cfp::is_valid_depth(d) == (cfp::is_finite(d) && d > 0);
                }},
               {"drawn numbers are in range", 1000,
                [](Random& random) {
                  const auto n = 1 + random.index(1000);
                  const double u = random.uniform(), v = random.uniform(-3, 5);
                  return random.index(n) < n && u >= 0 && u < 1 && v >= -3 && v < 5;
                }},
               {"a seed and a stream are one sequence, another stream another", 100, [](Random& random) {
                  const std::uint64_t seed = random();
                  Random a(seed, "a"), again(seed, "a"), b(seed, "b");
                  const auto first = a();
                  return first == again() && first != b();
                }})

TEST_CASE("The first failing run is named, and gives the same numbers alone", "[core]") {
  const auto small = [](Random& random) { return random.uniform() < 0.9; };
  const std::int64_t run = cfp_testing::first_failure(1000, small);
  REQUIRE(run > 0);
  Random alone = cfp_testing::random_of_run(run);
  CHECK_FALSE(small(alone));
  CHECK(cfp_testing::first_failure(run, small) == cfp_testing::no_failure);
}
