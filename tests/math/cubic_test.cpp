#include "cfp/math/cubic.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "cfp/core/random.hpp"
#include "support/catch.hpp"

using cfp::real_cubic_roots;

TEMPLATE_TEST_CASE("A cubic gives back the roots it was built from", "[math]", float, double) {
  cfp::Random random(11, "cubic");
  for (int trial = 0; trial < 2000; ++trial) {
    TestType expected[3] = {TestType(random.uniform(-3, 3)), TestType(random.uniform(-3, 3)),
                            TestType(random.uniform(-3, 3))};
    std::sort(expected, expected + 3);
    const TestType gap = (std::min)(expected[1] - expected[0], expected[2] - expected[1]);
    if (gap < TestType(0.05)) continue;
    TestType roots[3];
    REQUIRE(real_cubic_roots(-(expected[0] + expected[1] + expected[2]),
                             expected[0] * expected[1] + expected[0] * expected[2] + expected[1] * expected[2],
                             -expected[0] * expected[1] * expected[2], roots) == 3);
    std::sort(roots, roots + 3);
    const TestType tolerance = TestType(100) * std::numeric_limits<TestType>::epsilon() / (gap * gap);
    for (int i = 0; i < 3; ++i) CHECK_THAT(double(roots[i]), WithinAbs(double(expected[i]), double(tolerance)));
  }
}

TEMPLATE_TEST_CASE("A cubic with one real root gives that one", "[math]", float, double) {
  cfp::Random random(12, "cubic");
  for (int trial = 0; trial < 2000; ++trial) {
    const TestType root = TestType(random.uniform(-3, 3)), re = TestType(random.uniform(-3, 3)),
                   im = TestType(random.uniform(0.3, 3));
    TestType roots[3];
    REQUIRE(real_cubic_roots(-root - 2 * re, re * re + im * im + 2 * re * root, -root * (re * re + im * im), roots) ==
            1);
    CHECK_THAT(double(roots[0]), WithinAbs(double(root), 2000 * double(std::numeric_limits<TestType>::epsilon())));
  }
}

TEST_CASE("Repeated roots are found and bad coefficients give none", "[math]") {
  double roots[3];
  REQUIRE(real_cubic_roots(-4.0, 5.0, -2.0, roots) == 3);  // (x - 1)^2 (x - 2)
  std::sort(roots, roots + 3);
  CHECK_THAT(roots[0], WithinAbs(1, 1e-7));
  CHECK_THAT(roots[1], WithinAbs(1, 1e-7));
  CHECK_THAT(roots[2], WithinAbs(2, 1e-12));
  REQUIRE(real_cubic_roots(0.0, 0.0, 0.0, roots) == 3);
  CHECK(roots[0] == 0.0);
  REQUIRE(real_cubic_roots(3.0, 3.0, 1.0, roots) >= 1);
  CHECK_THAT(roots[0], WithinAbs(-1, 1e-5));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(real_cubic_roots(nan, 0.0, 1.0, roots) == 0);
  CHECK(real_cubic_roots(1e300, 0.0, 1.0, roots) == 0);
}

TEST_CASE("A double root is found however large the third root is beside it", "[math]") {
  for (int twice = -50; twice <= 50; ++twice) {
    for (int once = -200; once <= 200; ++once) {
      const double d = twice, s = once;
      double roots[3];
      CAPTURE(twice, once);
      REQUIRE(real_cubic_roots(-2 * d - s, d * d + 2 * d * s, -d * d * s, roots) == 3);  // (x - d)^2 (x - s)
      std::sort(roots, roots + 3);
      const double expected[3] = {std::min(d, s), d, std::max(d, s)};
      for (int i = 0; i < 3; ++i) CHECK(std::abs(roots[i] - expected[i]) < 1e-4);
    }
  }
}
