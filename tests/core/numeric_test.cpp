#include "cfp/core/numeric.hpp"

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "cfp/core/options.hpp"
#include "cfp/core/status.hpp"
#include "cfp/simd/chunk.hpp"
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

TEST_CASE("every status has its own name", "[core]") {
  using cfp::Status;
  CHECK(std::string(cfp::to_string(Status::ok)) == "ok");
  CHECK(std::string(cfp::to_string(Status::not_enough_data)) == "not enough data");
  CHECK(std::string(cfp::to_string(Status::degenerate)) == "degenerate");
  CHECK(std::string(cfp::to_string(Status::invalid_input)) == "invalid input");
  CHECK(std::string(cfp::to_string(static_cast<Status>(77))) == "unknown");
}

TEST_CASE("chunks cover every index once, in order, and pad with zeros", "[core]") {
  for (const std::size_t n : {0UL, 1UL, 63UL, 64UL, 65UL, 128UL, 200UL}) {
    std::vector<float> values(n), copy(n, -1.0F);
    for (std::size_t i = 0; i < n; ++i) values[i] = static_cast<float>(i + 1);
    std::size_t next = 0;
    cfp::detail::for_each_chunk(n, [&](std::size_t first, std::size_t count) {
      CHECK(first == next);
      next = first + count;
      cfp::detail::Chunk<float> chunk;
      cfp::detail::load_chunk(cfp::span<const float>(values), first, count, chunk);
      for (std::size_t i = count; i < cfp::detail::chunk_size; ++i) CHECK(chunk[static_cast<Eigen::Index>(i)] == 0);
      cfp::detail::store_chunk(chunk, first, count, cfp::span<float>(copy));
    });
    CHECK(next == n);
    CHECK(copy == values);
  }
}
