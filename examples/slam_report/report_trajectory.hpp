// The report on the camera: figures per variant, trajectories, error over time, frames without a pose.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "../slam_runs/run_record.hpp"
#include "html.hpp"
#include "series.hpp"
#include "statistics.hpp"
#include "summary.hpp"
#include "svg.hpp"
#include "table.hpp"

namespace cfp_slam {

inline Table summary_table(const std::vector<Series>& all) {
  Table table;
  table.header = {"variant",   "ATE rmse [m]", "median",           "max",
                  "RPE [m/s]", "RPE [°/s]",    "matched poses",    "lost / skipped / relocalised",
                  "gap [s]",   "alignment",    "ms, median / p95", "keyframes / map points"};
  const std::size_t tracking = static_cast<std::size_t>(Module::tracking);
  for (const Series& series : all) {
    const RunSummary s = summarize(*series.run);
    const bool judged = s.expected > 0;
    const std::string matched =
        number(s.matched) + " of " + number(s.expected) + " (" + number(coverage_percent(s), 1) + " %)";
    std::vector<Cell> row;
    for (const std::string& text :
         {series.name, number(s.ate_rmse_m, 4), number(s.ate_median_m, 4), number(s.ate_max_m, 4),
          number(s.rpe_rmse_m, 4), number(s.rpe_rmse_deg, 3), judged ? matched : "–",
          number(s.lost) + " / " + number(s.skipped) + " / " + number(s.relocalised), number(s.largest_gap_s, 2),
          judged ? s.alignment : "–", number(s.median_ms[tracking], 1) + " / " + number(s.p95_ms[tracking], 1),
          number(s.keyframes) + " / " + number(s.map_points)})
      row.push_back(text);
    table.rows.push_back(row);
  }
  table.note =
      "ATE: distance of the matched poses to the truth after the alignment named. RPE: rmse over all intervals of one "
      "second. A lost frame has no pose and none is invented: read every error beside its coverage. ms: the tracking "
      "thread, the detector only as far as it was waited for.";
  return table;
}

// Truth and variants in metres and one scale, the longest direction of the motion to the right: first the view that
// shows most, along the shortest direction, then the one from the side. What is farther from the truth than twice its
// extent (at least 1 m) is cut off: one variant that flew away must not shrink the rest to a dot.
struct TrajectoryView {
  std::string title;
  Plot plot;
  bool cut_off = false;
};
inline std::vector<TrajectoryView> trajectory_views(const std::vector<Series>& all) {
  const double start = start_of(all), end = end_of(all);
  Positions truth;
  std::vector<Positions> estimates;
  for (const Series& s : all) {
    if (truth.coordinate[0].empty()) truth = truth_positions(s.run->truth, start, end);
    estimates.push_back(positions_of(*s.run));
  }
  std::array<Range, 3> range;
  const auto extend = [&range](const Positions& p) {
    for (std::size_t c = 0; c < 3; ++c) {
      for (const double v : p.coordinate[c]) range[c].add(v);
    }
  };
  const bool with_truth = !truth.coordinate[0].empty();
  extend(truth);
  if (!with_truth) std::for_each(estimates.begin(), estimates.end(), extend);
  std::array<std::size_t, 3> axes{0, 1, 2};
  std::stable_sort(axes.begin(), axes.end(),
                   [&](std::size_t a, std::size_t b) { return range[a].size() > range[b].size(); });
  const double reach = (std::max)(2 * range[axes[0]].size(), 1.0);
  const std::array<Range, 3> inner = range;
  bool cut_off = false;
  for (Positions& p : estimates) {
    for (std::size_t c = 0; c < 3; ++c) {
      for (double& v : p.coordinate[c]) {
        if (!with_truth || !(v < inner[c].low - reach || v > inner[c].high + reach)) continue;
        v = not_known;
        cut_off = true;
      }
    }
    extend(p);
  }

  constexpr std::array<const char*, 3> names{"x [m]", "y [m]", "z [m]"};
  std::vector<TrajectoryView> views;
  for (const std::size_t up : {axes[1], axes[2]}) {
    const std::size_t right = axes[0];
    const std::string title = std::string("Trajectory, ") + names[right][0] + " and " + names[up][0];
    Plot plot = Plot::equal_scale(title, range[right], range[up], names[right], names[up]);
    plot.curve(truth.coordinate[right], truth.coordinate[up], "truth");
    for (const std::size_t k : drawing_order(all)) {
      plot.curve(estimates[k].coordinate[right], estimates[k].coordinate[up], all[k].css("curve"));
    }
    views.push_back({title, plot, cut_off});
  }
  return views;
}

inline std::string error_plot(const std::vector<Series>& all) {
  const double start = start_of(all);
  Range time, error;
  time.add(0);
  time.add(end_of(all) - start);
  std::vector<TimeSeries> curves;
  for (const Series& s : all) {
    curves.push_back(error_over_time(*s.run, start));
    // The smallest errors are luck: the axis may cut them.
    for (const double share : {0.03, 1.0}) {
      const double e = quantile(curves.back().value, share);
      if (e > 0) error.add(e);
    }
  }
  if (error.empty) return {};
  Plot plot("Translation error over time", linear_axis(time, "time [s]"), log_axis(error, "error [m], logarithmic"));
  for (const std::size_t k : drawing_order(all)) plot.curve(curves[k].time_s, curves[k].value, all[k].css("curve"));
  return figure("Translation error over time", plot.svg(), "A curve is interrupted where frames have no pose.");
}

// Which frames have no pose or are the first again, and why.
inline std::string notes_of(const std::vector<Series>& all) {
  Table table;
  table.header = {"variant", "time [s]", "frame"};
  table.words = true;
  for (const Series& s : all) {
    constexpr std::size_t shown = 20;
    std::size_t noted = 0;
    for (const RunFrame& frame : s.run->frames) {
      if (frame.outcome == Outcome::tracked || ++noted > shown) continue;
      table.rows.push_back({s.name, number(frame.time_s, 3),
                            std::string(to_string(frame.outcome)) + (frame.note.empty() ? "" : ": " + frame.note)});
    }
    if (noted > shown) table.rows.push_back({s.name, {}, "and " + number(noted - shown) + " more"});
  }
  return table.rows.empty() ? ""
                            : "<details><summary>Frames that were skipped, lost or found again</summary>" +
                                  to_html(table) + "</details>\n";
}

inline std::string trajectory_section(const std::vector<Series>& all) {
  std::string views;
  for (const TrajectoryView& view : trajectory_views(all)) {
    views += figure(view.title, view.plot.svg(), view.cut_off ? "Poses far from the truth are cut off." : "");
  }
  return to_html(summary_table(all)) + "<div class=\"grid\">\n" + views + error_plot(all) + "</div>\n" + notes_of(all);
}

}  // namespace cfp_slam
