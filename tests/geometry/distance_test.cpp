#include "cfp/geometry/distance.hpp"

#include <cstddef>
#include <cstdint>
#include <vector>

#include "cfp/core/random.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"
#include "support/numbers.hpp"

using cfp::span;

TEMPLATE_TEST_CASE("copy_distances keeps what has_distance accepts, in order", "[geometry]", float, double) {
  cfp::Random random(4, "copy distances");
  const auto hostile = cfp_test::hostile_numbers<TestType>();
  for (const std::size_t n : {0UL, 1UL, 63UL, 64UL, 65UL, 128UL, 300UL}) {
    for (const double missing : {0.0, 0.02, 0.5, 1.0}) {
      std::vector<TestType> from(n), expected;
      for (TestType& d : from) {
        d = static_cast<TestType>(random.uniform(0, 5));
        if (random.uniform() < missing) d = hostile[random.index(static_cast<std::uint32_t>(hostile.size()))];
      }
      for (const TestType d : from) {
        if (cfp::has_distance(d)) expected.push_back(d);
      }
      std::vector<TestType> to(n, TestType(-7));
      std::size_t kept = 0;
      CHECK(cfp_test::allocations_in(
                [&] { kept = cfp::copy_distances(span<const TestType>(from), span<TestType>(to)); }) == 0);
      to.resize(kept);
      CHECK(to == expected);
      kept = cfp::copy_distances(span<const TestType>(from), span<TestType>(from));
      from.resize(kept);
      CHECK(from == expected);
    }
  }
}
