// The frame of every page: one file, nothing fetched, all of it readable without a script; light and dark by the
// reader's own setting.
#pragma once

#include <cstddef>
#include <string>

#include "html.hpp"
#include "style.hpp"

namespace cfp_slam {

inline std::string style_sheet() {
  std::string css = R"(
:root{color-scheme:light dark}
*{box-sizing:border-box}
html{-webkit-text-size-adjust:100%}
body{margin:0 auto;padding:1.2rem 1rem 3rem;max-width:1180px;font:15px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,"DejaVu Sans",sans-serif;background:var(--ground);color:var(--ink)}
h1{font-size:1.6rem;line-height:1.25;margin:0 0 .3rem}
h2{font-size:1.3rem;margin:2.4rem 0 .4rem;padding-top:.8rem;border-top:2px solid var(--line);overflow-wrap:anywhere}
h3{font-size:1.05rem;margin:1.8rem 0 .3rem}
p{margin:.3rem 0 .8rem;max-width:75ch}
.note,figcaption{color:var(--soft);font-size:.87rem}
code{font-size:.92em}
.grid{columns:2 440px;column-gap:1rem}
.grid>figure{margin:0 0 1rem;break-inside:avoid}
.pictures{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,330px),1fr));gap:1rem;align-items:start}
.pairs{grid-template-columns:repeat(auto-fill,minmax(min(100%,440px),1fr))}
figure{margin:0;padding:.7rem;background:var(--card);border:1px solid var(--line);border-radius:8px;min-width:0}
figcaption{margin:.35rem 0 0}
figure>strong{display:block;margin-bottom:.2rem;font-size:.95rem}
figure img{display:block;width:100%;height:auto;border-radius:4px}
.explained{display:grid;grid-template-columns:minmax(0,5fr) minmax(0,4fr);gap:1rem;margin-bottom:1rem}
.explained svg{display:block;width:100%;height:auto;border-radius:4px;cursor:crosshair;touch-action:manipulation}
.explained pre{margin:0;padding:.6rem .8rem;min-height:15.5em;background:var(--ground);border:1px solid var(--line);border-radius:6px;font:13px/1.5 ui-monospace,"DejaVu Sans Mono",monospace;white-space:pre-wrap;overflow-wrap:anywhere}
.explained button{font:inherit;font-size:.87rem;padding:.15rem .7rem;border:1px solid var(--line);border-radius:6px;background:var(--ground);color:var(--ink);cursor:pointer}
.explained circle{--k:hsl(calc(120*var(--w)),100%,50%);stroke:#0008;stroke-width:.7;fill:var(--k)}
.explained .behind{fill:#0000;stroke:var(--k);stroke-width:1.6}.explained .outside{r:1.8px}
.explained .ring{fill:none;stroke:#fff;stroke-width:2.5;filter:drop-shadow(0 0 1px #000)}
@media(max-width:800px){.explained{grid-template-columns:minmax(0,1fr)}}
details{margin:1rem 0}summary{cursor:pointer;margin-bottom:.6rem;font-weight:600}
.scroll{overflow-x:auto;margin:.4rem 0 1rem}
table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:.9rem}
th,td{padding:.28rem .6rem;text-align:right;border-bottom:1px solid var(--line);white-space:nowrap}
thead th{vertical-align:bottom;border-bottom:2px solid var(--soft);white-space:normal;font-weight:600}
th:first-child,td:first-child{text-align:left;position:sticky;left:0;background:var(--ground)}
figure th:first-child,figure td:first-child{background:var(--card)}
tbody th{font-weight:500}
.words td,.words th{text-align:left;white-space:normal;vertical-align:top;min-width:5rem}
.words th:first-child{position:static;min-width:13rem;font-weight:400}.words td:last-child{min-width:20rem}
td b{font-weight:700}td u{text-underline-offset:2px}
.range{color:var(--soft);font-size:.85em}
.own th,.own td{background:var(--card)}
.legend{display:flex;flex-wrap:wrap;gap:.2rem 1rem;margin:.3rem 0 .6rem;font-size:.9rem}
.legend label,.legend span{display:inline-flex;flex-wrap:wrap;align-items:center;gap:.35rem}
.legend input{margin:0;accent-color:var(--soft)}
.legend svg{width:26px;height:10px}
.swatch{width:.9em;height:.9em;display:inline-block;border-radius:2px}
.ramp{width:5em;height:.8em;display:inline-block;border-radius:2px;background:linear-gradient(90deg,#f00,#ff0,#0f0)}
svg.plot{display:block;width:100%;height:auto;font-size:11px}
@media(max-width:600px){svg.plot{font-size:13px}}
@media print{body{max-width:none}figure{break-inside:avoid}}
)";
  for (std::size_t k = 0; k < series_styles.size(); ++k) {
    css += "section:has(.t" + number(k) + ":not(:checked)) .s" + number(k) + "{display:none}\n";
  }
  return css + plot_style();
}

inline std::string page(const std::string& title, const std::string& body) {
  return "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" "
         "content=\"width=device-width, "
         "initial-scale=1\">\n<title>" +
         escape(title) + "</title>\n<style>" + style_sheet() + "</style>\n</head>\n<body>\n" + body +
         "</body>\n</html>\n";
}

}  // namespace cfp_slam
