// The report of one or more runs as one HTML file, which needs nothing beside it: plots are inline SVG, pictures data
// URIs.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "../slam_runs/run_record.hpp"
#include "../support/write_text.hpp"
#include "explained.hpp"
#include "html.hpp"
#include "page.hpp"
#include "report_latency.hpp"
#include "report_probability.hpp"
#include "report_trajectory.hpp"
#include "series.hpp"

namespace cfp_slam {

// Pictures of one moment in one row, whatever the variants.
inline std::string gallery(const std::vector<Series>& all) {
  struct Entry {
    double time_s;
    std::size_t series;
    const AnnotatedFrame* picture;
  };
  std::vector<Entry> entries;
  std::size_t with_pictures = 0;
  for (std::size_t k = 0; k < all.size(); ++k) {
    with_pictures += all[k].run->pictures.empty() ? 0 : 1;
    for (const AnnotatedFrame& picture : all[k].run->pictures) {
      if (!picture.jpeg.empty()) entries.push_back({std::isfinite(picture.time_s) ? picture.time_s : 0, k, &picture});
    }
  }
  if (entries.empty()) return {};
  std::stable_sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) { return a.time_s < b.time_s; });
  const double start = start_of(all);
  // The colours of annotate.hpp.
  std::string out =
      "<h3>Frames</h3>\n<div class=\"legend\"><span><i class=\"swatch\" style=\"border:2px solid "
      "#e6c700\"></i>detected box</span>"
      "<span><i class=\"swatch\" style=\"border:2px solid #ff8c00\"></i>compensated box</span>"
      "<span>keypoints inside boxes: K = 0 <i class=\"ramp\"></i> K = 1, filled on the foreground, rings on the "
      "background</span>"
      "<span><i class=\"swatch\" style=\"background:#aaa;border-radius:50%;width:.5em;height:.5em\"></i>keypoints "
      "outside</span></div>\n"
      "<div class=\"pictures" +
      std::string(with_pictures == 2 ? " pairs" : "") + "\">\n";
  for (const Entry& entry : entries) {
    const Series& s = all[entry.series];
    const std::string caption = s.name + ", " + number(entry.time_s - start, 2) + " s" +
                                (entry.picture->caption.empty() ? "" : ": ") + entry.picture->caption;
    out += "<figure class=\"s" + number(s.style) + "\"><img loading=\"lazy\" alt=\"" +
           escape("Annotated frame of " + caption) + "\" src=\"data:image/jpeg;base64," + base64(entry.picture->jpeg) +
           "\"><figcaption>" + escape(caption) + "</figcaption></figure>\n";
  }
  return out + "</div>\n";
}

inline std::string sequence_section(const std::vector<const RunRecord*>& runs) {
  const std::vector<Series> all = series_of(runs);
  std::size_t frames = 0;
  bool with_truth = false;
  std::set<std::string> detectors;
  for (const RunRecord* run : runs) {
    frames = (std::max)(frames, run->frames.size());
    with_truth = with_truth || !run->truth.empty();
    if (!run->detector.empty()) detectors.insert(shown_detector(run->detector));
  }
  std::string about = number(frames) + " frames, " + number(end_of(all) - start_of(all), 1) + " s";
  for (const std::string& detector : detectors) about += ", detector: " + detector;
  if (!with_truth) about += ", no true trajectory known: no errors";
  return "<section>\n<h2>" + escape(runs.front()->sequence.empty() ? "Sequence" : runs.front()->sequence) +
         "</h2>\n<p>" + escape(about) + "</p>\n" + legend_of(all, with_truth) + trajectory_section(all) +
         probability_section(all) + gallery(all) + explained_section(all) + latency_section(all) + "</section>\n";
}

// The page; runs of one sequence stand side by side, sequences in the order in which they come first.
inline std::string report_page(const std::vector<RunRecord>& runs) {
  std::vector<std::vector<const RunRecord*>> sequences;
  for (const RunRecord& run : runs) {
    const auto same = std::find_if(sequences.begin(), sequences.end(),
                                   [&](const auto& group) { return group.front()->sequence == run.sequence; });
    if (same == sequences.end()) {
      sequences.push_back({&run});
    } else {
      same->push_back(&run);
    }
  }
  std::string body =
      "<h1>RGB-D SLAM with static probabilities</h1>\n<p class=\"note\">Made by the SLAM example of cfp. Tick or "
      "untick a variant in the "
      "legend to show or hide it.</p>\n";
  for (const auto& group : sequences) body += sequence_section(group);
  if (std::any_of(runs.begin(), runs.end(), [](const RunRecord& run) { return !run.explained.empty(); }))
    body += explained_script();
  if (runs.empty()) body += "<p>No runs.</p>\n";
  return page(runs.empty() ? "SLAM report" : "SLAM report: " + runs.front().sequence, body);
}

// Throws when the file cannot be written.
inline void write_report(const std::filesystem::path& file, const std::vector<RunRecord>& runs) {
  cfp_examples::write_text(file, report_page(runs));
}

}  // namespace cfp_slam
