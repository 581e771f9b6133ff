// Options of a run in a text file: a line `name value` for each that is not to have its default, `#` starts a comment.
// The names are those of cfp_slam::Options, dotted.
#pragma once

#include <filesystem>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "../slam/loop/options.hpp"
#include "../support/tum.hpp"

namespace cfp_slam {

using OptionValues = std::map<std::string, double>;

// visit(name, value) for every option that a file can set: numbers, and what is 0 or 1.
template <typename Visit>
void for_each_option(Options& o, const Visit& visit) {
  cfp::FrameOptions& p = o.probability;
  visit("keypoint_sigma_px", o.keypoint_sigma_px);
  visit("baseline_fx", o.baseline_fx);
  visit("flow_edge_px", o.flow_edge_px);
  visit("give_depths", o.give_depths);
  visit("unproven_share", o.unproven_share);
  visit("min_known_share", o.min_known_share);
  visit("features.room_share", o.features.room_share);
  visit("probability.object_threshold", p.object_threshold);
  visit("probability.min_creation_probability", p.min_creation_probability);
  visit("probability.health.min_inlier_weight", p.health.min_inlier_weight);
  visit("probability.tracker.min_score", p.tracker.min_score);
  visit("probability.tracker.birth_threshold", p.tracker.birth_threshold);
  visit("probability.coarse.flow_radius_px", p.coarse.flow_radius_px);
  visit("probability.coarse.flow_depth_radius_px", p.coarse.flow_depth_radius_px);
  visit("probability.coarse.unreported.radius_px", p.coarse.unreported.radius_px);
  visit("probability.coarse.unreported.max_parallax", p.coarse.unreported.max_parallax);
  visit("probability.coarse.flow.camera_acceleration_m_s2", p.coarse.flow.camera_acceleration_m_s2);
  visit("probability.coarse.flow.motion.min_sigma_px", p.coarse.flow.motion.min_sigma_px);
  visit("probability.coarse.flow.motion.max_sigma_px", p.coarse.flow.motion.max_sigma_px);
  visit("probability.coarse.object.noise_factor", p.coarse.object.noise_factor);
  visit("probability.coarse.object.max_stray_share", p.coarse.object.max_stray_share);
  visit("probability.coarse.object.shared_error_px", p.coarse.object.shared_error_px);
  visit("probability.fine.min_translation_m", p.fine.min_translation_m);
  visit("probability.fine.least_speed_m_s", p.fine.least_speed_m_s);
  visit("probability.fine.constraint.quantile", p.fine.constraint.quantile);
  visit("probability.fine.constraint.steepness", p.fine.constraint.steepness);
  visit("probability.map_point.rate", p.map_point.rate);
  visit("probability.map_point.deletion_threshold", p.map_point.deletion_threshold);
  visit("probability.map_point.constraint_power", p.map_point.constraint_power);
  visit("probability.map_point.foreground_prior", p.map_point.foreground_prior);
  visit("probability.map_point.background_prior", p.map_point.background_prior);
}

// False: no option has this name, or it has no such value.
inline bool set_option(Options& options, const std::string& name, double value) {
  bool set = false;
  for_each_option(options, [&](const char* option, auto& field) {
    using Field = std::decay_t<decltype(field)>;
    if (name != option || !cfp::is_finite(value) || (std::is_same_v<Field, bool> && value != 0 && value != 1)) return;
    field = static_cast<Field>(value);
    set = true;
  });
  return set;
}

// The first option outside its range, as a file names it; empty: none.
inline std::string invalid_option(const Options& o) {
  const auto is_share = [](double x) { return x >= 0 && x <= 1; };
  if (!(o.keypoint_sigma_px > 0)) return "keypoint_sigma_px";
  if (!(o.baseline_fx > 0)) return "baseline_fx";
  if (!(o.flow_edge_px >= 0)) return "flow_edge_px";
  if (!(o.unproven_share >= 0)) return "unproven_share";
  if (!is_share(o.min_known_share)) return "min_known_share";
  if (!is_share(o.features.room_share)) return "features.room_share";
  const cfp::OptionPath field = cfp::invalid_field(o.probability);
  return field ? "probability." + field.string() : std::string();
}

// Throws std::runtime_error that says file and line where a name is none, or comes twice, or a value is no number or
// outside the option's range.
inline OptionValues read_options(const std::filesystem::path& file) {
  OptionValues values;
  std::map<std::string, int> lines;
  Options options;
  cfp_examples::for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    if (words.size() != 2) cfp_examples::bad_line(file, line, "expected 'name value'");
    const double value = cfp_examples::parse_number(file, line, words[1], words[0].c_str());
    if (!set_option(options, words[0], value))
      cfp_examples::bad_line(file, line, "no option '" + words[0] + "', or not of this value");
    if (!values.emplace(words[0], value).second) cfp_examples::bad_line(file, line, words[0] + " comes twice");
    lines[words[0]] = line;
  });
  const std::string invalid = invalid_option(options);  // a range may depend on another option
  if (!invalid.empty()) cfp_examples::bad_line(file, lines[invalid], invalid + " is out of range");
  return values;
}

// On one line, `name=value` with blanks between; "none" without any.
inline std::string options_text(const OptionValues& values) {
  std::string text;
  for (const auto& [name, value] : values)
    text += (text.empty() ? "" : " ") + name + "=" + cfp_examples::general(value, 17);
  return text.empty() ? "none" : text;
}

// The defaults with what that line says.
inline Options options_from_text(const std::string& text) {
  Options options;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    const std::size_t sign = word.find('=');
    const auto value = cfp_examples::read_number(sign < word.size() ? word.substr(sign + 1) : "");
    if (word == "none") continue;
    if (!value || !set_option(options, word.substr(0, sign), *value))
      throw std::runtime_error("'" + word + "' is no option");
  }
  return options;
}

}  // namespace cfp_slam
