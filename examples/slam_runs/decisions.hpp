// What was decided about every keypoint of a run, as a text file that anyone can judge: decisions.txt. One line per
// keypoint, one column per number that cfp::explain knows; the first line names them, README.md of ../slam says what
// they mean.
#pragma once

#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <system_error>
#include <type_traits>
#include <vector>

#include "../support/tum.hpp"
#include "cfp/frame/explain.hpp"

namespace cfp_slam {

struct Decision {
  std::size_t frame = 0;         // counts the lines of frames.txt from 0
  float x = 0, y = 0, size = 0;  // pixel in the image, diameter of the patch: 31 at level 0 of the pyramid
  int map_point = -1;            // what the frame's last pose took it for; -1: nothing
  float residual_px = -1;        // of that point under that pose, without distortion; -1: nothing
  cfp::KeypointExplanation why;
};

namespace detail {

// visit(name, number) for every column in order; number is a member of d, or of what d consists of.
template <typename D, typename Visit>
void for_each_column(D& d, const Visit& visit) {
  auto& e = d.why;
  visit("frame", d.frame);
  visit("keypoint", e.keypoint);
  visit("x", d.x);
  visit("y", d.y);
  visit("size", d.size);
  visit("map_point", d.map_point);
  visit("residual_px", d.residual_px);
  visit("stage", e.stage);
  visit("label", e.label);
  visit("weight", e.weight);
  visit("reason", e.reason);
  visit("K", e.static_probability);
  visit("M", e.map_point_probability);
  visit("box", e.box);
  visit("track", e.track);
  visit("compensated", e.compensated);
  visit("associated", e.associated);
  visit("O", e.object.static_probability);
  visit("O_status", e.object.status);
  visit("O_pairs", e.object.pairs);
  visit("high_dynamic", e.high_dynamic);
  visit("flow_model", e.flow_model);
  visit("flow_sigma_px", e.flow_sigma_px);
  visit("flow_probability", e.flow_probability);
  visit("placed", e.placed);
  visit("K_coarse", e.coarse_probability);
  visit("match", e.match);
  visit("rule", e.rule);
  const auto constraint = [&](const char* available, const char* distance, const char* threshold, const char* k,
                              const char* confidence, auto& c) {
    visit(available, c.available);
    visit(distance, c.distance_px);
    visit(threshold, c.threshold_px);
    visit(k, c.static_probability);
    visit(confidence, c.confidence);
  };
  constraint("T", "T_distance_px", "T_threshold_px", "K_T", "T_confidence", e.projection);
  constraint("F", "F_distance_px", "F_threshold_px", "K_F", "F_confidence", e.epipolar);
  visit("visibility", e.visibility);
}

// The last enumerator of what a column may hold.
constexpr double last_of(cfp::Stage) { return static_cast<double>(cfp::Stage::fine); }
constexpr double last_of(cfp::KeypointLabel) { return static_cast<double>(cfp::KeypointLabel::invalid); }
constexpr double last_of(cfp::WeightReason) { return static_cast<double>(cfp::WeightReason::fallback); }
constexpr double last_of(cfp::Status) { return static_cast<double>(cfp::Status::invalid_input); }
constexpr double last_of(cfp::FlowModelKind) { return static_cast<double>(cfp::FlowModelKind::motion_up_to_scale); }
constexpr double last_of(cfp::SecondStageRule) { return static_cast<double>(cfp::SecondStageRule::low_dynamic); }

// Whether the column's type has this number, and if so, sets it.
template <typename T>
bool set_column(double value, T& column) {
  double lowest = 0, highest = 1;
  if constexpr (std::is_floating_point_v<T>) {
    highest = static_cast<double>((std::numeric_limits<float>::max)());
    lowest = -highest;
  } else if constexpr (std::is_enum_v<T>) {
    highest = last_of(T());
  } else if constexpr (!std::is_same_v<T, bool>) {
    highest = sizeof(T) > 4 ? 0x1p53 : static_cast<double>((std::numeric_limits<T>::max)());
    lowest = std::is_signed_v<T> ? -highest : 0;
  }
  if (!(value >= lowest && value <= highest)) return false;
  if (!std::is_floating_point_v<T> && value != std::floor(value)) return false;
  if constexpr (std::is_same_v<T, bool>) {
    column = value != 0;
  } else if constexpr (std::is_enum_v<T>) {
    column = static_cast<T>(static_cast<int>(value));
  } else if constexpr (std::is_floating_point_v<T>) {
    column = static_cast<T>(static_cast<float>(value));  // what was written
  } else {
    column = static_cast<T>(value);
  }
  return true;
}

}  // namespace detail

// The names of the columns, blank-separated.
inline std::string decision_columns() {
  std::string text;
  Decision any;
  detail::for_each_column(any, [&](const char* name, auto&) { text += (text.empty() ? "" : " ") + std::string(name); });
  return text;
}

// A line: numbers with as many digits as a float needs to be read back to the last bit; -1 for what is not finite.
inline std::string decision_line(const Decision& decision) {
  std::string text;
  detail::for_each_column(decision, [&](const char*, const auto& number) {
    using T = std::decay_t<decltype(number)>;
    char digits[32];
    std::to_chars_result end{};
    if constexpr (std::is_floating_point_v<T>) {
      const float value = static_cast<float>(number);
      end = std::to_chars(digits, digits + sizeof digits, std::isfinite(value) ? value : -1.0F);
    } else {
      end = std::to_chars(digits, digits + sizeof digits, static_cast<std::int64_t>(number));
    }
    text.append(text.empty() ? "" : " ").append(digits, end.ptr);
  });
  return text;
}

// visit(decision) for every line, in the order of the file, which holds a frame's keypoints one after the other. A line
// with other columns or impossible numbers is thrown as std::runtime_error that says file and line.
template <typename Visit>
void for_each_decision(const std::filesystem::path& file, const Visit& visit) {
  cfp_examples::for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    Decision decision;
    std::size_t column = 0;
    detail::for_each_column(decision, [&](const char* name, auto& number) {
      if (column >= words.size()) cfp_examples::bad_line(file, line, std::string("ends before column ") + name);
      const std::string& word = words[column++];
      if (!detail::set_column(cfp_examples::parse_number(file, line, word, name), number))
        cfp_examples::bad_line(file, line, "'" + word + "' cannot be a " + name);
    });
    if (column != words.size()) cfp_examples::bad_line(file, line, "surplus '" + words[column] + "'");
    visit(decision);
  });
}

}  // namespace cfp_slam
