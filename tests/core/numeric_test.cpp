#include "cfp/core/numeric.hpp"

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "cfp/core/status.hpp"
#include "support/catch.hpp"
#include "support/numbers.hpp"

TEMPLATE_TEST_CASE("is_finite, clamp_probability and is_valid_depth on every kind of number", "[core]", float, double) {
  for (const TestType x : cfp_test::hostile_numbers<TestType>()) {
    CAPTURE(x);
    CHECK(cfp::is_finite(x) == std::isfinite(x));
    const TestType p = cfp::clamp_probability(x);
    CHECK((p >= 0 && p <= 1));
    if (x >= 0 && x <= 1) CHECK(p == x);
    CHECK(cfp::is_valid_depth(x) == (std::isfinite(x) && x > 0));
  }
  CHECK(cfp::clamp_probability(std::numeric_limits<TestType>::quiet_NaN()) == 0);
  CHECK(cfp::clamp_probability(std::numeric_limits<TestType>::infinity()) == 1);
}

TEST_CASE("The tolerances are those documented", "[core]") {
  using InDouble = cfp::Tolerance<double>;
  using InFloat = cfp::Tolerance<float>;
  CHECK((InDouble::small_angle == 1e-5 && InDouble::min_depth == 1e-6 && InDouble::degenerate == 1e-12));
  CHECK((InFloat::small_angle == 1e-2F && InFloat::min_depth == 1e-6F && InFloat::degenerate == 1e-6F));
}

TEST_CASE("every status has its own name", "[core]") {
  using cfp::Status;
  CHECK(std::string(cfp::to_string(Status::ok)) == "ok");
  CHECK(std::string(cfp::to_string(Status::not_enough_data)) == "not enough data");
  CHECK(std::string(cfp::to_string(Status::degenerate)) == "degenerate");
  CHECK(std::string(cfp::to_string(Status::invalid_input)) == "invalid input");
  CHECK(std::string(cfp::to_string(static_cast<Status>(77))) == "unknown");
}
