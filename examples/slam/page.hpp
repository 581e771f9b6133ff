// The frame of every page: one file, no script, nothing fetched; light and dark by the reader's own setting.
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

#include "html.hpp"

namespace cfp_slam {

// One colour per series for light and for dark ground, and the dashes that tell them apart without colour. Series k has the
// classes `c<k>` (colour) and `s<k>` (hidden while its box in the legend is not ticked).
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

inline std::string style_sheet() {
  std::string css = R"(
:root{color-scheme:light dark;--ground:#fff;--ink:#1b2028;--soft:#5c6673;--line:#d9dee5;--grid:#e9ecf0;--card:#f6f8fa;--good:#137333;--bad:#b3261e}
*{box-sizing:border-box}
html{-webkit-text-size-adjust:100%}
body{margin:0 auto;padding:1.2rem 1rem 3rem;max-width:1180px;font:15px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,"DejaVu Sans",sans-serif;background:var(--ground);color:var(--ink)}
h1{font-size:1.6rem;line-height:1.25;margin:0 0 .3rem}
h2{font-size:1.3rem;margin:2.4rem 0 .4rem;padding-top:.8rem;border-top:2px solid var(--line);overflow-wrap:anywhere}
h3{font-size:1.05rem;margin:1.8rem 0 .3rem}
p{margin:.3rem 0 .8rem;max-width:75ch}
.note,figcaption,caption{color:var(--soft);font-size:.87rem}
code{font-size:.92em}
.grid{columns:2 440px;column-gap:1rem}
.grid>figure{margin:0 0 1rem;break-inside:avoid}
.pictures{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,330px),1fr));gap:1rem;align-items:start}
figure{margin:0;padding:.7rem;background:var(--card);border:1px solid var(--line);border-radius:8px;min-width:0}
figcaption{margin:.35rem 0 0}
figure>strong{display:block;margin-bottom:.2rem;font-size:.95rem}
figure img{display:block;width:100%;height:auto;border-radius:4px}
details{margin:1rem 0}summary{cursor:pointer;margin-bottom:.6rem;font-weight:600}
.scroll{overflow-x:auto;margin:.4rem 0 1rem}
table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:.9rem}
th,td{padding:.28rem .6rem;text-align:right;border-bottom:1px solid var(--line);white-space:nowrap}
thead th{vertical-align:bottom;border-bottom:2px solid var(--soft);white-space:normal;font-weight:600}
th:first-child,td:first-child{text-align:left;position:sticky;left:0;background:var(--ground)}
figure th:first-child,figure td:first-child{background:var(--card)}
tbody th{font-weight:500}
td.words,.words td,.words th{text-align:left;white-space:normal;vertical-align:top;min-width:5rem}
.words th:first-child{position:static;min-width:13rem;font-weight:400}.words td:last-child{min-width:20rem}
caption{text-align:left;padding:0 0 .3rem}
td b{font-weight:700}td u{text-underline-offset:2px}
.range{color:var(--soft);font-size:.85em}
.met{color:var(--good);font-weight:600}.unmet{color:var(--bad);font-weight:600}
.legend{display:flex;flex-wrap:wrap;gap:.2rem 1rem;margin:.3rem 0 .6rem;font-size:.9rem}
.legend label,.legend span{display:inline-flex;align-items:center;gap:.35rem;white-space:nowrap}
.legend input{margin:0;accent-color:var(--soft)}
.legend svg{width:26px;height:10px}
.swatch{width:.9em;height:.9em;display:inline-block;border-radius:2px}
.ramp{width:5em;height:.8em;display:inline-block;border-radius:2px;background:linear-gradient(90deg,#f00,#7f7f00,#0f0)}
svg.plot{display:block;width:100%;height:auto;font-size:11px}
@media(max-width:600px){svg.plot{font-size:13px}}
svg text{fill:var(--soft)}
svg .value{fill:var(--ink)}
.grid-line{stroke:var(--grid);stroke-width:1}
.frame{fill:none;stroke:var(--line)}
.curve{fill:none;stroke:var(--c);stroke-width:1.7;stroke-linecap:round;stroke-linejoin:round}
.truth{fill:none;stroke:var(--ink);stroke-width:2.6;stroke-linejoin:round;stroke-linecap:round;opacity:.55}
.guide{stroke:var(--soft);stroke-width:1;stroke-dasharray:4 3;fill:none}
.bar{fill:var(--c)}
.whisker{stroke:var(--ink);stroke-width:1.2}
.paper{fill:none;stroke:var(--ink);stroke-width:1.6}
.dot{fill:var(--c)}.ring{fill:none;stroke:var(--c);stroke-width:1.4}
.lost{fill:var(--bad)}.skipped{fill:var(--soft)}.relocalised{fill:var(--good)}
@media print{body{max-width:none}figure{break-inside:avoid}}
)";
  css += series_css(false);
  for (std::size_t k = 0; k < series_styles.size(); ++k) {
    const std::string n = number(k);
    css += ".curve.c" + n + "{stroke-dasharray:" + series_styles[k].dashes + "}\n";
    css += "section:has(.t" + n + ":not(:checked)) .s" + n + "{display:none}\n";
  }
  css +=
      "@media(prefers-color-scheme:dark){:root{--ground:#12161c;--ink:#e6e9ee;--soft:#9aa5b4;--line:#343c48;--grid:#262d37;"
      "--card:#1a2028;--good:#5fd07f;--bad:#ff8278}\n" +
      series_css(true) + "}\n";
  return css;
}

inline std::string page(const std::string& title, const std::string& body) {
  return "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width, "
         "initial-scale=1\">\n<title>" +
         escape(title) + "</title>\n<style>" + style_sheet() + "</style>\n</head>\n<body>\n" + body + "</body>\n</html>\n";
}

// Throws when the file cannot be written. A reader never sees half of it: it is renamed into place when complete.
inline void write_text(const std::filesystem::path& file, const std::string& text) {
  if (file.has_parent_path()) std::filesystem::create_directories(file.parent_path());
  std::filesystem::path part = file;
  part += ".part";
  std::ofstream stream(part, std::ios::binary | std::ios::trunc);
  stream << text;
  stream.close();
  if (!stream) throw std::runtime_error("cannot write " + file.string());
  std::filesystem::rename(part, file);
}

}  // namespace cfp_slam
