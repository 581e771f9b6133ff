// The report on the static probabilities: what they were, and where labels tell the truth, whether they were right.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "../slam_runs/run_record.hpp"
#include "cfp/core/span.hpp"
#include "cfp/evaluation/calibration.hpp"
#include "html.hpp"
#include "series.hpp"
#include "summary.hpp"
#include "svg.hpp"
#include "table.hpp"

namespace cfp_slam {

inline constexpr std::size_t histogram_bins = 10;
using Histogram = std::array<double, histogram_bins>;

// K of the keypoints inside boxes, ten bins over [0, 1].
inline void add_to(Histogram& histogram, const RunFrame& frame) {
  for (const BoxKeypoint& keypoint : frame.box_keypoints) {
    const double bin = static_cast<double>(keypoint.static_probability()) * histogram_bins;
    if (bin >= 0) ++histogram[std::min(static_cast<std::size_t>(bin), histogram_bins - 1)];
  }
}

// Share of the in-box keypoints per tenth of K, all variants in one plot.
inline std::string histogram_plot(const std::vector<Series>& all) {
  Range share{0};
  std::vector<Histogram> shares;
  for (const Series& s : all) {
    Histogram h{};
    for (const RunFrame& frame : s.run->frames) add_to(h, frame);
    double total = 0;
    for (const double n : h) total += n;
    for (double& n : h) {
      n = total > 0 ? n / total : not_known;
      share.add(n);
    }
    shares.push_back(h);
  }
  if (!(share.high > 0)) return {};
  Range unit{0, 1};
  share.add(share.high * 1.05);
  Plot plot("K of the keypoints inside boxes", linear_axis(unit, "K, 1 = static"),
            linear_axis(share, "share of the keypoints"));
  for (const std::size_t k : drawing_order(all)) {
    std::vector<double> x, y;
    for (std::size_t b = 0; b < histogram_bins; ++b) {
      for (const std::size_t edge : {b, b + 1}) {
        x.push_back(static_cast<double>(edge) / histogram_bins);
        y.push_back(shares[k][b]);
      }
    }
    plot.curve(x, y, all[k].css("curve"));
  }
  return figure("K of the keypoints inside boxes, whole sequence", plot.svg());
}

inline std::string objects_over_time(const Series& series, double start_s, double end_s) {
  const Range time{0, end_s - start_s}, unit{0, 1};
  Plot plot("O of the boxes over time, " + series.name, linear_axis(time, "time [s]"),
            linear_axis(unit, "O, 1 = static"), 480, 200);
  std::string detected, compensated;
  for (const RunFrame& frame : series.run->frames) {
    for (const BoxRecord& box : frame.boxes) {
      if (!box.object_known || !std::isfinite(frame.time_s) || !std::isfinite(box.object_probability)) continue;
      const std::string point = plot.point(frame.time_s - start_s, box.object_probability);
      (box.compensated ? compensated : detected) += point + (box.compensated ? "m-3-3l6 6m0-6l-6 6" : "h0");
    }
  }
  if (detected.empty() && compensated.empty()) return {};
  plot.shape(detected, series.css("dots"));
  plot.shape(compensated, series.css("crosses"));
  return figure("O of the boxes over time: " + series.name, plot.svg(), {}, "s" + number(series.style));
}

// Reliability: a number that means what it says lies on the diagonal.
inline std::string reliability_plot(const Series& series) {
  Range unit{0, 1};
  Plot plot("Reliability, " + series.name, linear_axis(unit, "static probability"),
            linear_axis(unit, "share that is static"), 480, 380);
  plot.curve({0, 1}, {0, 1}, "guide");
  Table table;
  table.header = {"", "AUC", "Brier", "ECE", "static", "samples"};
  std::string key;
  const auto samples = labelled(*series.run);
  constexpr std::array<std::size_t, 5> styles{3, 1, 2, 5, 4};
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const CalibrationSummary c = summarize(*samples[k]);
    if (c.samples == 0) continue;
    const auto result = cfp::evaluate_calibration(samples[k]->probability, samples[k]->is_static);
    const std::string colour = "c" + number(styles[k]);
    std::vector<double> x, y;
    for (const cfp::ReliabilityBin& bin : result.table) {
      if (bin.count == 0) continue;
      x.push_back(bin.mean_probability);
      y.push_back(bin.static_fraction);
    }
    plot.curve(x, y, "curve " + colour);
    for (const cfp::ReliabilityBin& bin : result.table) {
      if (bin.count == 0) continue;
      const double share = static_cast<double>(bin.count) / static_cast<double>(result.used);
      plot.dot(bin.mean_probability, bin.static_fraction, 2 + 6 * std::sqrt(share), "dot " + colour,
               std::string(probability_names[k]) + ": " + number(bin.count) + " samples, mean " +
                   number(bin.mean_probability, 3) + ", static " + number(bin.static_fraction, 3));
    }
    key += "<span><svg viewBox=\"0 0 26 10\"><path class=\"curve " + colour + "\" d=\"M1 5H25\"/></svg>" +
           probability_names[k] + "</span>";
    const auto cell = [](const std::string& text) { return Cell{text, "", Rank::none}; };
    table.rows.push_back({cell(probability_names[k]), cell(number(c.auc, 4)), cell(number(c.brier, 4)),
                          cell(number(c.ece, 4)), cell(number(100 * c.static_fraction, 1) + " %"),
                          cell(number(c.samples))});
  }
  if (table.rows.empty()) return {};
  return figure("Reliability: " + series.name, "<div class=\"legend\">" + key + "</div>" + plot.svg() + to_html(table),
                {}, "s" + number(series.style));
}

inline std::string probability_section(const std::vector<Series>& all) {
  const double start = start_of(all), end = end_of(all);
  std::string figures = histogram_plot(all), objects;
  for (const Series& s : all) {
    figures += reliability_plot(s);
    objects += objects_over_time(s, start, end);
  }
  if (figures.empty() && objects.empty())
    return "<h3>Static probability</h3>\n<p class=\"note\">No boxes, so no probabilities.</p>\n";
  return "<h3>Static probability</h3>\n<p class=\"note\">1 = static throughout. K: keypoint, M: map point, O: object; "
         "dots are detected boxes, crosses compensated ones. Reliability: what means what it says lies on the "
         "diagonal; "
         "a dot's area grows with the samples in its tenth. AUC 1, Brier 0, ECE 0 are best.</p>\n<div "
         "class=\"grid\">\n" +
         figures + objects + "</div>\n";
}

}  // namespace cfp_slam
