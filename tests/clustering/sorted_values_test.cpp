#include "cfp/clustering/dbscan.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "cfp/core/random.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"
#include "support/counted.hpp"

TEMPLATE_TEST_CASE("Values are sorted as std::stable_sort sorts their indices", "[clustering]", float, double) {
  using Limits = std::numeric_limits<TestType>;
  const std::vector<TestType> extremes{Limits::quiet_NaN(),   Limits::infinity(), -Limits::infinity(),
                                       (Limits::max)(),       Limits::lowest(),   Limits::denorm_min(),
                                       -Limits::denorm_min(), TestType(0),        TestType(-0.0),
                                       TestType(1e30F),       TestType(1),        TestType(2)};
  const auto keep = [](TestType value) { return cfp::is_finite(value); };
  cfp::Random random(41, "sorting");
  cfp::DbscanWorkspace<TestType> workspace;
  for (int round = 0; round < 600; ++round) {
    std::vector<TestType> values(random.index(round % 10 == 0 ? 2000 : 60));
    const std::uint32_t kind = random.index(4);  // spread; on a grid; one wild outlier; hostile
    for (TestType& value : values) {
      value = static_cast<TestType>(random.uniform(-3, 8));
      if (kind == 1) value = static_cast<TestType>(random.index(9));
      if (kind == 3) value = extremes[random.index(static_cast<std::uint32_t>(extremes.size()))];
    }
    if (kind == 2 && !values.empty()) values[0] = TestType(1e30F);
    std::vector<std::uint32_t> expected;
    for (std::uint32_t i = 0; i < values.size(); ++i) {
      if (keep(values[i])) expected.push_back(i);
    }
    std::stable_sort(expected.begin(), expected.end(),
                     [&](std::uint32_t a, std::uint32_t b) { return values[a] < values[b]; });
    const cfp::SortedValues<TestType> sorted = cfp::sort_values(values, keep, workspace);
    REQUIRE(std::vector<std::uint32_t>(sorted.index.begin(), sorted.index.end()) == expected);
    for (std::size_t i = 0; i < expected.size(); ++i) REQUIRE(sorted.values[i] == values[expected[i]]);
  }
  const std::vector<TestType> large(2000, TestType(3));
  cfp::sort_values(large, keep, workspace);
  CHECK(cfp_test::allocations_in([&] { cfp::sort_values(large, keep, workspace); }) == 0);
}

TEST_CASE("Sorting takes O(n log n) comparisons", "[clustering]") {
  using cfp_test::Counted;
  cfp::Random random(42, "counted");
  cfp::DbscanWorkspace<Counted> workspace;
  for (const std::size_t n : {100U, 1000U, 20000U}) {
    std::vector<Counted> values(n);
    for (Counted& value : values) value = Counted(random.uniform(-3, 8));
    Counted::comparisons() = 0;
    const cfp::SortedValues<Counted> sorted = cfp::sort_values(
        values, [](Counted) { return true; }, workspace);
    const double each = static_cast<double>(Counted::comparisons()) / static_cast<double>(n);
    CAPTURE(n, each);
    CHECK(each < 3 * std::log2(n));
    CHECK(std::is_sorted(sorted.values.begin(), sorted.values.end()));
  }
}
