// Reads the detections text file of the examples. One line per box, blank-separated, `#` starts a comment:
//   timestamp class score x1 y1 x2 y2
// timestamp in seconds (not decreasing; lines of equal timestamps form a frame), class a word, score a number (more is
// surer), and the box in pixels with x1 < x2 and y1 < y2. A frame without any box has no line and is not known to the
// reader.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <istream>
#include <sstream>
#include <string>
#include <vector>

#include "cfp/detection/box_tracker_types.hpp"

namespace cfp_examples {

struct DetectionFrame {
  double timestamp = 0;
  std::vector<cfp::Detection<double>> detections;
};

struct DetectionsFile {
  std::vector<DetectionFrame> frames;
  std::vector<std::string> classes;  // names; Detection::class_id is the index
  std::string error;                 // "file:line: what is wrong"; empty: all lines were good
};

/// Reads all lines, or stops at the first bad one and names it. `name` stands for the file in the message.
inline DetectionsFile read_detections(std::istream& input, const std::string& name) {
  DetectionsFile file;
  const auto fail = [&](std::size_t line, const std::string& what) {
    file.error = name + ":" + std::to_string(line) + ": " + what;
    return file;
  };
  if (!input) return fail(0, "cannot be read");
  std::size_t number = 0;
  for (std::string line; std::getline(input, line);) {
    ++number;
    line.resize(std::min(line.size(), line.find('#')));
    std::istringstream fields(line);
    double timestamp = 0;
    std::string label, rest;
    cfp::Detection<double> d;
    if (!(fields >> rest)) continue;  // nothing but blanks or a comment
    fields = std::istringstream(line);
    if (!(fields >> timestamp) || !std::isfinite(timestamp)) return fail(number, "no timestamp: '" + rest + "'");
    if (!(fields >> label)) return fail(number, "no class after the timestamp");
    if (!(fields >> d.score)) return fail(number, "no score after class '" + label + "'");
    if (!(fields >> d.box.x1 >> d.box.y1 >> d.box.x2 >> d.box.y2))
      return fail(number, "four numbers x1 y1 x2 y2 must follow the score");
    if (fields >> rest) return fail(number, "surplus '" + rest + "' after the box");
    if (!cfp::is_proper(d.box)) return fail(number, "the box needs x1 < x2 and y1 < y2");
    if (!file.frames.empty() && timestamp < file.frames.back().timestamp)
      return fail(number, "the timestamp is before that of the line above");
    std::size_t id = 0;
    while (id < file.classes.size() && file.classes[id] != label) ++id;
    if (id == file.classes.size()) file.classes.push_back(label);
    d.class_id = static_cast<int>(id);
    if (file.frames.empty() || timestamp > file.frames.back().timestamp) file.frames.push_back({timestamp, {}});
    file.frames.back().detections.push_back(d);
  }
  return file;
}

}  // namespace cfp_examples
