// The one place that knows which Catch2 is in use. TEST_CASE, TEMPLATE_TEST_CASE, GENERATE and the matchers carry the
// same names in versions 2 and 3.
#pragma once

#ifdef CFP_TEST_CATCH2_V2
#include <catch2/catch.hpp>
#else
#include <catch2/catch_all.hpp>
#endif

#include <iostream>

using Catch::Matchers::WithinAbs;

/// Ends a test case whose precondition this machine does not meet (no real data, say); ctest reports it as skipped.
#define CFP_SKIP(reason)                                   \
  do {                                                     \
    std::cout << "CFP_SKIPPED: " << (reason) << std::endl; \
    return;                                                \
  } while (false)
