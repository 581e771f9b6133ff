#include "cfp/math/order_statistic.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "cfp/core/random.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"
#include "support/counted.hpp"
#include "support/numbers.hpp"

using cfp::span;

namespace {

/// Value sets that stress the pivots: wide, narrow, clustered, tied, of both signs, with extremes.
template <typename Scalar>
std::vector<std::vector<Scalar>> value_sets(std::size_t n) {
  cfp::Random random(n, "order statistic");
  std::vector<std::vector<Scalar>> sets(10, std::vector<Scalar>(n));
  for (std::size_t i = 0; i < n; ++i) {
    sets[0][i] = static_cast<Scalar>(random.uniform());
    sets[1][i] = static_cast<Scalar>(random.normal());
    sets[2][i] = static_cast<Scalar>(std::exp(20 * random.normal()));
    sets[3][i] = Scalar(1) + static_cast<Scalar>(random.index(50)) * std::numeric_limits<Scalar>::epsilon();
    sets[4][i] = Scalar(7);
    sets[5][i] = static_cast<Scalar>(random.index(3));
    sets[6][i] = i % 97 == 0 ? std::numeric_limits<Scalar>::max()
                             : static_cast<Scalar>(random.index(1000)) * std::numeric_limits<Scalar>::denorm_min();
    sets[7][i] = i % 2 == 0 ? Scalar(0.0) : Scalar(-0.0);
    sets[8][i] = static_cast<Scalar>(i);
    sets[9][i] = static_cast<Scalar>(i < n / 2 ? i : n - i);  // the pivots are extremes
  }
  if (n > 3) sets[1][n / 2] = std::numeric_limits<Scalar>::infinity();
  if (n > 3) sets[1][n / 3] = -std::numeric_limits<Scalar>::infinity();
  return sets;
}

}  // namespace

TEMPLATE_TEST_CASE("order_statistic equals the sorted array's element", "[math]", float, double) {
  for (const std::size_t n : {1UL, 2UL, 3UL, 10UL, 48UL, 49UL, 50UL, 333UL, 1000UL, 4097UL}) {
    for (const std::vector<TestType>& values : value_sets<TestType>(n)) {
      std::vector<TestType> sorted = values;
      std::sort(sorted.begin(), sorted.end());
      std::vector<TestType> scratch(n);
      for (const std::size_t rank : {std::size_t(0), n / 10, n / 3, n / 2, n - 1 - n / 5, n - 1}) {
        scratch = values;
        CAPTURE(n, rank);
        TestType selected{};
        const std::size_t allocations =
            cfp_test::allocations_in([&] { selected = cfp::order_statistic(span<TestType>(scratch), rank); });
        CHECK(selected == sorted[rank]);
        CHECK(allocations == 0);
      }
    }
  }
}

TEST_CASE("quantile_rank is the exact ceiling of the decimal product", "[math]") {
  for (std::size_t n = 1; n <= 3000; ++n) {
    for (std::size_t tenths = 1; tenths <= 10; ++tenths) {
      const std::size_t exact = (tenths * n + 9) / 10;
      CAPTURE(n, tenths);
      REQUIRE(cfp::quantile_rank(static_cast<double>(tenths) / 10, n) == exact);
      REQUIRE(cfp::quantile_rank(0.1 * static_cast<double>(tenths), n) == exact);
    }
  }
  CHECK(cfp::quantile_rank(0.1, 30) == 3);
  CHECK(cfp::quantile_rank(0.1, 31) == 4);
}

TEST_CASE("quantile_rank stays within 1 and n for any q", "[math]") {
  for (const double q : cfp_test::hostile_numbers<double>()) {
    for (const std::size_t n :
         {std::size_t(1), std::size_t(2), std::size_t(1000), std::numeric_limits<std::size_t>::max()}) {
      const std::size_t rank = cfp::quantile_rank(q, n);
      CHECK((rank >= 1 && rank <= n));
      if (!(q > 0)) CHECK(rank == 1);
      if (q >= 1) CHECK(rank == n);
    }
    CHECK(cfp::quantile_rank(q, 0) == 0);
  }
}

TEST_CASE("A rank beyond the end counts as the last", "[math]") {
  std::vector<double> values = {3, 1, 2};
  CHECK(cfp::order_statistic(span(values), 3) == 3);
  CHECK(cfp::order_statistic(span(values), 1000) == 3);
}

TEST_CASE("A quantile is the value at its rank", "[math]") {
  std::vector<double> values = {5, 1, 4, 2, 3};
  CHECK(cfp::quantile(span(values), 0.5) == 3);
  CHECK(cfp::quantile(span(values), 0.2) == 1);
  CHECK(cfp::quantile(span(values), 0.21) == 2);
  CHECK(cfp::quantile(span(values), 1) == 5);
  CHECK(cfp::quantile(span<double>(), 0.5) == 0);
}

TEMPLATE_TEST_CASE("no values give 0", "[math]", float, double) {
  CHECK(cfp::order_statistic(span<TestType>(), 0) == 0);
}

TEMPLATE_TEST_CASE("order_statistic ends and stays in memory when values are NaN", "[math]", float, double) {
  cfp::Random random(3, "NaN");
  for (int round = 0; round < 200; ++round) {
    const std::uint32_t share = 1U + random.index(4);
    std::vector<TestType> values(40 + random.index(400));
    for (TestType& value : values) {
      value = static_cast<TestType>(random.normal());
      if (random.index(4) < share)
        value =
            round % 2 == 0 ? std::numeric_limits<TestType>::quiet_NaN() : -std::numeric_limits<TestType>::quiet_NaN();
    }
    const std::size_t rank = random.index(static_cast<std::uint32_t>(values.size()));
    const std::size_t numbers =
        static_cast<std::size_t>(std::count_if(values.begin(), values.end(), [](TestType x) { return x == x; }));
    std::vector<TestType> kept = values;
    (void)cfp::order_statistic(span<TestType>(values), rank);
    // What comes out is one of the values that went in.
    const TestType selected = cfp::order_statistic(span<TestType>(kept), rank);
    CHECK(((numbers < kept.size() && selected != selected) || (selected >= TestType(-10) && selected <= TestType(10))));
  }
}

TEST_CASE("An order statistic takes a few comparisons of each value, whatever their order", "[math]") {
  using cfp_test::Counted;
  for (const std::size_t n : {1000UL, 20000UL}) {
    const auto sets = value_sets<double>(n);
    for (std::size_t set = 0; set < 9; ++set) {  // in the last the pivots are extremes
      for (const std::size_t rank : {n / 10, n / 2, n - 1 - n / 5}) {
        std::vector<Counted> values;
        for (const double value : sets[set]) values.emplace_back(value);
        Counted::comparisons() = 0;
        (void)cfp::order_statistic(span<Counted>(values), rank);
        const double each = static_cast<double>(Counted::comparisons()) / static_cast<double>(n);
        CAPTURE(n, set, rank, each);
        CHECK(each < 8);
      }
    }
  }
}
