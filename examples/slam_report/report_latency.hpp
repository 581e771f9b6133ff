// The report on time: per module beside the paper's figures, and per frame.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "html.hpp"
#include "latency_table.hpp"
#include "series.hpp"
#include "summary.hpp"
#include "svg.hpp"

namespace cfp_slam {

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
  const std::string over_time = latency_over_time(all);
  if (over_time.empty()) return {};
  std::vector<RunSummary> runs;
  std::vector<std::string> variants;
  for (const Series& s : all) {
    runs.push_back(summarize(*s.run));
    if (std::find(variants.begin(), variants.end(), s.run->variant) == variants.end())
      variants.push_back(s.run->variant);
  }
  return "<h3>Time</h3>\n<div class=\"grid\">\n" + over_time + "</div>\n" +
         to_html(latency_table(runs, variants, "Time per module, ms", ""));
}

}  // namespace cfp_slam
