// A structured-light RGB-D camera: what it makes of the true depth and colour.
#pragma once

#include <cmath>
#include <vector>

#include "cfp/core/random.hpp"

#include "renderer.hpp"

namespace synthetic {

struct SensorOptions {
  double depth_units_per_metre = 5000;
  double focal_baseline = 43.5;      ///< px m, focal length times baseline: 580 px and 7.5 cm
  double disparity_step_px = 0.125;  ///< quantisation: z² / focal_baseline * step, 2.6 cm at 3 m
  double min_depth_m = 0.5;
  double range_m = 8;            ///< nothing beyond
  double fading_m = 5.5;         ///< from here to range_m ever more pixels fail
  double image_noise = 2.2;      ///< standard deviation, grey levels
  double exposure_swing = 0.08;  ///< slow relative change of the exposure
};

/// Normal numbers from a table: a frame needs a million.
class NormalTable {
 public:
  explicit NormalTable(std::uint64_t seed) : values_(1U << 15U) {
    cfp::Random random(seed, "normal table");
    for (float& v : values_) v = static_cast<float>(random.normal());
  }
  [[nodiscard]] float operator()(std::uint64_t bits) const { return values_[bits & (values_.size() - 1)]; }

 private:
  std::vector<float> values_;
};

/// Standard deviation of the depth, m (Nguyen, Izadi, Lovell: "Modeling Kinect sensor noise", 3DIMPVT 2012, axial
/// part).
inline double depth_sigma(double z) { return 0.0012 + 0.0019 * (z - 0.4) * (z - 0.4); }

/// 16-bit depth image; 0 = no depth. Fails beyond the range, on black glossy and grazing surfaces, in the projector's
/// shadow to the left of near things and, raggedly, along silhouettes, where a few pixels fly between near and far.
/// Where frame.surface is −1 (a real recording), depth goes through as it is, but for the new shadows.
inline cv::Mat sense_depth(const Frame& frame, const std::vector<Surface>& surfaces, const SensorOptions& options,
                           const NormalTable& normal, cfp::Random random) {
  const int width = frame.depth.cols, height = frame.depth.rows;
  cv::Mat image = cv::Mat::zeros(height, width, CV_16U);
  const auto ragged = [&](int x, int y) {  // the same for 3x3 pixels, as correlation windows make edges
    std::uint64_t h = static_cast<std::uint64_t>(y / 3) * 0x9e3779b97f4a7c15ULL +
                      static_cast<std::uint64_t>(x / 3) * 0xc2b2ae3d27d4eb4fULL;
    h ^= h >> 29U;
    return static_cast<int>((h * 0xbf58476d1ce4e5b9ULL) >> 62U) - 1;  // -1 … 2
  };
  const std::uint64_t spots = random();
  std::vector<char> shadow(static_cast<std::size_t>(width));
  for (int y = 0; y < height; ++y) {
    const float* depth = frame.depth.ptr<float>(y);
    const short* ids = frame.surface.ptr<short>(y);
    // The projector stands to the right and sees x − fb / z: whatever does not move on to the left there is hidden from
    // it.
    double leftmost = infinity;
    for (int x = width - 1; x >= 0; --x) {
      const double z = static_cast<double>(depth[x]);
      const double projected = x - (z < infinity ? options.focal_baseline / z : 0);
      shadow[static_cast<std::size_t>(x)] = projected > leftmost + 1.5 ? 1 : 0;
      leftmost = std::min(leftmost, projected);
    }
    for (int x = 0; x < width; ++x) {
      const std::uint64_t bits = random();
      if (shadow[static_cast<std::size_t>(x)] != 0) continue;
      if (ids[x] < 0) {
        const double units = static_cast<double>(depth[x]) * options.depth_units_per_metre;
        if (units < 65535.5) image.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(std::lround(units));
        continue;
      }
      double z = static_cast<double>(depth[x]);
      const int from = std::clamp(x + ragged(x, y), 0, width - 1);
      const double other = ids[from] < 0 ? z : static_cast<double>(depth[from]);
      const double chance = static_cast<double>(bits >> 40U) * 0x1.0p-24;
      if (std::abs(other - z) > 0.1) {  // a silhouette: no depth, the neighbour's, or one between
        if (chance < 0.45) continue;
        z = chance < 0.6 ? z + (other - z) * (chance - 0.45) / 0.15 : other;
      }
      const Surface& s = surfaces[static_cast<std::size_t>(ids[x] / 8)];
      const double slant = static_cast<double>(frame.slant.at<float>(y, x));
      double failure = 0.002 + (s.absorbs_infrared ? 0.75 : 0) + (slant < 0.18 ? 0.8 * (1 - slant / 0.18) : 0);
      if (z > options.fading_m) failure += (z - options.fading_m) / (options.range_m - options.fading_m);
      if (!(z > options.min_depth_m && z < options.range_m)) continue;
      // Failures come in spots, not as salt.
      const std::uint64_t spot =
          cfp::Random(spots + static_cast<std::uint64_t>(y / 4) * 4096 + static_cast<std::uint64_t>(x / 4))();
      if (static_cast<double>(spot >> 40U) * 0x1.0p-24 < failure) continue;
      z += depth_sigma(z) * static_cast<double>(normal(bits));
      const double disparity =
          std::round(options.focal_baseline / z / options.disparity_step_px) * options.disparity_step_px;
      image.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(
          std::clamp(options.focal_baseline / disparity * options.depth_units_per_metre, 0.0, 65535.0));
    }
  }
  return image;
}

/// Relative exposure at a time: a slow swing and now and then a jump, as automatic exposure does when a person fills
/// the image.
inline double exposure(const SensorOptions& options, double time, double people_part) {
  return 1 + options.exposure_swing * std::sin(0.9 * time) + 0.12 * people_part;
}

/// 8-bit colour image. Only pixels of rendered surfaces change; a real recording behind them has its own noise.
inline cv::Mat sense_color(const Frame& frame, const SensorOptions& options, double gain, const NormalTable& normal,
                           cfp::Random random) {
  cv::Mat image(frame.color.size(), CV_8UC3);
  for (int y = 0; y < image.rows; ++y) {
    const cv::Vec3f* in = frame.color.ptr<cv::Vec3f>(y);
    const short* ids = frame.surface.ptr<short>(y);
    cv::Vec3b* out = image.ptr<cv::Vec3b>(y);
    for (int x = 0; x < image.cols; ++x) {
      std::uint64_t bits = random();
      for (int c = 0; c < 3; ++c, bits >>= 16U) {
        const double value =
            ids[x] < 0 ? static_cast<double>(in[x][c])
                       : static_cast<double>(in[x][c]) * gain + options.image_noise * static_cast<double>(normal(bits));
        out[x][c] = cv::saturate_cast<unsigned char>(value);
      }
    }
  }
  return image;
}

}  // namespace synthetic
