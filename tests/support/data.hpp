// Where the real recordings of others are: the environment's CFP_TEST_DATA, else the folder of that name in CMake's
// cache.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

namespace cfp_test {

inline std::filesystem::path data_folder(const std::string& name) {
  const char* root = std::getenv("CFP_TEST_DATA");
  return std::filesystem::path(root != nullptr ? root : CFP_TEST_DATA_DEFAULT) / name;
}

}  // namespace cfp_test

/// Defines `variable` as the path of a file or folder of the real data, or ends the test case as skipped.
#define CFP_REQUIRE_DATA(variable, name)                              \
  const std::filesystem::path variable = cfp_test::data_folder(name); \
  if (!std::filesystem::exists(variable)) CFP_SKIP("no " + variable.string() + "; set CFP_TEST_DATA")
