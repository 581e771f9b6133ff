// Readers of two bundle adjustment file formats, and the camera both need: the text of "Bundle Adjustment in the Large"
// and the binary of libmv. Used by 05_bundle_adjustment.cpp and by the benchmark and test that run on such files.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <map>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "cfp/optimization/bundle/bundle_problem.hpp"
#include "support/numbers.hpp"

namespace ba_files {

/// A pinhole camera with radial (k1, k2, k3) and tangential (p1, p2) distortion, as cfp wants a camera: project, with
/// Jacobian.
struct DistortedCamera {
  using ScalarType = double;
  double focal = 1, cx = 0, cy = 0, k1 = 0, k2 = 0, k3 = 0, p1 = 0, p2 = 0;

  bool project(const cfp::Vector3<double>& point, cfp::Vector2<double>& pixel,
               cfp::Matrix23<double>* jacobian = nullptr) const noexcept {
    if (!(point.z() > cfp::Tolerance<double>::min_depth)) return false;
    const double inv_z = 1 / point.z(), x = point.x() * inv_z, y = point.y() * inv_z;
    const double r2 = x * x + y * y, radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
    const double u = focal * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + cx;
    const double v = focal * (y * radial + 2 * p2 * x * y + p1 * (r2 + 2 * y * y)) + cy;
    if (!cfp::is_finite(u) || !cfp::is_finite(v)) return false;
    pixel << u, v;
    if (jacobian != nullptr) {
      const double slope = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3));  // d radial / d r2, times 2
      const double ux = focal * (radial + slope * x * x + 2 * p1 * y + 6 * p2 * x),
                   uy = focal * (slope * x * y + 2 * p1 * x + 2 * p2 * y);
      const double vx = focal * (slope * x * y + 2 * p2 * y + 2 * p1 * x),
                   vy = focal * (radial + slope * y * y + 2 * p2 * x + 6 * p1 * y);
      *jacobian << ux * inv_z, uy * inv_z, -(ux * x + uy * y) * inv_z, vx * inv_z, vy * inv_z,
          -(vx * x + vy * y) * inv_z;
    }
    return true;
  }
};

struct Problem {
  std::vector<DistortedCamera> cameras;  // one, or one per pose
  std::vector<cfp::SE3<double>> poses;
  std::vector<cfp::Vector3<double>> points;
  std::vector<int> pose, point;
  std::vector<cfp::Vector2<double>> pixels;

  /// The view that cfp::adjust_bundle takes.
  cfp::BundleProblem<DistortedCamera> view() { return {poses, points, cameras, {pose, point, pixels}}; }
};

inline void fail(const std::string& file, const std::string& what) { throw std::runtime_error(file + ": " + what); }

/// "cameras points observations", then "camera point x y" per observation, then nine numbers per camera (rotation
/// vector, translation, f, k1, k2) and three per point. BAL's camera looks down -z with y up; here it is turned to look
/// down +z with y down, and v changes sign.
inline Problem read_bal(const std::string& file) {
  std::ifstream in(file);
  if (!in) fail(file, "cannot be opened");
  std::string line;
  std::size_t line_number = 0;
  std::istringstream fields;
  const auto next = [&](const std::string& what) {
    std::string field;
    while (!(fields >> field)) {
      if (!std::getline(in, line))
        fail(file, "line " + std::to_string(line_number + 1) + ": the file ends before " + what);
      ++line_number;
      fields.clear();
      fields.str(line);
    }
    const std::optional<double> value = cfp_examples::read_number(field);
    if (!value || !cfp::is_finite(*value))
      fail(file, "line " + std::to_string(line_number) + ": " + what + " is not a number: '" + field + "'");
    return *value;
  };
  const auto count = [&](const std::string& what, double limit) {
    const double value = next(what);
    if (!(value >= 0 && value < limit && value == std::floor(value))) {
      fail(file, "line " + std::to_string(line_number) + ": " + what + " is not a whole number from 0 to below " +
                     std::to_string(static_cast<long long>(limit)));
    }
    return static_cast<int>(value);
  };
  constexpr double limit = 1e8;
  const int cameras = count("number of cameras", limit), points = count("number of points", limit);
  const int observations = count("number of observations", limit);
  Problem problem;
  for (int i = 0; i < observations; ++i) {
    problem.pose.push_back(count("camera index", cameras));
    problem.point.push_back(count("point index", points));
    const double x = next("x"), y = next("y");
    problem.pixels.emplace_back(x, -y);
  }
  const cfp::Vector3<double> flip(1, -1, -1);
  for (int k = 0; k < cameras; ++k) {
    double p[9];
    static constexpr const char* names[9] = {
        "rotation x", "rotation y", "rotation z", "translation x", "translation y", "translation z", "f", "k1", "k2"};
    for (int e = 0; e < 9; ++e) p[e] = next("camera " + std::to_string(k) + ", " + names[e]);
    problem.poses.push_back({flip.asDiagonal() * cfp::so3_exp(cfp::Vector3<double>(p[0], p[1], p[2])),
                             flip.cwiseProduct(cfp::Vector3<double>(p[3], p[4], p[5]))});
    problem.cameras.push_back({p[6], 0, 0, p[7], p[8]});
  }
  for (int j = 0; j < points; ++j) {
    const std::string name = "point " + std::to_string(j);
    const double x = next(name + ", x"), y = next(name + ", y"), z = next(name + ", z");
    problem.points.emplace_back(x, y, z);
  }
  return problem;
}

