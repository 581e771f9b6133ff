#include "cfp/optimization/levenberg_marquardt.hpp"

#include <limits>
#include <string>

#include "support/catch.hpp"

TEST_CASE("The damping follows Nielsen's rule", "[optimization][levenberg_marquardt]") {
  cfp::LevenbergMarquardtOptions options;
  options.initial_damping = 1;
  cfp::Damping damping(options);
  CHECK(damping.accept(1.0));
  CHECK_THAT(damping.value(), WithinAbs(1.0 / 3, 1e-15));
  CHECK(damping.accept(0.5));
  CHECK_THAT(damping.value(), WithinAbs(1.0 / 3, 1e-15));
  CHECK(damping.accept(0.25));
  CHECK_THAT(damping.value(), WithinAbs(1.125 / 3, 1e-15));
  CHECK_FALSE(damping.accept(0));
  CHECK_FALSE(damping.accept(std::numeric_limits<double>::quiet_NaN()));
  damping.reject();
  CHECK_THAT(damping.value(), WithinAbs(1.125 / 3 * 2 * 4 * 8, 1e-12));
  CHECK(damping.last_step_rejected());
  CHECK(damping.accept(1e300));
  CHECK_FALSE(damping.last_step_rejected());
}

TEST_CASE("The damping stays in its range and is exhausted only after a refusal at the limit",
          "[optimization][levenberg_marquardt]") {
  cfp::LevenbergMarquardtOptions options;
  options.min_damping = 0.5;
  options.initial_damping = 1;
  options.max_damping = 4;
  cfp::Damping damping(options);
  for (int i = 0; i < 5; ++i) CHECK(damping.accept(1));
  CHECK(damping.value() == 0.5);
  damping.reject();
  damping.reject();
  CHECK(damping.value() == 4);
  CHECK_FALSE(damping.exhausted());
  damping.reject();
  CHECK(damping.exhausted());
  CHECK(damping.value() == 4);
}

TEST_CASE("Options outside their range are named", "[optimization][levenberg_marquardt]") {
  using Options = cfp::LevenbergMarquardtOptions;
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  const auto bad = [](auto member, auto value) {
    Options options;
    options.*member = value;
    const char* field = invalid_field(options);
    return std::string(field != nullptr ? field : "");
  };
  CHECK(invalid_field(Options{}) == nullptr);
  CHECK(bad(&Options::max_iterations, -1) == "max_iterations");
  for (const double value : {0.0, -1.0, nan, inf}) {
    CHECK(bad(&Options::initial_damping, value) == "initial_damping");
    CHECK(bad(&Options::min_damping, value) == "min_damping");
    CHECK(bad(&Options::max_damping, value) == "max_damping");
  }
  for (const double value : {-1.0, nan, inf}) {
    CHECK(bad(&Options::min_relative_decrease, value) == "min_relative_decrease");
    CHECK(bad(&Options::min_absolute_decrease, value) == "min_absolute_decrease");
  }
}
