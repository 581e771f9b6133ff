// Tables of properties as test cases: each row is run, and the number of a run that fails is printed with its name.
#pragma once

#include "cfp_testing/property.hpp"
#include "support/catch.hpp"

namespace cfp_test {

inline void check_all(std::initializer_list<cfp_testing::Property> properties) {
  for (const cfp_testing::Property& property : properties) {
    INFO(property.name << "; -1 is no failing run");
    CHECK(cfp_testing::first_failure(property.runs, property.holds) == cfp_testing::no_failure);
  }
}

}  // namespace cfp_test

/// CFP_PROPERTIES(name, tags, {name, runs, [](cfp::Random&) -> bool}, …)
#define CFP_PROPERTIES(name, tags, ...) \
  TEST_CASE(name, tags) { cfp_test::check_all({__VA_ARGS__}); }