/// libmv: byte order ('V' big, 'v' little), marker space ('P' pixels, 'N' normalised), eight intrinsics (f, cx, cy, k1,
/// k2, k3, p1, p2), then counted lists of cameras (image, rotation column by column, translation), points (track,
/// position), markers (image, track, x, y).
inline Problem read_libmv(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in || std::filesystem::is_directory(file)) fail(file, "cannot be opened");
  const std::vector<char> bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  std::size_t offset = 0;
  const auto at = [&] { return "byte " + std::to_string(offset) + ": "; };
  const auto character = [&](const std::string& what, char first, char second) {
    if (offset >= bytes.size()) fail(file, at() + "the file ends before " + what);
    if (bytes[offset] != first && bytes[offset] != second)
      fail(file, at() + what + " is neither '" + first + "' nor '" + second + "'");
    return bytes[offset++];
  };
  const bool big_endian = character("the byte order", 'V', 'v') == 'V';
  const bool pixels = character("the marker space", 'P', 'N') == 'P';
  const auto word = [&](const std::string& what) {
    if (bytes.size() - offset < 4) fail(file, at() + "the file ends before " + what);
    std::uint32_t value = 0;
    for (std::size_t b = 0; b < 4; ++b)
      value |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[offset + (big_endian ? 3 - b : b)]))
               << (8 * b);
    offset += 4;
    return value;
  };
  const auto whole = [&](const std::string& what) {
    const std::uint32_t value = word(what);
    if (value > static_cast<std::uint32_t>((std::numeric_limits<int>::max)()))
      offset -= 4, fail(file, at() + what + " is negative");
    return static_cast<int>(value);
  };
  const auto real = [&](const std::string& what) {
    const std::uint32_t value = word(what);
    float number = 0;
    std::memcpy(&number, &value, sizeof(number));
    if (!cfp::is_finite(number)) offset -= 4, fail(file, at() + what + " is not finite");
    return static_cast<double>(number);
  };
  double k[8];
  static constexpr const char* names[8] = {"f", "cx", "cy", "k1", "k2", "k3", "p1", "p2"};
  for (int e = 0; e < 8; ++e) k[e] = real(std::string("intrinsic ") + names[e]);
  Problem problem;
  problem.cameras.push_back(pixels ? DistortedCamera{k[0], k[1], k[2], k[3], k[4], k[5], k[6], k[7]}
                                   : DistortedCamera{});
  std::map<int, int> pose_of_image, point_of_track;
  for (int n = whole("number of cameras"), i = 0; i < n; ++i) {
    const std::string name = "camera " + std::to_string(i);
    pose_of_image[whole(name + ", image")] = i;
    cfp::SE3<double> pose;
    for (int e = 0; e < 9; ++e) pose.rotation(e % 3, e / 3) = real(name + ", rotation");
    for (int e = 0; e < 3; ++e) pose.translation[e] = real(name + ", translation");
    pose.rotation = cfp::normalized_rotation(pose.rotation);  // stored in single precision
    problem.poses.push_back(pose);
  }
  for (int n = whole("number of points"), j = 0; j < n; ++j) {
    const std::string name = "point " + std::to_string(j);
    point_of_track[whole(name + ", track")] = j;
    cfp::Vector3<double> x;
    for (int e = 0; e < 3; ++e) x[e] = real(name + ", position");
    problem.points.push_back(x);
  }
  for (int n = whole("number of markers"), i = 0; i < n; ++i) {
    const std::string name = "marker " + std::to_string(i);
    const auto pose = pose_of_image.find(whole(name + ", image"));
    const auto point = point_of_track.find(whole(name + ", track"));
    const double x = real(name + ", x"), y = real(name + ", y");
    if (pose == pose_of_image.end() || point == point_of_track.end())
      continue;  // libmv keeps markers it has not reconstructed
    problem.pose.push_back(pose->second);
    problem.point.push_back(point->second);
    problem.pixels.emplace_back(x, y);
  }
  return problem;
}

/// By the name's end: .bin is libmv, anything else BAL text. Throws std::runtime_error naming the file and the line or
/// byte.
inline Problem read(const std::string& file) {
  const bool binary = file.size() >= 4 && file.compare(file.size() - 4, 4, ".bin") == 0;
  return binary ? read_libmv(file) : read_bal(file);
}

}  // namespace ba_files
