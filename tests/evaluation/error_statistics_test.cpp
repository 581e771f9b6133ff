#include "cfp/evaluation/error_statistics.hpp"

#include <limits>
#include <vector>

#include "cfp/core/random.hpp"
#include "support/catch.hpp"

TEST_CASE("Statistics of a small set equal those by hand", "[evaluation]") {
  std::vector<double> odd{3, 1, 2}, even{4, 1, 3, 2}, one{7};
  const auto a = cfp::error_statistics(odd);
  CHECK(a.count == 3);
  CHECK_THAT(a.rmse, WithinAbs(std::sqrt(14.0 / 3), 1e-15));
  CHECK_THAT(a.standard_deviation, WithinAbs(std::sqrt(2.0 / 3), 1e-15));
  CHECK(a.mean == 2);
  CHECK(a.median == 2);
  CHECK(a.minimum == 1);
  CHECK(a.maximum == 3);
  CHECK(cfp::error_statistics(even).median == 2.5);
  const auto c = cfp::error_statistics(one);
  CHECK(c.median == 7);
  CHECK(c.rmse == 7);
  CHECK(c.standard_deviation == 0);
}

TEST_CASE("rmse squared is mean squared plus S.D. squared, and the median splits the errors", "[evaluation]") {
  cfp::Random random(31, "statistics");
  for (std::size_t n = 1; n < 60; ++n) {
    std::vector<double> errors(n);
    for (double& error : errors) error = std::abs(random.normal());
    const auto s = cfp::error_statistics(errors);
    CHECK_THAT(s.rmse * s.rmse, WithinAbs(s.mean * s.mean + s.standard_deviation * s.standard_deviation, 1e-12));
    CHECK(std::count_if(errors.begin(), errors.end(), [&](double e) { return e < s.median; }) <=
          static_cast<std::ptrdiff_t>(n / 2));
    CHECK(std::count_if(errors.begin(), errors.end(), [&](double e) { return e > s.median; }) <=
          static_cast<std::ptrdiff_t>(n / 2));
  }
}

TEST_CASE("Empty, zero and huge errors give finite statistics", "[evaluation]") {
  std::vector<double> none, zero(5, 0.0), huge(4, (std::numeric_limits<double>::max)());
  CHECK(cfp::error_statistics(none).count == 0);
  CHECK(cfp::error_statistics(none).rmse == 0);
  CHECK(cfp::error_statistics(zero).maximum == 0);
  const auto s = cfp::error_statistics(huge);
  for (const double x : {s.rmse, s.mean, s.median, s.standard_deviation}) CHECK(cfp::is_finite(x));
}
