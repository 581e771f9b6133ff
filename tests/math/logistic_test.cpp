#include "cfp/math/logistic.hpp"

#include <cfenv>
#include <cmath>
#include <limits>

#include "support/catch.hpp"
#include "support/numbers.hpp"

using cfp::logistic;

TEMPLATE_TEST_CASE("logistic agrees with its definition in long double", "[math]", float, double) {
  for (TestType x = -80; x <= 80; x += TestType(0.37)) {
    const long double expected = 1 / (1 + std::exp(-static_cast<long double>(x)));
    CHECK(std::abs(logistic(x) - expected) <= 4 * std::numeric_limits<TestType>::epsilon() * expected);
  }
  CHECK(logistic(TestType(0)) == TestType(0.5));
}

TEMPLATE_TEST_CASE("logistic saturates without overflow", "[math]", float, double) {
  using limits = std::numeric_limits<TestType>;
  std::feclearexcept(FE_ALL_EXCEPT);
  for (const TestType x : {TestType(1e3), TestType(1e30), (limits::max)(), limits::infinity()}) {
    CHECK(logistic(x) == 1);
    CHECK(logistic(-x) == 0);
  }
  CHECK(std::fetestexcept(FE_OVERFLOW | FE_DIVBYZERO | FE_INVALID) == 0);
  CHECK(logistic(limits::quiet_NaN()) == 0);
}

TEMPLATE_TEST_CASE("logistic stays within 0 and 1 and never decreases", "[math]", float, double) {
  for (const TestType x : cfp_test::hostile_numbers<TestType>()) CHECK((logistic(x) >= 0 && logistic(x) <= 1));
  TestType before = 0;
  for (TestType x = -120; x <= 120; x += TestType(0.0137)) {
    REQUIRE(logistic(x) >= before);
    before = logistic(x);
  }
}
