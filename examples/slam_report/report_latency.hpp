// The report on time: per module beside the paper's figures, and per frame.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "html.hpp"
#include "published.hpp"
#include "run_record.hpp"
#include "series.hpp"
#include "summary.hpp"
#include "svg.hpp"

namespace cfp_slam {

inline std::string latency_bars(const Series& series) {
  const RunSummary s = summarize(*series.run);
  std::vector<std::string> names;
  std::vector<std::size_t> modules;
  Range time;
  time.add(0);
  for (std::size_t m = 0; m < module_count; ++m) {
    if (!std::isfinite(s.median_ms[m])) continue;
    modules.push_back(m);
    names.emplace_back(to_string(static_cast<Module>(m)));
    time.add(s.p95_ms[m]);
    const double paper = paper_milliseconds(static_cast<Module>(m), series.run->variant);
    if (std::isfinite(paper)) time.add(paper);
  }
  if (modules.empty()) return {};
  time.add(time.high * 1.4);  // room for the figures at the right
  const double height = Plot::top + Plot::bottom + 22 * static_cast<double>(modules.size());
  Plot plot("Time per module, " + series.name, linear_axis(time, "ms per frame"), row_axis(names), 480, height, 136);
  for (std::size_t k = 0; k < modules.size(); ++k) {
    const double row = static_cast<double>(k), median = s.median_ms[modules[k]], p95 = s.p95_ms[modules[k]];
    plot.shape(plot.box(0, row + 0.22, median, row + 0.78), series.css("bar"));
    const double middle = plot.py(row + 0.5);
    plot.line(plot.px(median), middle, plot.px(p95), middle, "whisker");
    plot.line(plot.px(p95), middle - 4, plot.px(p95), middle + 4, "whisker");
    const double paper = paper_milliseconds(static_cast<Module>(modules[k]), series.run->variant);
    std::string figures = number(median, median < 10 ? 2 : 1);
    if (std::isfinite(paper)) {
      plot.shape("M" + number(plot.px(paper), 1) + ' ' + number(middle - 5, 1) + "l5 5l-5 5l-5 -5z", "paper");
      figures += " (" + number(paper, paper > 30 ? 1 : 2) + ")";
    }
    plot.text(plot.width() - Plot::right - 5, middle + 4, figures, "end", "value");
  }
  return figure("Time per module: " + series.name, plot.svg(), {}, "s" + number(series.style));
}

inline std::string latency_over_time(const std::vector<Series>& all) {
  const double start = start_of(all);
  Range time, ms;
  time.add(0);
  time.add(end_of(all) - start);
  std::vector<TimeSeries> curves;
  std::vector<double> every;
  for (const Series& s : all) {
    TimeSeries curve;
    for (const RunFrame& frame : s.run->frames) {
      const double value = frame.milliseconds[static_cast<std::size_t>(Module::tracking)];
      curve.time_s.push_back(frame.time_s - start);
      curve.value.push_back(value > 0 ? value : not_known);
      if (value > 0) every.push_back(value);
    }
    curves.push_back(curve);
  }
  if (every.empty()) return {};
  ms.add(0);
  ms.add(36);
  ms.add(1.15 * quantile(every, 0.99));
  Plot plot("Time of the tracking thread", linear_axis(time, "time [s]"), linear_axis(ms, "ms per frame"));
  plot.line(Plot::usual_left, plot.py(1000.0 / 30), plot.width() - Plot::right, plot.py(1000.0 / 30), "guide");
  for (const std::size_t k : drawing_order(all)) plot.curve(curves[k].time_s, curves[k].value, all[k].css("curve"));
  return figure("Time of the tracking thread", plot.svg(),
                "Dashed: 33.3 ms, a camera of 30 frames/s. Peaks above the 99th percentile are cut at the border.");
}

inline std::string latency_section(const std::vector<Series>& all) {
  std::string figures = latency_over_time(all);
  for (const Series& s : all) figures += latency_bars(s);
  if (figures.empty()) return {};
  return "<h3>Time</h3>\n<p class=\"note\">Bar and figure: median over the frames in which the module ran; whisker: "
         "95th percentile. Diamond and brackets: the paper's mean on an Intel i7, its detector on an RTX 3060; 17.93 "
         "ms "
         "of its coarse stage hold the optical flow, which has its own bar here. Reading, detection and bundle "
         "adjustment run beside the tracking thread.</p>\n"
         "<div class=\"grid\">\n" +
         figures + "</div>\n";
}

}  // namespace cfp_slam
