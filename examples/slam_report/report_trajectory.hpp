// The report on the camera: figures per variant, trajectories, error over time, frames without a pose.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "html.hpp"
#include "run_record.hpp"
#include "series.hpp"
#include "statistics.hpp"
#include "summary.hpp"
#include "svg.hpp"

namespace cfp_slam {

inline std::string row_of(const Series& series) {
  const RunSummary s = summarize(*series.run);
  const std::size_t tracking = static_cast<std::size_t>(Module::tracking);
  std::string row = "<tr><th scope=\"row\">" + escape(series.name) + "</th>";
  const auto cell = [&row](const std::string& text) { row += "<td>" + text + "</td>"; };
  cell("<b>" + number(s.ate_rmse_m, 4) + "</b>");
  cell(number(s.ate_median_m, 4));
  cell(number(s.ate_max_m, 4));
  cell(number(s.rpe_rmse_m, 4));
  cell(number(s.rpe_rmse_deg, 3));
  cell(s.expected > 0 ? number(s.matched) + " of " + number(s.expected) + " (" + number(coverage_percent(s), 1) + " %)"
                      : "–");
  cell(number(s.lost) + " / " + number(s.skipped) + " / " + number(s.relocalised));
  cell(number(s.largest_gap_s, 2));
  cell(s.expected > 0 ? escape(s.alignment) : "–");
  cell(number(s.median_ms[tracking], 1) + " / " + number(s.p95_ms[tracking], 1));
  cell(number(s.keyframes) + " / " + number(s.map_points));
  return row + "</tr>\n";
}

inline std::string summary_table(const std::vector<Series>& all) {
  std::string out =
      "<div class=\"scroll\"><table><thead><tr><th>variant</th><th>ATE rmse [m]</th><th>median</th><th>max</th><th>RPE "
      "rmse [m/s]</th>"
      "<th>RPE rmse [°/s]</th><th>coverage: matched poses</th><th>lost / skipped / relocalised frames</th><th>largest "
      "gap [s]</th>"
      "<th>alignment</th><th>ms per frame, median / p95</th><th>keyframes / map points</th></tr></thead><tbody>\n";
  for (const Series& s : all) out += row_of(s);
  return out +
         "</tbody></table></div>\n<p class=\"note\">ATE: distance of the matched poses to the truth after the "
         "alignment named. RPE: rmse "
         "over all intervals of one second. A lost frame has no pose and none is invented: read every error beside its "
         "coverage. "
         "ms: the tracking thread, the detector only as far as it was waited for.</p>\n";
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

inline std::string outcome_plot(const std::vector<Series>& all) {
  const double start = start_of(all), end = end_of(all) - start;
  std::vector<std::string> names;
  bool any = false;
  for (const Series& s : all) {
    names.push_back(s.name);
    for (const RunFrame& frame : s.run->frames) any = any || frame.outcome != Outcome::tracked;
  }
  if (!any) return {};
  Range time;
  time.add(0);
  time.add(end);
  const double height = Plot::top + Plot::bottom + 20 * static_cast<double>(all.size());
  Plot plot("Frames without a pose", linear_axis(time, "time [s]"), row_axis(names), 480, height, 110);
  for (std::size_t k = 0; k < all.size(); ++k) {
    const double row = static_cast<double>(k);
    const auto& frames = all[k].run->frames;
    for (std::size_t i = 0; i < frames.size();) {
      std::size_t next = i + 1;
      while (next < frames.size() && frames[next].outcome == frames[i].outcome) ++next;
      const double from = frames[i].time_s - start,
                   to = (next < frames.size() ? frames[next].time_s : frames[next - 1].time_s) - start;
      if (frames[i].outcome != Outcome::tracked && std::isfinite(from) && std::isfinite(to)) {
        // At least 2 units wide: one frame in a thousand must still be seen.
        plot.shape(plot.box(from, row + 0.15, (std::max)(to, from + end / 200), row + 0.85),
                   to_string(frames[i].outcome));
      }
      i = next;
    }
  }
  const std::string key =
      "<div class=\"legend\"><span><svg viewBox=\"0 0 26 10\"><rect class=\"lost\" width=\"26\" "
      "height=\"10\"/></svg>lost</span>"
      "<span><svg viewBox=\"0 0 26 10\"><rect class=\"skipped\" width=\"26\" height=\"10\"/></svg>skipped</span>"
      "<span><svg viewBox=\"0 0 26 10\"><rect class=\"relocalised\" width=\"26\" "
      "height=\"10\"/></svg>relocalised</span></div>";
  return figure("Frames without a pose, and where the map was found again", key + plot.svg());
}

// Why frames were lost or skipped: one line per reason and variant.
inline std::string notes_of(const std::vector<Series>& all) {
  std::string rows;
  for (const Series& s : all) {
    std::vector<const RunFrame*> noted;
    for (const RunFrame& frame : s.run->frames) {
      if (!frame.note.empty()) noted.push_back(&frame);
    }
    constexpr std::size_t shown = 20;
    for (std::size_t i = 0; i < (std::min)(noted.size(), shown); ++i) {
      rows += "<tr><th scope=\"row\">" + escape(s.name) + "</th><td>" + number(noted[i]->time_s, 3) +
              "</td><td class=\"words\">" + to_string(noted[i]->outcome) + ": " + escape(noted[i]->note) +
              "</td></tr>\n";
    }
    if (noted.size() > shown) {
      rows += "<tr><th scope=\"row\">" + escape(s.name) + "</th><td></td><td class=\"words\">and " +
              number(noted.size() - shown) + " more</td></tr>\n";
    }
  }
  if (rows.empty()) return {};
  return "<details><summary>Why frames were skipped or lost</summary><div "
         "class=\"scroll\"><table><thead><tr><th>variant</th><th>time "
         "[s]</th>"
         "<th>reason</th></tr></thead><tbody>\n" +
         rows + "</tbody></table></div></details>\n";
}

inline std::string trajectory_section(const std::vector<Series>& all) {
  std::string views;
  for (const TrajectoryView& view : trajectory_views(all)) {
    views += figure(view.title, view.plot.svg(), view.cut_off ? "Poses far from the truth are cut off." : "");
  }
  return summary_table(all) + "<div class=\"grid\">\n" + views + error_plot(all) + outcome_plot(all) + "</div>\n" +
         notes_of(all);
}

}  // namespace cfp_slam
