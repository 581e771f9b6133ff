// Reading and writing the TUM RGB-D text formats: lines of `timestamp …`, # starts a comment, blank lines are skipped.
// Whatever is wrong with a file is thrown as std::runtime_error that says file and line.
#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <tuple>
#include <vector>

#include <Eigen/Geometry>

#include "cfp/evaluation/trajectory.hpp"
#include "cfp/geometry/any_camera.hpp"
#include "numbers.hpp"

namespace cfp_examples {

[[noreturn]] inline void bad_line(const std::filesystem::path& file, int line, const std::string& what) {
  throw std::runtime_error(file.string() + ":" + std::to_string(line) + ": " + what);
}

/// Calls visit(line_number, words) for every line that is neither blank nor a comment. Commas separate words, too, as
/// in the TUM scripts.
template <typename Visit>
void for_each_line(const std::filesystem::path& file, const Visit& visit) {
  std::ifstream stream(file);
  if (!stream) throw std::runtime_error("cannot read " + file.string());
  std::string text;
  for (int line = 1; std::getline(stream, text); ++line) {
    if (line == 1) drop_byte_order_mark(text);
    text.resize(std::min(text.size(), text.find('#')));
    for (char& c : text) {
      if (c == ',' || c == '\t' || c == '\r') c = ' ';
    }
    std::istringstream split(text);
    std::vector<std::string> words;
    for (std::string word; split >> word;) words.push_back(word);
    if (!words.empty()) visit(line, words);
  }
  if (stream.bad()) throw std::runtime_error("cannot read " + file.string());  // a folder, for example
}

inline double parse_number(const std::filesystem::path& file, int line, const std::string& word, const char* meaning) {
  const std::optional<double> value = read_number(word);
  if (!value) bad_line(file, line, "'" + word + "' is no number (" + meaning + ")");
  return *value;
}

/// The same for what is counted: a whole number in [0, 1e9].
inline std::size_t parse_count(const std::filesystem::path& file, int line, const std::string& word,
                               const char* meaning) {
  const double value = parse_number(file, line, word, meaning);
  if (!(value >= 0 && value <= 1e9 && value == std::floor(value)))
    bad_line(file, line, "'" + word + "' is no count (" + meaning + ")");
  return static_cast<std::size_t>(value);
}

/// `timestamp tx ty tz qx qy qz qw`, camera to world. Quaternions are normalised; a line whose quaternion is zero, or
/// with a value that is not finite, is kept as a pose that cfp::is_usable refuses, as SLAM systems print such lines for
/// lost frames.
inline std::vector<cfp::StampedPose<double>> read_tum_trajectory(const std::filesystem::path& file) {
  std::vector<cfp::StampedPose<double>> poses;
  for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    static constexpr const char* meaning[] = {"timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw"};
    if (words.size() != 8)
      bad_line(file, line,
               "expected 'timestamp tx ty tz qx qy qz qw', found " + std::to_string(words.size()) + " words");
    double v[8];
    for (std::size_t i = 0; i < 8; ++i) v[i] = parse_number(file, line, words[i], meaning[i]);
    cfp::StampedPose<double> pose;
    pose.time_s = v[0];
    pose.T_world_cam.translation << v[1], v[2], v[3];
    Eigen::Quaterniond q(v[7], v[4], v[5], v[6]);
    q.coeffs() /= q.coeffs().cwiseAbs().maxCoeff();  // squares of huge or tiny ones leave the range of numbers
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
  std::string text = fixed(pose.time_s, 6);
  for (const double value : {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}) text += ' ' + fixed(value, 9);
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
    if (words.size() != 2)
      bad_line(file, line, "expected 'timestamp filename', found " + std::to_string(words.size()) + " words");
    images.push_back({parse_number(file, line, words[0], "timestamp"), words[1], line});
  });
  return images;
}

/// The camera of a recording, distortion as in OpenCV (k3 last); all zero: undistorted images. Or a fisheye, k1 to k4
/// as in OpenCV's model of it.
struct TumCamera {
  double fx = 0, fy = 0, cx = 0, cy = 0;
  int width = 0, height = 0;
  double depth_units_per_metre = 5000;
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0, k4 = 0;
  bool fisheye = false;

  [[nodiscard]] bool distorted() const { return fisheye || k1 != 0 || k2 != 0 || p1 != 0 || p2 != 0 || k3 != 0; }
  [[nodiscard]] cfp::AnyCamera<double> camera() const {
    if (fisheye) return {cfp::KannalaBrandtCamera<double>{fx, fy, cx, cy, k1, k2, k3, k4}};
    if (!distorted()) return {cfp::PinholeCamera<double>{fx, fy, cx, cy}};
    return {cfp::RadialTangentialCamera<double>{fx, fy, cx, cy, k1, k2, p1, p2, k3}};
  }
};

