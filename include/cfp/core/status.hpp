/// @file status.hpp
/// How a computation ended. Bad data never throws in cfp: the result carries a documented neutral value and one of
/// these. This and every other enumeration of cfp that is reported has a `to_string`.
#pragma once

#include "cfp/version.hpp"

namespace cfp {

/// Shared by all results whose way of ending needs no words of its own; estimators with more to say (why an optimiser
/// stopped, why a fundamental matrix was refused) define their own reason beside their result.
enum class Status : std::uint8_t {
  ok,               ///< the value was computed as documented
  not_enough_data,  ///< fewer valid samples than the options ask for: the documented neutral value was used
  degenerate,       ///< the samples do not determine the value (all equal, zero baseline, zero line): neutral value
  invalid_input     ///< a scalar argument was NaN, infinite or outside its range: neutral value
};

[[nodiscard]] constexpr const char* to_string(Status status) noexcept {
  constexpr const char* names[] = {"ok", "not enough data", "degenerate", "invalid input"};
  return status <= Status::invalid_input ? names[static_cast<int>(status)] : "unknown";
}

}  // namespace cfp
