// Text for HTML and SVG: nothing reaches a page unescaped, no number that is not finite.
#pragma once

#include <cmath>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "../support/numbers.hpp"

namespace cfp_slam {

// For text and for attributes in double quotes. Control characters, which no XML may hold, become spaces.
inline std::string escape(std::string_view text) {
  std::string out;
  out.reserve(text.size());
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out += static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t' ? ' ' : c;
    }
  }
  return out;
}

// Fixed decimals; a dash for what is not finite, an exponent for what has too many digits to be read.
inline std::string number(double value, int decimals) {
  if (!std::isfinite(value)) return "–";
  const std::string text =
      std::abs(value) < 1e9 ? cfp_examples::fixed(value, decimals) : cfp_examples::general(value, 2);
  const std::string_view shown(text);
  return std::string(shown.find_first_of("123456789") == std::string_view::npos && shown[0] == '-' ? shown.substr(1)
                                                                                                   : shown);
}
inline std::string number(std::size_t value) { return std::to_string(value); }

// RFC 4648, with padding.
inline std::string base64(const std::vector<unsigned char>& bytes) {
  constexpr char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t left = bytes.size() - i;
    const unsigned block = (static_cast<unsigned>(bytes[i]) << 16) |
                           (left > 1 ? static_cast<unsigned>(bytes[i + 1]) << 8 : 0u) |
                           (left > 2 ? static_cast<unsigned>(bytes[i + 2]) : 0u);
    out += digits[block >> 18];
    out += digits[(block >> 12) & 63u];
    out += left > 1 ? digits[(block >> 6) & 63u] : '=';
    out += left > 2 ? digits[block & 63u] : '=';
  }
  return out;
}

}  // namespace cfp_slam
