#include "cfp/math/exponential.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "support/catch.hpp"

namespace {

template <typename Scalar>
Scalar largest_error_ulps(Scalar from, Scalar to, std::size_t steps) {
  long double worst = 0;
  for (std::size_t first = 0; first < steps; first += cfp::detail::chunk_size) {
    cfp::detail::Chunk<Scalar> x, e;
    for (std::size_t i = 0; i < cfp::detail::chunk_size; ++i) {
      const double share = (static_cast<double>(first + i) + 0.5) / static_cast<double>(steps);
      x.data()[i] = (std::min)(Scalar(0), from + (to - from) * static_cast<Scalar>(share));
    }
    e = cfp::detail::exponential_of_nonpositive(x);
    for (std::size_t i = 0; i < cfp::detail::chunk_size; ++i) {
      const long double expected = std::exp(static_cast<long double>(x.data()[i]));
      const Scalar rounded = static_cast<Scalar>(expected);
      const long double ulp = rounded - std::nextafter(rounded, Scalar(0));
      worst = (std::max)(worst, std::abs(static_cast<long double>(e.data()[i]) - expected) / ulp);
    }
  }
  return static_cast<Scalar>(worst);
}

template <typename Scalar>
Scalar one(Scalar x) {
  cfp::detail::Chunk<Scalar> chunk;
  chunk.setConstant(x);
  chunk = cfp::detail::exponential_of_nonpositive(chunk);
  CHECK((chunk == chunk[0]).all());
  return chunk[0];
}

}  // namespace

TEMPLATE_TEST_CASE("The exponential of a chunk is within 1.5 units in the last place of the standard one", "[math]",
                   float, double) {
  const TestType lowest = cfp::detail::Exponential<TestType>::lowest;
  CHECK(largest_error_ulps(lowest, TestType(0), 1U << 18U) < TestType(1.5));
  CHECK(largest_error_ulps(TestType(-2), TestType(0), 1U << 18U) < TestType(1.5));
  CHECK(largest_error_ulps(TestType(-1e-3), TestType(0), 1U << 14U) < TestType(1.5));
}

TEMPLATE_TEST_CASE("The exponential of a chunk is exact at the ends and never out of range", "[math]", float, double) {
  using limits = std::numeric_limits<TestType>;
  CHECK(one(TestType(0)) == 1);
  CHECK(one(TestType(-0.0)) == 1);
  CHECK(one(-(limits::denorm_min)()) == 1);
  CHECK(one(-limits::infinity()) == 0);
  CHECK(one(limits::lowest()) == 0);
  CHECK(one(limits::quiet_NaN()) == 0);
  const TestType lowest = cfp::detail::Exponential<TestType>::lowest;
  CHECK(one(lowest) >= (limits::min)());
  CHECK(one(std::nextafter(lowest, -limits::infinity())) == 0);
}

TEMPLATE_TEST_CASE("The exponential of a chunk never decreases where the argument grows by more than its rounding",
                   "[math]", float, double) {
  TestType previous = 0;
  for (TestType x = TestType(-40); x <= 0; x += TestType(0.00390625)) {
    const TestType e = one(x);
    CHECK(e > previous);
    previous = e;
  }
}
