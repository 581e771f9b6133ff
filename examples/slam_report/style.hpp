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

struct PageColour {
  const char *name, *light, *dark;
};
inline constexpr std::array<PageColour, 6> page_colours{{{"ground", "#fff", "#12161c"},
                                                         {"ink", "#1b2028", "#e6e9ee"},
                                                         {"soft", "#5c6673", "#9aa5b4"},
                                                         {"line", "#d9dee5", "#343c48"},
                                                         {"grid", "#e9ecf0", "#262d37"},
                                                         {"card", "#f6f8fa", "#1a2028"}}};

inline std::string colours_css(bool dark) {
  std::string css = ":root{";
  for (const PageColour& c : page_colours) css += std::string("--") + c.name + ':' + (dark ? c.dark : c.light) + ';';
  css += "}\n";
  for (std::size_t k = 0; k < series_styles.size(); ++k)
    css += ".c" + number(k) + "{color:" + (dark ? series_styles[k].dark : series_styles[k].light) + "}\n";
  return css;
}

// A declaration in a colour of the page. Viewers that know no variables, as librsvg, keep the light colour before it.
inline std::string in_colour(const std::string& property, const std::string& name) {
  for (const PageColour& c : page_colours) {
    if (name == c.name) return property + ':' + c.light + ';' + property + ":var(--" + name + ')';
  }
  return {};
}

// Style rules of everything that a Plot draws, light and dark. Series have the colour of their class.
inline std::string plot_style() {
  std::string css = colours_css(false) + "text{" + in_colour("fill", "soft") + "}\n.grid-line{" +
                    in_colour("stroke", "grid") + ";stroke-width:1}\n.frame{fill:none;" + in_colour("stroke", "line") +
                    R"(}
.curve{fill:none;stroke:currentColor;stroke-width:1.7;stroke-linecap:round;stroke-linejoin:round}
.truth{fill:none;stroke-width:5;stroke-linejoin:round;stroke-linecap:round;opacity:.28;)" +
                    in_colour("stroke", "ink") + "}\n.guide{stroke-width:1;stroke-dasharray:4 3;fill:none;" +
                    in_colour("stroke", "soft") + R"(}
.bar{fill:currentColor}
.dot{fill:currentColor}
.dots{fill:none;stroke:currentColor;stroke-width:4;stroke-linecap:round}.crosses{fill:none;stroke:currentColor;stroke-width:1.3}
)";
  for (std::size_t k = 0; k < series_styles.size(); ++k) {
    css += ".curve.c" + number(k) + "{stroke-dasharray:" + series_styles[k].dashes + "}\n";
  }
  return css + "@media(prefers-color-scheme:dark){" + colours_css(true) + "}\n";
}

}  // namespace cfp_slam
