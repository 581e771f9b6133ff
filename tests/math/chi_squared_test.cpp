#include "cfp/math/chi_squared.hpp"

#include <cmath>
#include <limits>

#include "data/chi_squared_table.hpp"
#include "support/catch.hpp"
#include "support/numbers.hpp"

using cfp::chi_squared_density;
using cfp::chi_squared_survival;
using cfp_test::relative_difference;

TEST_CASE("chi-squared agrees with the reference table", "[math]") {
  for (const cfp_test::ChiSquaredRow& row : cfp_test::chi_squared_table) {
    CAPTURE(row.k, row.x);
    CHECK(relative_difference(chi_squared_density(row.x, row.k), row.density) < 1e-12);
    CHECK(relative_difference(chi_squared_survival(row.x, row.k), row.survival) < 1e-12);
  }
}

TEST_CASE("chi-squared in float agrees with the reference table", "[math]") {
  for (const cfp_test::ChiSquaredRow& row : cfp_test::chi_squared_table) {
    if (row.density < 1e-30 || row.survival < 1e-30 || row.density > 1e30) continue;
    CAPTURE(row.k, row.x);
    const double tolerance = 1e-6 + 1e-7 * (row.x + row.k);  // of rounding x to float
    CHECK(relative_difference<double>(chi_squared_density(static_cast<float>(row.x), row.k), row.density) < tolerance);
    CHECK(relative_difference<double>(chi_squared_survival(static_cast<float>(row.x), row.k), row.survival) <
          tolerance);
  }
}

TEST_CASE("the density is minus the derivative of the survival function", "[math]") {
  for (const int k : {1, 2, 3, 4, 30, 33, 100}) {
    for (const double factor : {0.2, 0.7, 1.0, 1.3}) {
      const double x = k * factor + 0.05;
      const double h = 1e-5 * x;
      const double slope = (chi_squared_survival(x - h, k) - chi_squared_survival(x + h, k)) / (2 * h);
      CAPTURE(k, x);
      const double rounding =
          4 * std::numeric_limits<double>::epsilon() / (2 * h);  // of the two values, which are near 1
      CHECK_THAT(slope, WithinAbs(chi_squared_density(x, k), 1e-7 * chi_squared_density(x, k) + rounding));
    }
  }
}

TEST_CASE("two more degrees of freedom add twice their density to the tail", "[math]") {
  for (const double x : {1e-6, 0.3, 0.999, 1.0, 1.001, 1.999, 2.0, 2.001, 5.0, 80.0}) {
    for (int k = 1; k <= 98; ++k) {
      CAPTURE(x, k);
      const double expected = chi_squared_survival(x, k) + 2 * chi_squared_density(x, k + 2);
      CHECK(relative_difference(chi_squared_survival(x, k + 2), expected) < 1e-12);
      CHECK(relative_difference(chi_squared_density(x, k + 2), chi_squared_density(x, k) * x / k) < 1e-13);
    }
  }
}

TEMPLATE_TEST_CASE("one and two degrees of freedom are by the closed forms, but for the last bit", "[math]", float,
                   double) {
  const double bit = static_cast<double>(std::numeric_limits<TestType>::epsilon());
  for (int i = 1; i <= 1000; ++i) {
    const TestType x = TestType(0.05) * TestType(i);
    CAPTURE(x);
    const TestType half = std::exp(TestType(-0.5) * x);
    const auto near = [&](TestType a, TestType b) { return relative_difference<double>(a, b) <= bit; };
    CHECK(near(chi_squared_survival(x, 1), std::erfc(std::sqrt(TestType(0.5) * x))));
    CHECK(near(chi_squared_survival(x, 2), half));
    CHECK(near(chi_squared_density(x, 1), half / (std::sqrt(x) * TestType(2.50662827463100050242))));
    CHECK(near(chi_squared_density(x, 2), TestType(0.5) * half));
  }
}

TEST_CASE("the density has its mode at k - 2", "[math]") {
  for (const int k : {3, 4, 10, 33, 100}) {
    for (int i = 0; i < 400; ++i)
      CHECK(chi_squared_density(i * k / 100.0, k) <= chi_squared_density(k - 2.0, k) * (1 + 1e-14));
  }
}

TEMPLATE_TEST_CASE("chi-squared at the borders of its domain", "[math]", float, double) {
  using limits = std::numeric_limits<TestType>;
  for (const int k : {1, 2, 3, 4, 40, 100}) {
    CAPTURE(k);
    CHECK(chi_squared_survival(TestType(0), k) == 1);
    CHECK(chi_squared_survival(TestType(-3), k) == 1);
    CHECK(chi_squared_survival(-limits::infinity(), k) == 1);
    CHECK(chi_squared_survival(limits::infinity(), k) == 0);
    CHECK(chi_squared_survival(limits::quiet_NaN(), k) == 0);
    CHECK(chi_squared_density(TestType(-3), k) == 0);
    CHECK(chi_squared_density(limits::infinity(), k) == 0);
    CHECK(chi_squared_density(limits::quiet_NaN(), k) == 0);
    CHECK(chi_squared_density(TestType(0), k) == (k < 2 ? (limits::max)() : TestType(k == 2 ? 0.5 : 0)));
    for (const TestType x : cfp_test::hostile_numbers<TestType>()) {
      const TestType survival = chi_squared_survival(x, k);
      const TestType density = chi_squared_density(x, k);
      CHECK((survival >= 0 && survival <= 1));
      CHECK((density >= 0 && density <= (limits::max)()));
    }
  }
  for (const int k : {0, -1, 101, (std::numeric_limits<int>::max)(), (std::numeric_limits<int>::min)()}) {
    CHECK(chi_squared_survival(TestType(1), k) == 0);
    CHECK(chi_squared_density(TestType(1), k) == 0);
  }
}
