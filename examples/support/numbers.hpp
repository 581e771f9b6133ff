// Numbers in files, the same whatever the locale of the program that calls: a point before the decimals, no groups.
#pragma once

#include <charconv>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>

namespace cfp_examples {

/// The number that the whole word is; a leading plus is allowed. Nothing: it is none.
inline std::optional<double> read_number(std::string_view word) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size()) return std::nullopt;
  return value;
}

/// Takes the mark away that some editors put before the first line of a text in UTF-8.
inline void drop_byte_order_mark(std::string& line) {
  if (line.rfind("\xEF\xBB\xBF", 0) == 0) line.erase(0, 3);
}

/// As printf's %.<decimals>f.
inline std::string fixed(double value, int decimals) {
  char text[512];
  const auto result = std::to_chars(text, text + sizeof text, value, std::chars_format::fixed, decimals);
  return {text, result.ptr};
}

/// As printf's %.<digits>g.
inline std::string general(double value, int digits) {
  char text[512];
  const auto result = std::to_chars(text, text + sizeof text, value, std::chars_format::general, digits);
  return {text, result.ptr};
}

}  // namespace cfp_examples
