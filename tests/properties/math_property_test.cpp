#include "support/generators.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "cfp/math/chi_squared.hpp"
#include "cfp/math/logistic.hpp"
#include "cfp/math/order_statistic.hpp"

using cfp_test::any_number;
using cfp_test::real;

TEST_CASE("properties of chi-squared", "[properties]") {
  rc::prop("survival is in [0, 1] and density finite and >= 0 for any bits", [] {
    const int k = *rc::gen::element(1, 2, *rc::gen::inRange(1, 101), *rc::gen::arbitrary<int>());
    const double x = any_number<double, std::uint64_t>();
    const double survival = cfp::chi_squared_survival(x, k), density = cfp::chi_squared_density(x, k);
    RC_ASSERT(survival >= 0 && survival <= 1);
    RC_ASSERT(density >= 0 && cfp::is_finite(density));
    const float xf = any_number<float, std::uint32_t>();
    RC_ASSERT(cfp::chi_squared_survival(xf, k) >= 0 && cfp::chi_squared_survival(xf, k) <= 1);
    RC_ASSERT(cfp::chi_squared_density(xf, k) >= 0 && cfp::is_finite(cfp::chi_squared_density(xf, k)));
  });
  rc::prop("survival does not increase in x and does not decrease in k", [] {
    const int k = *rc::gen::inRange(1, 81), more_k = k + *rc::gen::inRange(0, 21);
    const double x = real(0, 120), more_x = x + real(0, 20);
    const double survival = cfp::chi_squared_survival(x, k);
    RC_ASSERT(cfp::chi_squared_survival(more_x, k) <= survival * (1 + 1e-13));
    RC_ASSERT(cfp::chi_squared_survival(x, more_k) >= survival * (1 - 1e-13));
  });
  rc::prop("float equals double within its rounding", [] {
    const int k = *rc::gen::inRange(1, 21);
    const double x = real(0.01, 40);
    const float xf = static_cast<float>(x);
    RC_ASSERT(std::abs(cfp::chi_squared_survival(xf, k) - cfp::chi_squared_survival(static_cast<double>(xf), k)) <=
              1e-6);
  });
}

TEST_CASE("properties of logistic", "[properties]") {
  rc::prop("in [0, 1] for any bits", [] {
    const float single = any_number<float, std::uint32_t>();
    RC_ASSERT(cfp::logistic(single) >= 0 && cfp::logistic(single) <= 1);
    const double value = any_number<double, std::uint64_t>();
    RC_ASSERT(cfp::logistic(value) >= 0 && cfp::logistic(value) <= 1);
  });
  rc::prop("non-decreasing, and symmetric about one half", [] {
    const double x = real(-50, 50), more = x + real(0, 10);
    RC_ASSERT(cfp::logistic(more) >= cfp::logistic(x));
    RC_ASSERT(std::abs(cfp::logistic(x) + cfp::logistic(-x) - 1) <= 3e-16);
  });
}

TEST_CASE("properties of order statistics", "[properties]") {
  rc::prop("equal to sorting, for any numbers but NaN, in any order", [] {
    std::vector<double> values(static_cast<std::size_t>(*rc::gen::inRange(1, 400)));
    const bool few_values = *rc::gen::arbitrary<bool>();
    for (double& value : values) {
      value = few_values ? real(-1, 1) : any_number<double, std::uint64_t>();
      if (!(value == value)) value = 0;
    }
    std::vector<double> sorted = values;
    std::sort(sorted.begin(), sorted.end());
    const std::size_t rank = static_cast<std::size_t>(*rc::gen::inRange(0, static_cast<int>(values.size())));
    std::vector<double> scratch = values;
    RC_ASSERT(cfp::order_statistic(cfp::span<double>(scratch), rank) == sorted[rank]);
    scratch.assign(values.rbegin(), values.rend());
    RC_ASSERT(cfp::order_statistic(cfp::span<double>(scratch), rank) == sorted[rank]);
    for (const double quantile : {0.1, 0.2, 0.3}) {  // one after the other in the same values, as O does
      const std::size_t of_quantile = cfp::quantile_rank(quantile, values.size()) - 1;
      RC_ASSERT(cfp::order_statistic(cfp::span<double>(scratch), of_quantile) == sorted[of_quantile]);
    }
  });
  rc::prop("quantile_rank grows with q and with n", [] {
    const std::size_t n = static_cast<std::size_t>(*rc::gen::inRange(1, 100000));
    const double q = real(0, 1), more = std::fmin(1.0, q + real(0, 0.5));
    RC_ASSERT(cfp::quantile_rank(more, n) >= cfp::quantile_rank(q, n));
    RC_ASSERT(cfp::quantile_rank(q, n + 1) >= cfp::quantile_rank(q, n));
    RC_ASSERT(static_cast<double>(cfp::quantile_rank(q, n)) >= q * static_cast<double>(n) * (1 - 1e-15));
  });
}
