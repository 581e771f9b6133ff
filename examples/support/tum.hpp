// Reading and writing the TUM RGB-D text formats: lines of `timestamp …`, # starts a comment, blank lines are skipped. Whatever is
// wrong with a file is thrown as std::runtime_error that says file and line.
#pragma once

#include <charconv>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "cfp/evaluation/trajectory.hpp"

namespace cfp_examples {

[[noreturn]] inline void bad_line(const std::filesystem::path& file, int line, const std::string& what) {
  throw std::runtime_error(file.string() + ":" + std::to_string(line) + ": " + what);
}

/// Calls visit(line_number, words) for every line that is neither blank nor a comment. Commas separate words, too, as in the TUM scripts.
template <typename Visit>
void for_each_line(const std::filesystem::path& file, const Visit& visit) {
  std::ifstream stream(file);
  if (!stream) throw std::runtime_error("cannot read " + file.string());
  std::string text;
  for (int line = 1; std::getline(stream, text); ++line) {
    text.resize(std::min(text.size(), text.find('#')));
    for (char& c : text) {
      if (c == ',' || c == '\t' || c == '\r') c = ' ';
    }
    std::istringstream split(text);
    std::vector<std::string> words;
    for (std::string word; split >> word;) words.push_back(word);
    if (!words.empty()) visit(line, words);
  }
}

inline double parse_number(const std::filesystem::path& file, int line, const std::string& word, const char* meaning) {
  double value = 0;
  const char* const first = word.data() + (word.size() > 1 && word[0] == '+' ? 1 : 0);
  const auto [end, error] = std::from_chars(first, word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size()) bad_line(file, line, "'" + word + "' is no number (" + meaning + ")");
  return value;
}

/// `timestamp tx ty tz qx qy qz qw`, camera to world. Quaternions are normalised; a line whose quaternion is zero, or with a value
/// that is not finite, is kept as a pose that cfp::is_usable refuses, as SLAM systems print such lines for lost frames.
inline std::vector<cfp::StampedPose<double>> read_tum_trajectory(const std::filesystem::path& file) {
  std::vector<cfp::StampedPose<double>> poses;
  for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    static constexpr const char* meaning[] = {"timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw"};
    if (words.size() != 8)
      bad_line(file, line, "expected 'timestamp tx ty tz qx qy qz qw', found " + std::to_string(words.size()) + " words");
    double v[8];
    for (std::size_t i = 0; i < 8; ++i) v[i] = parse_number(file, line, words[i], meaning[i]);
    cfp::StampedPose<double> pose;
    pose.time_s = v[0];
    pose.T_world_cam.translation << v[1], v[2], v[3];
    const Eigen::Quaterniond q(v[7], v[4], v[5], v[6]);
    if (q.norm() > 0) {
      pose.T_world_cam.rotation = q.normalized().toRotationMatrix();
    } else {
      pose.T_world_cam.rotation.setZero();
    }
    poses.push_back(pose);
  });
  return poses;
}

/// One trajectory line, microseconds and nine decimals.
inline std::string tum_line(const cfp::StampedPose<double>& pose) {
  const Eigen::Quaterniond q(pose.T_world_cam.rotation);
  const auto& t = pose.T_world_cam.translation;
  char text[256];
  std::snprintf(text, sizeof text, "%.6f %.9f %.9f %.9f %.9f %.9f %.9f %.9f", pose.time_s, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
  return text;
}

/// `timestamp filename` lists such as rgb.txt.
struct TumImage {
  double time_s = 0;
  std::string file;
  int line = 0;
};
inline std::vector<TumImage> read_tum_list(const std::filesystem::path& file) {
  std::vector<TumImage> images;
  for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    if (words.size() != 2) bad_line(file, line, "expected 'timestamp filename', found " + std::to_string(words.size()) + " words");
    images.push_back({parse_number(file, line, words[0], "timestamp"), words[1], line});
  });
  return images;
}

/// camera.txt: `fx fy cx cy width height depth_units_per_metre`.
struct TumCamera {
  double fx = 0, fy = 0, cx = 0, cy = 0;
  int width = 0, height = 0;
  double depth_units_per_metre = 5000;
};
inline TumCamera read_tum_camera(const std::filesystem::path& file) {
  TumCamera camera;
  int cameras = 0;
  for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    if (words.size() != 7) bad_line(file, line, "expected 'fx fy cx cy width height depth_units_per_metre'");
    if (++cameras > 1) bad_line(file, line, "a second camera");
    double v[7];
    for (std::size_t i = 0; i < 7; ++i) {
      v[i] = parse_number(file, line, words[i], "camera");
      if (!cfp::is_finite(v[i]) || (i != 2 && i != 3 && !(v[i] > 0 && v[i] < 1e6))) bad_line(file, line, "'" + words[i] + "' out of range");
    }
    camera = {v[0], v[1], v[2], v[3], static_cast<int>(v[4]), static_cast<int>(v[5]), v[6]};
  });
  if (cameras == 0) throw std::runtime_error(file.string() + ": no camera in it");
  return camera;
}

}  // namespace cfp_examples