/// camera.txt: one line `fx fy cx cy width height depth_units_per_metre [k1 k2 p1 p2 k3]` or, of a fisheye, `...
/// fisheye k1 k2 k3 k4`. The distortion may stand in a comment instead, after the words `k1 k2 p1 p2 k3 =`, where
/// programs that read seven numbers do not see it.
inline TumCamera read_tum_camera(const std::filesystem::path& file) {
  TumCamera camera;
  int cameras = 0;
  const auto parse = [&](int line, const std::vector<std::string>& words) {
    std::vector<double> v;
    for (const std::string& word : words) {
      v.push_back(parse_number(file, line, word, "camera"));
      if (!cfp::is_finite(v.back()) || !(std::abs(v.back()) < 1e6)) bad_line(file, line, "'" + word + "' out of range");
    }
    return v;
  };
  for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    if (words.size() != 7 && words.size() != 12)
      bad_line(file, line,
               "expected 'fx fy cx cy width height depth_units_per_metre [k1 k2 p1 p2 k3 | fisheye k1 k2 k3 k4]'");
    if (++cameras > 1) bad_line(file, line, "a second camera");
    std::vector<std::string> numbers = words;
    const bool fisheye = words.size() == 12 && words[7] == "fisheye";
    if (fisheye) numbers.erase(numbers.begin() + 7);
    std::vector<double> v = parse(line, numbers);
    for (const std::size_t i : {0U, 1U, 4U, 5U, 6U}) {
      if (!(v[i] > 0)) bad_line(file, line, "'" + words[i] + "' out of range");
    }
    for (const std::size_t i : {4U, 5U}) {
      if (!(v[i] == std::floor(v[i]))) bad_line(file, line, "'" + words[i] + "' is no number of pixels");
    }
    v.resize(12, 0);
    camera = {v[0], v[1], v[2], v[3], static_cast<int>(v[4]), static_cast<int>(v[5]), v[6], v[7], v[8]};
    camera.fisheye = fisheye;
    if (fisheye)
      camera.k3 = v[9], camera.k4 = v[10];
    else
      camera.p1 = v[9], camera.p2 = v[10], camera.k3 = v[11];
  });
  if (cameras == 0) throw std::runtime_error(file.string() + ": no camera in it");
  std::ifstream stream(file);
  std::string text;
  for (int line = 1; std::getline(stream, text); ++line) {
    static const std::string key = "k1 k2 p1 p2 k3 =";
    const std::size_t comment = text.find('#'), at = text.find(key);
    if (comment == std::string::npos || at == std::string::npos || at < comment) continue;
    std::istringstream split(text.substr(at + key.size()));
    std::vector<std::string> words(5);
    for (std::string& word : words) split >> word;
    while (!words[4].empty() && (words[4].back() == ')' || words[4].back() == '.')) words[4].pop_back();
    const std::vector<double> d = parse(line, words);
    if (camera.distorted()) bad_line(file, line, "a second distortion");
    std::tie(camera.k1, camera.k2, camera.p1, camera.p2, camera.k3) = std::tie(d[0], d[1], d[2], d[3], d[4]);
  }
  return camera;
}

/// The last part of a folder's path, trailing slash and `.` resolved.
inline std::string folder_name(const std::filesystem::path& folder) {
  const std::filesystem::path whole = std::filesystem::weakly_canonical(folder);
  return (whole.has_filename() ? whole : whole.parent_path()).filename().string();
}

/// The calibration that the TUM RGB-D data set publishes for its three cameras, told from the folder's name
/// (`freiburg2` or `fr2` in it): the drivers' depth is registered to the colour image, fr3's images are undistorted.
/// Throws when the name tells nothing.
inline TumCamera published_tum_camera(const std::filesystem::path& folder) {
  const std::string name = folder_name(folder);
  const auto is = [&](const char* number) {
    return name.find(std::string("freiburg") + number) != std::string::npos ||
           name.find(std::string("fr") + number) != std::string::npos;
  };
  if (is("1")) return {517.3, 516.5, 318.6, 255.3, 640, 480, 5000, 0.2624, -0.9531, -0.0054, 0.0026, 1.1633};
  if (is("2")) return {520.9, 521.0, 325.1, 249.7, 640, 480, 5000, 0.2312, -0.7849, -0.0033, -0.0001, 0.9172};
  if (is("3")) return {535.4, 539.2, 320.1, 247.6, 640, 480, 5000};
  throw std::runtime_error(folder.string() +
                           ": no camera.txt (fx fy cx cy width height depth_units_per_metre), and the name tells no "
                           "TUM camera (fr1, fr2, fr3)");
}

}  // namespace cfp_examples
