/// @file property.hpp
/// Property-based tests without a framework: a property is a function of a generator of random numbers that says
/// whether it held; first_failure looks for a run in which it does not.
#pragma once

#include <cstdint>

#include "cfp/core/random.hpp"

namespace cfp_testing {

/// What first_failure gives when the property held in every run.
inline constexpr std::int64_t no_failure = -1;

/// Calls `holds(random)` with the generators of runs 0, 1, ..., `runs` - 1; the number of the first run that gives
/// false, else `no_failure`. Run k alone is `holds(random_of_run(k))`.
[[nodiscard]] inline cfp::Random random_of_run(std::int64_t run) noexcept {
  return cfp::Random(static_cast<std::uint64_t>(run), "property");
}
template <typename Property>
[[nodiscard]] std::int64_t first_failure(std::int64_t runs, Property&& holds) {
  for (std::int64_t run = 0; run < runs; ++run) {
    cfp::Random random = random_of_run(run);
    if (!holds(random)) return run;
  }
  return no_failure;
}

/// A row of a table of properties.
struct Property {
  const char* name;
  std::int64_t runs;
  bool (*holds)(cfp::Random&);
};

}  // namespace cfp_testing
