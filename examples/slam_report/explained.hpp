// Frames with every keypoint, each of which tells why it has its weight: hovered, clicked, or without a script as the
// tooltip of its circle.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include <opencv2/imgcodecs.hpp>

#include "../slam_runs/run_record.hpp"
#include "html.hpp"
#include "series.hpp"

namespace cfp_slam {

// Reads the decisions about the given frames of a run, of the one with most keypoints in boxes where none is given. A
// run that wrote none has none.
inline void add_explained(RunRecord& run, const std::filesystem::path& folder, std::vector<std::size_t> frames) {
  if (!std::filesystem::exists(folder / "decisions.txt") || run.frames.empty()) return;
  if (frames.empty()) {
    const auto most = std::max_element(run.frames.begin(), run.frames.end(), [](const RunFrame& a, const RunFrame& b) {
      return a.box_keypoints.size() < b.box_keypoints.size();
    });
    frames = {static_cast<std::size_t>(most - run.frames.begin())};
  }
  for (const std::size_t frame : frames) {
    if (frame >= run.frames.size()) continue;
    const cv::Mat image = cv::imread((std::filesystem::path(run.recording) / run.frames[frame].image).string());
    if (image.empty()) continue;
    ExplainedFrame explained;
    explained.frame = frame;
    explained.width = image.cols;
    explained.height = image.rows;
    cv::imencode(".jpg", image, explained.jpeg, {cv::IMWRITE_JPEG_QUALITY, 80});
    run.explained.push_back(std::move(explained));
  }
  for_each_decision(folder / "decisions.txt", [&](const Decision& d) {
    for (ExplainedFrame& explained : run.explained) {
      if (explained.frame == d.frame) explained.decisions.push_back(d);
    }
  });
}

// What cfp::explain says, and where the keypoint is.
inline std::string said_of(const Decision& d) {
  std::string text = cfp::to_text(d.why) + "  pixel   " + number(double(d.x), 1) + ", " + number(double(d.y), 1);
  if (d.map_point >= 0)
    text += "; map point " + std::to_string(d.map_point) + ", " + number(double(d.residual_px), 2) + " px from it";
  return text + "\n";
}

// A keypoint worth a look, and why.
struct Interesting {
  std::string what;
  std::size_t index = 0;  // of ExplainedFrame::decisions
};

// The one on an object that both constraints agree to move, the one behind an object that is trusted most, and the one
// whose weight is farthest from what the first stage said of it.
inline std::vector<Interesting> interesting(const std::vector<Decision>& decisions) {
  std::vector<Interesting> found;
  const auto add = [&](const char* what, const auto& score) {
    std::size_t best = decisions.size();
    for (std::size_t i = 0; i < decisions.size(); ++i) {
      const auto& e = decisions[i].why;
      if (e.box == cfp::no_box || e.stage != cfp::Stage::fine || !e.projection.available) continue;
      if (score(e) > (best < decisions.size() ? score(decisions[best].why) : 0)) best = i;
    }
    if (best < decisions.size()) found.push_back({what, best});
  };
  using cfp::KeypointExplanation;
  using cfp::KeypointLabel;
  add("moves", [](const KeypointExplanation& e) {
    const bool asked = e.label == KeypointLabel::foreground && e.epipolar.available;
    return asked ? 1 - e.weight + (1 - e.projection.static_probability) + (1 - e.epipolar.static_probability) : -1;
  });
  add("behind the object", [](const KeypointExplanation& e) {
    return e.label == KeypointLabel::background && e.high_dynamic ? e.weight + e.static_probability : -1;
  });
  add("changed most",
      [](const KeypointExplanation& e) { return e.associated ? std::abs(e.weight - e.coarse_probability) : -1; });
  return found;
}

inline std::string explained_figure(const Series& series, const ExplainedFrame& frame, double start_s) {
  const std::string caption = series.name + ", frame " + number(frame.frame) + ", " +
                              number(series.run->frames[frame.frame].time_s - start_s, 2) +
                              " s: " + number(frame.decisions.size()) + " keypoints";
  std::string out = "<figure class=\"explained s" + number(series.style) + "\"><div><svg viewBox=\"0 0 " +
                    std::to_string(frame.width) + ' ' + std::to_string(frame.height) +
                    "\" role=\"img\" tabindex=\"0\" aria-label=\"" + escape(caption) + "\"><image width=\"" +
                    std::to_string(frame.width) + "\" height=\"" + std::to_string(frame.height) +
                    "\" href=\"data:image/jpeg;base64," + base64(frame.jpeg) + "\"/>\n";
  for (const Decision& d : frame.decisions) {
    const char* css = d.why.label == cfp::KeypointLabel::foreground   ? "on"
                      : d.why.label == cfp::KeypointLabel::background ? "behind"
                                                                      : "outside";
    out += std::string("<circle class=\"") + css + "\" style=\"--w:" + number(d.why.weight, 2) + "\" cx=\"" +
           number(double(d.x), 1) + "\" cy=\"" + number(double(d.y), 1) + "\" r=\"3.5\"><title>" + escape(said_of(d)) +
           "</title></circle>\n";
  }
  out += "<circle class=\"ring\" r=\"9\" cx=\"-99\" cy=\"-99\"/></svg><figcaption>" + escape(caption) +
         "</figcaption></div><div><pre aria-live=\"polite\">Hover a keypoint, or click it to hold it.</pre><p>";
  for (const Interesting& keypoint : interesting(frame.decisions))
    out += "<button type=\"button\" data-keypoint=\"" + number(keypoint.index) + "\">" + escape(keypoint.what) +
           "</button> ";
  return out + "</p></div></figure>\n";
}

// All explained frames of a sequence, in the order of the runs.
inline std::string explained_section(const std::vector<Series>& all) {
  std::string figures;
  for (const Series& s : all) {
    for (const ExplainedFrame& frame : s.run->explained) figures += explained_figure(s, frame, start_of(all));
  }
  if (figures.empty()) return {};
  return "<h3>Why each keypoint has its weight</h3>\n<div class=\"legend\"><span>weight 0 <i class=\"ramp\"></i> "
         "weight "
         "1</span><span>discs: on the object, rings: behind it, dots: outside all boxes</span><span>hover or click a "
         "keypoint, or go through them with the arrow keys</span></div>\n" +
         figures;
}

// For the end of a page that has such a section. Each circle gives its words to the script, which shows those of the
// nearest one, so that no one has to aim.
inline std::string explained_script() {
  return R"script(<script>
for (const figure of document.querySelectorAll("figure.explained")) {
  const svg = figure.querySelector("svg"), said = figure.querySelector("pre"), ring = svg.querySelector(".ring");
  const points = [...svg.querySelectorAll("circle:not(.ring)")].map(circle => {
    const title = circle.firstChild, words = title.textContent;
    title.remove();
    return {x: +circle.getAttribute("cx"), y: +circle.getAttribute("cy"), words};
  });
  let shown = -1, held = false;
  const show = i => {
    shown = i;
    said.textContent = points[i].words;
    ring.setAttribute("cx", points[i].x);
    ring.setAttribute("cy", points[i].y);
  };
  const near = event => {
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    let best = -1, least = 18;
    points.forEach((p, i) => {
      const distance = Math.hypot(p.x - at.x, p.y - at.y);
      if (distance < least) [best, least] = [i, distance];
    });
    return best;
  };
  svg.addEventListener("pointermove", event => {
    const i = near(event);
    if (!held && i >= 0) show(i);
  });
  svg.addEventListener("click", event => {
    const i = near(event);
    held = i >= 0 && !(held && i === shown);
    if (i >= 0) show(i);
  });
  svg.addEventListener("keydown", event => {
    const step = {ArrowRight: 1, ArrowLeft: -1}[event.key];
    if (!step || points.length === 0) return;
    event.preventDefault();
    held = true;
    show((shown + step + points.length) % points.length);
  });
  for (const button of figure.querySelectorAll("button"))
    button.addEventListener("click", () => { held = true; show(+button.dataset.keypoint); });
  const first = figure.querySelector("button");
  if (first) show(+first.dataset.keypoint);
}
</script>
)script";
}

}  // namespace cfp_slam
