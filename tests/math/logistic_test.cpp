#include "cfp/math/logistic.hpp"

#include <cfenv>
#include <cmath>
#include <limits>
#include <vector>

#include "support/allocation_counter.hpp"
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

TEMPLATE_TEST_CASE("logistic of an array equals the scalar function", "[math]", float, double) {
  for (const std::size_t n : {0UL, 1UL, 2UL, 63UL, 64UL, 65UL, 200UL}) {
    std::vector<TestType> x(n), out(n, TestType(-7));
    for (std::size_t i = 0; i < n; ++i) x[i] = TestType(0.31) * (TestType(i) - TestType(80));
    const auto hostile = cfp_test::hostile_numbers<TestType>();
    for (std::size_t i = 0; i < n && i < hostile.size(); ++i) x[n - 1 - i] = hostile[i];
    CHECK(cfp_test::allocations_in([&] { logistic(cfp::span<const TestType>(x), cfp::span<TestType>(out)); }) == 0);
    for (std::size_t i = 0; i < n; ++i) {
      CAPTURE(n, i, x[i]);
      CHECK((out[i] >= 0 && out[i] <= 1));
      CHECK_THAT(out[i], WithinAbs(logistic(x[i]), 4 * std::numeric_limits<TestType>::epsilon()));
      if (std::abs(x[i]) < 80)
        CHECK(cfp_test::relative_difference(out[i], logistic(x[i])) <= 8 * std::numeric_limits<TestType>::epsilon());
    }
    std::vector<TestType> in_place = x;
    logistic(cfp::span<TestType>(in_place), cfp::span<TestType>(in_place));
    CHECK(in_place == out);
  }
}
