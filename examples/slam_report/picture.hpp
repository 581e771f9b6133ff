// One small picture of a comparison, for a README: trajectories and a frame in a single SVG that needs nothing beside
// it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "../slam_runs/run_record.hpp"
#include "../support/write_text.hpp"
#include "html.hpp"
#include "page.hpp"
#include "report_trajectory.hpp"
#include "series.hpp"
#include "style.hpp"
#include "summary.hpp"

namespace cfp_slam {

// The picture with the most boxes, compensated ones counted twice, that fits into a number of base64 characters; of the
// run of the full model when it has any. None: nullptr.
inline const AnnotatedFrame* telling_picture(const std::vector<Series>& all, std::size_t largest) {
  const AnnotatedFrame* best = nullptr;
  std::size_t best_score = 0;
  for (const Series& s : all) {
    for (const AnnotatedFrame& picture : s.run->pictures) {
      if (picture.jpeg.empty() || (picture.jpeg.size() + 2) / 3 * 4 > largest) continue;
      std::size_t score = s.run->variant == "cfp" ? 1001 : 1;
      for (const RunFrame& frame : s.run->frames) {
        if (frame.time_s != picture.time_s) continue;
        for (const BoxRecord& box : frame.boxes) score += box.compensated ? 2 : 1;
      }
      if (score > best_score) {
        best = &picture;
        best_score = score;
      }
    }
  }
  return best;
}

// Runs of one sequence, plain and cfp say: the trajectories at the left, a frame at the right (without one that fits,
// the view from the side), the errors below. At most `largest_bytes` long, unless the curves alone are longer.
inline std::string summary_picture(const std::vector<RunRecord>& runs, std::size_t largest_bytes = 150000) {
  std::vector<const RunRecord*> same;
  for (const RunRecord& run : runs) {
    if (run.sequence == runs.front().sequence) same.push_back(&run);
  }
  const std::vector<Series> all = series_of(same);
  const std::vector<TrajectoryView> views = trajectory_views(all);
  constexpr double margin = 16, column = 480, frame_height = 360, line = 22, right = margin + column + margin,
                   width = right + column + margin;
  const double content = (std::max)(views[0].plot.height(), frame_height);

  std::string words;
  double y = margin + content;
  const auto text = [&](double x, double down, const char* css, const std::string& what) {
    words += "<text class=\"" + std::string(css) + "\" x=\"" + number(x, 0) + "\" y=\"" + number(y + down, 0) + "\">" +
             escape(what) + "</text>\n";
  };
  const auto entry = [&](const std::string& css, const std::string& what) {
    y += line;
    words += "<path class=\"" + css + "\" d=\"M" + number(margin, 0) + ' ' + number(y - 5, 0) + "h26\"/>";
    text(margin + 33, 0, "words", what);
  };
  if (!same.empty()) {
    y += line;
    text(margin, 0, "quiet words", same.front()->sequence);
    if (!same.front()->truth.empty()) entry("truth", "truth");
  }
  for (const Series& s : all) {
    const double ate = summarize(*s.run).ate_rmse_m;
    entry(s.css("curve"), s.name + (std::isfinite(ate) ? ": ATE " + number(ate, 3) + " m" : ""));
  }
  const double height = y + margin;

  const auto placed = [content](const Plot& plot, double left) {
    return "<svg x=\"" + number(left, 0) + "\" y=\"" + number(margin + (content - plot.height()) / 2, 0) +
           "\" width=\"" + number(plot.width(), 0) + "\" height=\"" + number(plot.height(), 0) + "\">" + plot.svg() +
           "</svg>\n";
  };
  const std::string size = "width=\"" + number(width, 0) + "\" height=\"" + number(height, 0) + '"';
  std::string out =
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " + number(width, 0) + ' ' + number(height, 0) + "\" " +
      size +
      " role=\"img\" aria-label=\"Trajectories of the variants and the truth\" font-family=\"system-ui,'Segoe "
      "UI',Roboto,sans-serif\">\n<style>" +
      plot_style() + "text{font-size:12px}.words{font-size:15px;" + in_colour("fill", "ink") + "}.quiet{" +
      in_colour("fill", "soft") + "}</style>\n<rect " + size + " rx=\"8\" style=\"" + in_colour("fill", "card") +
      "\"/>\n" + placed(views[0].plot, margin);
  const std::size_t used = out.size() + words.size() + 1000;
  if (const AnnotatedFrame* picture = telling_picture(all, largest_bytes > used ? largest_bytes - used : 0)) {
    out += "<image x=\"" + number(right, 0) + "\" y=\"" + number(margin + (content - frame_height) / 2, 0) +
           "\" width=\"" + number(column, 0) + "\" height=\"" + number(frame_height, 0) +
           "\" href=\"data:image/jpeg;base64," + base64(picture->jpeg) + "\"/>\n";
    const double below = margin + content + line - y;
    text(right, below, "quiet words", "Boxes (track, O): yellow detected, orange compensated.");
    text(right, below + line, "quiet words", "Keypoints: from red, moving, to green, static; rings: behind.");
  } else {
    out += placed(views[1].plot, right);
  }
  return out + words + "</svg>\n";
}

// Throws when the file cannot be written.
inline void write_summary_picture(const std::filesystem::path& file, const std::vector<RunRecord>& runs,
                                  std::size_t largest_bytes = 150000) {
  cfp_examples::write_text(file, summary_picture(runs, largest_bytes));
}

}  // namespace cfp_slam
