// Colours and lines of the plots, for pages and for pictures that stand alone.
#pragma once

#include <array>
#include <cstddef>
#include <string>

#include "html.hpp"

namespace cfp_slam {

// One colour per series for light and for dark ground, and the dashes that tell them apart without colour. Series k has
// the classes `c<k>` (colour) and `s<k>` (hidden while its box in the legend is not ticked).
struct SeriesStyle {
  const char *light, *dark, *dashes;
};
inline constexpr std::array<SeriesStyle, 10> series_styles{{{"#d1352b", "#ff7b6e", "none"},
                                                            {"#1461c4", "#6cb0ff", "none"},
                                                            {"#12876f", "#3fd0ae", "7 2"},
                                                            {"#c06a00", "#ffb04d", "6 2 1 2"},
                                                            {"#7c4dbd", "#bf9bff", "4 2"},
                                                            {"#b0307f", "#ff8fcf", "1.5 2"},
                                                            {"#6f7a00", "#cdd84a", "8 2 2 2"},
                                                            {"#00798c", "#5cd3e6", "3 3"},
                                                            {"#8a5a44", "#d9a68c", "5 1.5"},
                                                            {"#5b6573", "#aab4c2", "2 1"}}};

inline std::string series_css(bool dark) {
  std::string css;
  for (std::size_t k = 0; k < series_styles.size(); ++k) {
    css += ".c" + number(k) + "{--c:" + (dark ? series_styles[k].dark : series_styles[k].light) + "}\n";
  }
  return css;
}

// Style rules of everything that a Plot draws, light and dark.
inline std::string plot_style() {
  std::string css = ":root{--ground:#fff;--ink:#1b2028;--soft:#5c6673;--line:#d9dee5;--grid:#e9ecf0;--card:#f6f8fa}\n" +
                    series_css(false) + R"(text{fill:var(--soft)}
.grid-line{stroke:var(--grid);stroke-width:1}
.frame{fill:none;stroke:var(--line)}
.curve{fill:none;stroke:var(--c);stroke-width:1.7;stroke-linecap:round;stroke-linejoin:round}
.truth{fill:none;stroke:var(--ink);stroke-width:5;stroke-linejoin:round;stroke-linecap:round;opacity:.28}
.guide{stroke:var(--soft);stroke-width:1;stroke-dasharray:4 3;fill:none}
.bar{fill:var(--c)}
.dot{fill:var(--c)}
.dots{fill:none;stroke:var(--c);stroke-width:4;stroke-linecap:round}.crosses{fill:none;stroke:var(--c);stroke-width:1.3}
)";
  for (std::size_t k = 0; k < series_styles.size(); ++k) {
    css += ".curve.c" + number(k) + "{stroke-dasharray:" + series_styles[k].dashes + "}\n";
  }
  return css +
         "@media(prefers-color-scheme:dark){:root{--ground:#12161c;--ink:#e6e9ee;--soft:#9aa5b4;--line:#343c48;--grid:#"
         "262d37;"
         "--card:#1a2028;--good:#5fd07f;--bad:#ff8278}\n" +
         series_css(true) + "}\n";
}

}  // namespace cfp_slam
