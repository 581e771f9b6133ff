// The runs of one sequence as the plots need them: names, colours, aligned positions and errors over time.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <tuple>
#include <vector>

#include "../slam_runs/run_record.hpp"
#include "cfp/core/span.hpp"
#include "cfp/evaluation/trajectory_error.hpp"
#include "html.hpp"
#include "statistics.hpp"
#include "style.hpp"
#include "summary.hpp"

namespace cfp_slam {

inline constexpr std::array<const char*, 8> variant_names{"plain",     "cfp",    "cfp-minus",    "no-mdc",
                                                          "no-dbscan", "no-ksp", "no-posterior", "only-boxes"};

// By sequence, variant and seed.
inline void sort_runs(std::vector<RunRecord>& runs) {
  const auto order = [](const RunRecord& run) {
    const auto known = std::find(variant_names.begin(), variant_names.end(), run.variant) - variant_names.begin();
    return std::make_tuple(run.sequence, known, run.seed);
  };
  std::stable_sort(runs.begin(), runs.end(),
                   [&](const RunRecord& x, const RunRecord& y) { return order(x) < order(y); });
}

struct Series {
  const RunRecord* run = nullptr;
  std::string name;
  std::size_t style = 0;  // into series_styles

  [[nodiscard]] std::string css(const char* what) const {
    return std::string(what) + " c" + number(style) + " s" + number(style);
  }
};

// A known variant has its own colour in every report; others, and further seeds of the same, take the next free one.
inline std::vector<Series> series_of(const std::vector<const RunRecord*>& runs) {
  std::vector<Series> out;
  std::vector<char> used(series_styles.size(), 0);
  for (const RunRecord* run : runs) {
    const auto same = [run](const RunRecord* other) { return other->variant == run->variant; };
    const bool alone = std::count_if(runs.begin(), runs.end(), same) == 1;
    const auto known = std::find(variant_names.begin(), variant_names.end(), run->variant);
    std::size_t style = static_cast<std::size_t>(known - variant_names.begin());
    if (known == variant_names.end() || used[style] != 0) {
      const auto free = std::find(used.rbegin(), used.rend(), 0);
      style = free == used.rend() ? out.size() % used.size() : static_cast<std::size_t>(used.rend() - free) - 1;
    }
    used[style] = 1;
    out.push_back({run, run->variant + (alone ? "" : ", seed " + std::to_string(run->seed)), style});
  }
  return out;
}

// Curves that are drawn later lie above: the full model on top, then plain, then the others.
inline std::vector<std::size_t> drawing_order(const std::vector<Series>& all) {
  std::vector<std::size_t> order(all.size());
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
  const auto depth = [&all](std::size_t k) { return all[k].run->variant == "cfp" ? 0 : all[k].style + 1; };
  std::stable_sort(order.begin(), order.end(), [&depth](std::size_t a, std::size_t b) { return depth(a) > depth(b); });
  return order;
}

inline bool has_pose(const RunFrame& frame) { return frame.outcome <= Outcome::relocalised; }

// Numbers per time; entries that are not finite interrupt the curve.
struct TimeSeries {
  std::vector<double> time_s, value;
};

// Time of the earliest frame: the plots count from there.
inline double start_of(const std::vector<Series>& all) {
  double start = not_known;
  for (const Series& s : all) {
    for (const RunFrame& frame : s.run->frames) {
      if (std::isfinite(frame.time_s) && !(start <= frame.time_s)) start = frame.time_s;
    }
  }
  return std::isfinite(start) ? start : 0;
}

inline double end_of(const std::vector<Series>& all) {
  double end = start_of(all);
  for (const Series& s : all) {
    for (const RunFrame& frame : s.run->frames) {
      if (std::isfinite(frame.time_s)) end = (std::max)(end, frame.time_s);
    }
  }
  return end;
}

// Camera positions in the frame of the truth, three coordinates each; interrupted where frames have no pose.
struct Positions {
  std::array<std::vector<double>, 3> coordinate;
  void add(const cfp::Vector3<double>& p) {
    for (std::size_t c = 0; c < 3; ++c) coordinate[c].push_back(p[static_cast<Eigen::Index>(c)]);
  }
  void interrupt() { add(cfp::Vector3<double>::Constant(not_known)); }
};

inline Positions positions_of(const RunRecord& run) {
  const cfp::Similarity S = has_error(run.absolute) ? run.absolute.S_truth_estimate : cfp::Similarity{};
  Positions out;
  for (const RunFrame& frame : run.frames) {
    if (has_pose(frame)) {
      out.add(S * frame.T_world_cam.translation);
    } else {
      out.interrupt();
    }
  }
  return out;
}

// The truth while the camera recorded: motion capture often runs longer.
inline Positions truth_positions(const std::vector<cfp::StampedPose<double>>& truth, double start_s, double end_s) {
  Positions out;
  for (const std::size_t i : cfp::time_order(truth)) {
    if (truth[i].time_s >= start_s - 0.05 && truth[i].time_s <= end_s + 0.05) out.add(truth[i].T_world_cam.translation);
  }
  return out;
}

// Translation error in metres with the alignment of the run's own result.
inline TimeSeries error_over_time(const RunRecord& run, double start_s) {
  TimeSeries out;
  if (!has_error(run.absolute)) return out;
  std::vector<double> error(run.frames.size(), not_known);  // of its poses
  const cfp::PoseErrors& errors = run.absolute.errors;
  for (std::size_t k = 0; k < errors.pose.size(); ++k) error[errors.pose[k]] = errors.translation_m[k];
  std::size_t pose = 0;
  for (const RunFrame& frame : run.frames) {
    const bool posed = has_pose(frame);
    const double value = posed ? error[pose++] : not_known;
    if (posed && !std::isfinite(value)) continue;  // no truth at that time: not a gap of the run
    out.time_s.push_back(frame.time_s - start_s);
    out.value.push_back(value);
  }
  return out;
}

// The legend; its boxes hide series in all plots of the section, in browsers that know :has().
inline std::string legend_of(const std::vector<Series>& all, bool with_truth) {
  std::string out = "<div class=\"legend\">";
  if (with_truth) out += "<span><svg viewBox=\"0 0 26 10\"><path class=\"truth\" d=\"M1 5H25\"/></svg>truth</span>";
  for (const Series& s : all) {
    const std::string k = number(s.style);
    out += "<label><input type=\"checkbox\" checked class=\"t" + k +
           "\"><svg viewBox=\"0 0 26 10\"><path class=\"curve c" + k + "\" d=\"M1 5H25\"/></svg>" + escape(s.name) +
           "</label>";
  }
  return out + "</div>\n";
}

inline std::string figure(const std::string& title, const std::string& content, const std::string& caption = {},
                          const std::string& css = {}) {
  return "<figure" + (css.empty() ? "" : " class=\"" + css + '"') + "><strong>" + escape(title) + "</strong>" +
         content + (caption.empty() ? "" : "<figcaption>" + escape(caption) + "</figcaption>") + "</figure>\n";
}

}  // namespace cfp_slam
