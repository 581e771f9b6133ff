// Summaries as lines of JSON, appended as runs finish: a long experiment reads the file and does what is missing.
#pragma once

#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "summary.hpp"

namespace cfp_slam {

// visit(name, field) for every field, the one list that writing and reading share.
template <typename Summary, typename Visit>
void for_each_field(Summary& s, Visit&& visit) {
  visit("sequence", s.sequence);
  visit("variant", s.variant);
  visit("detector", s.detector);
  visit("alignment", s.alignment);
  visit("seed", s.seed);
  visit("frames", s.frames);
  visit("tracked", s.tracked);
  visit("relocalised", s.relocalised);
  visit("lost", s.lost);
  visit("skipped", s.skipped);
  visit("fallbacks", s.fallbacks);
  visit("keyframes", s.keyframes);
  visit("map_points", s.map_points);
  visit("ate_rmse_m", s.ate_rmse_m);
  visit("ate_sd_m", s.ate_sd_m);
  visit("ate_mean_m", s.ate_mean_m);
  visit("ate_median_m", s.ate_median_m);
  visit("ate_max_m", s.ate_max_m);
  visit("rpe_rmse_m", s.rpe_rmse_m);
  visit("rpe_sd_m", s.rpe_sd_m);
  visit("rpe_rmse_deg", s.rpe_rmse_deg);
  visit("rpe_sd_deg", s.rpe_sd_deg);
  visit("rpe_delta_s", s.rpe_delta_s);
  visit("matched", s.matched);
  visit("expected", s.expected);
  visit("time_fraction", s.time_fraction);
  visit("largest_gap_s", s.largest_gap_s);
  for (std::size_t m = 0; m < module_count; ++m) {
    std::string name = to_string(static_cast<Module>(m));
    for (char& c : name) c = c == ' ' ? '_' : c;
    visit((name + "_median_ms").c_str(), s.median_ms[m]);
    visit((name + "_p95_ms").c_str(), s.p95_ms[m]);
    visit((name + "_mean_ms").c_str(), s.mean_ms[m]);
  }
  const auto calibration = [&visit](const std::string& name, auto& c) {
    visit((name + "_samples").c_str(), c.samples);
    visit((name + "_static_fraction").c_str(), c.static_fraction);
    visit((name + "_auc").c_str(), c.auc);
    visit((name + "_brier").c_str(), c.brier);
    visit((name + "_ece").c_str(), c.ece);
  };
  calibration("first_stage", s.first_stage);
  calibration("second_stage", s.second_stage);
  calibration("map_point", s.map_point);
  calibration("object", s.object);
}

namespace detail {

inline std::string json_value(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      out += {'\\', c};
    } else if (static_cast<unsigned char>(c) < 0x20) {
      char code[8];
      std::snprintf(code, sizeof code, "\\u%04x", static_cast<unsigned>(c));
      out += code;
    } else {
      out += c;
    }
  }
  return out + '"';
}
inline std::string json_value(std::uint64_t value) { return std::to_string(value); }
inline std::string json_value(double value) {
  if (!std::isfinite(value)) return "null";
  char text[40];
  std::snprintf(text, sizeof text, "%.17g", value);
  return text;
}

// One flat object of strings, numbers and null, as to_json_line writes it; any other JSON is refused. Values keep their
// text, strings without quotes.
struct JsonField {
  std::string text;
  bool quoted = false;
};
inline std::optional<std::map<std::string, JsonField>> flat_object(std::string_view line) {
  std::map<std::string, JsonField> out;
  std::size_t at = 0;
  const auto peek = [&] {
    while (at < line.size() && std::isspace(static_cast<unsigned char>(line[at])) != 0) ++at;
    return at < line.size() ? line[at] : '\0';
  };
  const auto take = [&](char c) { return peek() == c && (++at, true); };
  const auto quoted = [&](std::string& text) {
    if (!take('"')) return false;
    for (; at < line.size() && line[at] != '"'; ++at) {
      if (line[at] != '\\') {
        text += line[at];
      } else if (++at >= line.size()) {
        return false;
      } else if (line[at] == '"' || line[at] == '\\' || line[at] == '/') {
        text += line[at];
      } else if (line[at] == 'u' && at + 4 < line.size()) {
        const unsigned long code = std::strtoul(std::string(line.substr(at + 1, 4)).c_str(), nullptr, 16);
        if (code >= 0x20) return false;
        text += static_cast<char>(code);
        at += 4;
      } else {
        return false;
      }
    }
    return take('"');
  };
  if (!take('{')) return std::nullopt;
  do {
    std::string key;
    JsonField value;
    if (!quoted(key) || !take(':')) return std::nullopt;
    value.quoted = peek() == '"';
    if (value.quoted) {
      if (!quoted(value.text)) return std::nullopt;
    } else {
      while (at < line.size() && line[at] != ',' && line[at] != '}') value.text += line[at++];
    }
    out[key] = value;
  } while (take(','));
  if (!take('}') || peek() != '\0') return std::nullopt;
  return out;
}

inline bool parse(const JsonField& field, std::string& value) {
  value = field.text;
  return field.quoted;
}
inline bool parse(const JsonField& field, std::uint64_t& value) {
  char* end = nullptr;
  value = std::strtoull(field.text.c_str(), &end, 10);
  return !field.quoted && !field.text.empty() && std::isdigit(static_cast<unsigned char>(field.text[0])) != 0 &&
         *end == '\0';
}
inline bool parse(const JsonField& field, double& value) {
  if (field.quoted) return false;
  if (field.text == "null") return (value = not_known, true);
  char* end = nullptr;
  value = std::strtod(field.text.c_str(), &end);
  return !field.text.empty() && *end == '\0' && std::isfinite(value);
}

}  // namespace detail

inline std::string to_json_line(const RunSummary& summary) {
  std::string out;
  for_each_field(summary, [&out](const char* name, const auto& value) {
    out += (out.empty() ? "{\"" : ", \"") + std::string(name) + "\": " + detail::json_value(value);
  });
  return out + "}\n";
}

// Nothing when the line is not whole or lacks a field; fields that are not known are ignored.
inline std::optional<RunSummary> from_json_line(std::string_view line) {
  const auto fields = detail::flat_object(line);
  if (!fields) return std::nullopt;
  RunSummary summary;
  bool complete = true;
  for_each_field(summary, [&](const char* name, auto& value) {
    const auto field = fields->find(name);
    complete = complete && field != fields->end() && detail::parse(field->second, value);
  });
  return complete ? std::optional<RunSummary>(summary) : std::nullopt;
}

// The runs of a file; none when it does not exist. Lines that do not parse, such as the last one of an experiment that
// was killed, are left out: their runs are done again.
inline std::vector<RunSummary> read_summaries(const std::filesystem::path& file) {
  std::vector<RunSummary> out;
  std::ifstream stream(file);
  for (std::string line; std::getline(stream, line);) {
    if (auto summary = from_json_line(line)) out.push_back(*summary);
  }
  return out;
}

// Throws when the file cannot be written. Begins a new line when the last one was cut off.
inline void append_summary(const std::filesystem::path& file, const RunSummary& summary) {
  std::fstream stream(file, std::ios::binary | std::ios::in);
  bool cut_off = false;
  if (stream && stream.seekg(-1, std::ios::end)) cut_off = stream.get() != '\n';
  stream.close();
  std::ofstream out(file, std::ios::binary | std::ios::app);
  out << (cut_off ? "\n" : "") << to_json_line(summary) << std::flush;
  if (!out) throw std::runtime_error("cannot write " + file.string());
}

}  // namespace cfp_slam
