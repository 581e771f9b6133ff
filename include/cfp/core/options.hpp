/// @file options.hpp
/// One rule for options: every options struct has a free function `const char* invalid_field(const Options&) noexcept`
/// found by argument-dependent lookup, which names the first field outside its documented range, or returns nullptr.
/// Call `validate` once, when the options are read; nothing checks them again inside the frame loop.
#pragma once

#include "cfp/version.hpp"

#if defined(__cpp_exceptions) || defined(_CPPUNWIND)
#include <stdexcept>
#include <string>

namespace cfp {

/// Throws std::invalid_argument naming the offending field (dotted for nested options). Absent without exceptions:
/// call `invalid_field` there.
template <typename Options>
void validate(const Options& options) {
  if (const char* field = invalid_field(options)) {
    throw std::invalid_argument(std::string("cfp: option outside its documented range: ") + field);
  }
}

}  // namespace cfp
#endif
