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
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "cfp/detection/box_tracker_types.hpp"
#include "numbers.hpp"

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
    if (++number == 1) drop_byte_order_mark(line);
    line.resize(std::min(line.size(), line.find('#')));
    std::istringstream split(line);
    std::vector<std::string> words;
    for (std::string word; split >> word;) words.push_back(word);
    if (words.empty()) continue;  // nothing but blanks or a comment
    const auto value = [&](std::size_t i) { return i < words.size() ? read_number(words[i]) : std::nullopt; };
    if (!value(0) || !std::isfinite(*value(0))) return fail(number, "no timestamp: '" + words[0] + "'");
    if (words.size() < 2) return fail(number, "no class after the timestamp");
    if (!value(2) || std::isnan(*value(2))) return fail(number, "no score after class '" + words[1] + "'");
    if (!value(3) || !value(4) || !value(5) || !value(6))
      return fail(number, "four numbers x1 y1 x2 y2 must follow the score");
    if (words.size() > 7) return fail(number, "surplus '" + words[7] + "' after the box");
    const double timestamp = *value(0);
    const std::string& label = words[1];
    cfp::Detection<double> d;
    d.score = *value(2);
    d.box = {*value(3), *value(4), *value(5), *value(6)};
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
  if (input.bad()) return fail(number, "cannot be read");
  return file;
}

}  // namespace cfp_examples
