/// @file options.hpp
/// One rule for options: every options struct has a free function `OptionPath invalid_field(const Options&)`, found by
/// argument-dependent lookup, which names the first field outside its documented range:
///
///   if (!(o.eps > 0)) return "eps";
///   if (const OptionPath field = nested("ransac", invalid_field(o.ransac))) return field;   // "ransac.confidence"
///   return {};
///
/// Call `validate` once, when the options are read; nothing checks them again inside the frame loop.
#pragma once

#include <array>
#include <stdexcept>
#include <string>

#include "cfp/core/numeric.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// The dotted name of an option, "coarse.flow.ransac.confidence"; false when there is nothing to name. Holds the names
/// of string literals, innermost first, and allocates nothing before `string`.
class OptionPath {
 public:
  constexpr OptionPath() noexcept = default;
  constexpr OptionPath(const char* field) noexcept : names_{field}, size_(1) {}

  constexpr explicit operator bool() const noexcept { return size_ > 0; }
  [[nodiscard]] std::string string() const {
    std::string path;
    for (std::size_t i = size_; i-- > 0;) path.append(names_[i]).append(i > 0 ? "." : "");
    return path;
  }
  /// `path` as a field of the options struct's member `owner`; nothing stays nothing.
  friend constexpr OptionPath nested(const char* owner, OptionPath path) noexcept {
    if (!path) return path;
    CFP_ASSERT(path.size_ < max_depth);
    path.names_[path.size_++] = owner;
    return path;
  }

 private:
  static constexpr std::size_t max_depth = 8;
  std::array<const char*, max_depth> names_{};
  std::size_t size_ = 0;
};

#if defined(__cpp_exceptions) || defined(_CPPUNWIND)
/// Throws std::invalid_argument that names the offending field. Absent without exceptions: call `invalid_field` there.
template <typename Options>
void validate(const Options& options) {
  if (const OptionPath field = invalid_field(options)) {
    throw std::invalid_argument("cfp: option outside its documented range: " + field.string());
  }
}
#endif

}  // namespace CFP_ISA

namespace detail {
inline namespace CFP_ISA {

// Ranges that several options share; NaN and infinity are in none.
[[nodiscard]] constexpr bool positive(double x) noexcept { return x > 0 && is_finite(x); }
[[nodiscard]] constexpr bool non_negative(double x) noexcept { return x >= 0 && is_finite(x); }
[[nodiscard]] constexpr bool inside_unit_interval(double x) noexcept { return x > 0 && x < 1; }

}  // namespace CFP_ISA
}  // namespace detail

}  // namespace cfp
