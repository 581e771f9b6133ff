// Procedural textures with mip levels. Everything is drawn from a seeded generator: no image files, the same room on
// every machine.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Core>
#include <opencv2/imgproc.hpp>

#include "cfp/core/random.hpp"

namespace synthetic {

using Color = Eigen::Vector3f;  ///< blue, green, red in [0, 255]

/// A square tiling image with its mip levels, sampled trilinearly.
class Texture {
 public:
  explicit Texture(cv::Mat image) {
    for (;; cv::resize(image, image, {}, 0.5, 0.5, cv::INTER_AREA)) {
      cv::Mat level;
      cv::cvtColor(image, level, cv::COLOR_BGR2BGRA);
      levels_.push_back(level);
      if (image.cols == 1) break;
    }
  }

  /// (u, v) in tiles; tiles_per_pixel is the size of the image pixel on the surface, which chooses the levels.
  [[nodiscard]] Color sample(double u, double v, double tiles_per_pixel) const {
    const double texels = std::max(tiles_per_pixel * levels_[0].cols, 1e-6);
    const double level = std::clamp(std::log2(texels), 0.0, static_cast<double>(levels_.size() - 1));
    const auto lower = static_cast<std::size_t>(level);
    const auto part = static_cast<float>(level - static_cast<double>(lower));
    const Color fine = bilinear(levels_[lower], u, v);
    return part > 0 ? Color(fine + part * (bilinear(levels_[lower + 1], u, v) - fine)) : fine;
  }

 private:
  static Color bilinear(const cv::Mat& level, double u, double v) {
    const int n = level.cols;  // a power of two
    const double x = (u - std::floor(u)) * n - 0.5, y = (v - std::floor(v)) * n - 0.5;
    const double fx = std::floor(x), fy = std::floor(y);
    const auto a = static_cast<float>(x - fx), b = static_cast<float>(y - fy);
    const int x0 = static_cast<int>(fx) & (n - 1), x1 = (x0 + 1) & (n - 1), y0 = static_cast<int>(fy) & (n - 1),
              y1 = (y0 + 1) & (n - 1);
    const auto at = [&](int row, int column) {
      const cv::Vec4b& p = level.at<cv::Vec4b>(row, column);
      return Color(p[0], p[1], p[2]);
    };
    return (1 - b) * ((1 - a) * at(y0, x0) + a * at(y0, x1)) + b * ((1 - a) * at(y1, x0) + a * at(y1, x1));
  }

  std::vector<cv::Mat> levels_;
};

/// One of the whole numbers from 0 to n - 1.
inline int below(cfp::Random& random, int n) { return static_cast<int>(random.index(static_cast<std::uint32_t>(n))); }

/// A muted colour: rooms are grey and brown with a few bright things.
inline cv::Scalar random_color(cfp::Random& random, double low = 20, double high = 240) {
  const double tone = random.uniform(low, high), chroma = random.uniform() < 0.12 ? 90 : 22;
  const auto channel = [&] { return std::clamp(tone + random.uniform(-chroma, chroma), 0.0, 255.0); };
  const double blue = channel(), green = channel(), red = channel();
  return {blue, green, red};
}

/// Grain of several sizes: real surfaces are not flat, and a flat one gives corners to nobody.
inline void add_grain(cfp::Random& random, cv::Mat& image, double strength) {
  for (int cell = 1; cell <= 16; cell *= 4) {
    cv::Mat noise(image.rows / cell, image.cols / cell, CV_32F);
    std::generate_n(noise.ptr<float>(), noise.total(),
                    [&] { return static_cast<float>(3.46 * strength * (random.uniform() - 0.5)); });
    cv::resize(noise, noise, image.size(), 0, 0, cv::INTER_LINEAR);
    const float* const grain = noise.ptr<float>();
    cv::Vec3b* const pixels = image.ptr<cv::Vec3b>();  // of a whole image: its rows adjoin
    for (std::size_t i = 0; i < image.total(); ++i) {
      for (int c = 0; c < 3; ++c) pixels[i][c] = cv::saturate_cast<uchar>(static_cast<float>(pixels[i][c]) + grain[i]);
    }
  }
}

/// Rectangles, discs, lines and letters of many sizes on a ground colour: posters, papers, labels, clutter. Shapes get
/// smaller as they go, so every distance finds corners. size in texels, a power of two; contrast in (0, 1] draws the
/// colours towards the ground's.
inline cv::Mat collage(cfp::Random& random, int size, const cv::Scalar& ground, int shapes, double largest,
                       double contrast) {
  cv::Mat image(size, size, CV_8UC3, ground);
  const auto any_color = [&]() -> cv::Scalar { return ground + contrast * (random_color(random) - ground); };
  for (int i = 0; i < shapes; ++i) {
    const double scale = size * largest * std::pow(0.05, static_cast<double>(i) / shapes);
    const int y = below(random, size), x = below(random, size);
    const cv::Point at(x, y);
    const double height = scale * random.uniform(0.3, 1), width = scale * random.uniform(0.3, 1);
    const cv::Size extent(static_cast<int>(width) + 2, static_cast<int>(height) + 2);
    const cv::Scalar color = any_color();
    const double kind = random.uniform();
    if (kind < 0.45) {
      cv::rectangle(image, cv::Rect(at, extent), color, cv::FILLED);
      cv::rectangle(image, cv::Rect(at, extent), any_color(), std::max(1, extent.width / 20));
    } else if (kind < 0.6) {
      cv::circle(image, at, extent.width / 2 + 1, color,
                 random.uniform() < 0.6 ? cv::FILLED : std::max(1, extent.width / 12), cv::LINE_AA);
    } else if (kind < 0.72) {
      cv::line(image, at, at + cv::Point(extent.width, random.uniform() < 0.5 ? extent.height : -extent.height), color,
               std::max(1, size / 256), cv::LINE_AA);
    } else {
      std::string word;
      for (int c = 0; c < 7; ++c) word += static_cast<char>('A' + random.index(26));
      cv::putText(image, word, at, cv::FONT_HERSHEY_DUPLEX, std::max(0.3, scale / 110), color,
                  std::max(1, static_cast<int>(scale / 60)), cv::LINE_AA);
    }
  }
  add_grain(random, image, 4);
  return image;
}

/// Crossing stripes of random widths: a chequered shirt.
inline cv::Mat plaid(cfp::Random& random, int size, const cv::Scalar& ground) {
  cv::Mat image(size, size, CV_8UC3, ground);
  for (int direction = 0; direction < 2; ++direction) {
    for (int at = 0; at < size;) {
      const int width = size / 64 + below(random, size / 20);
      cv::Mat stripe = direction == 0 ? image.colRange(at, std::min(size, at + width))
                                      : image.rowRange(at, std::min(size, at + width));
      const cv::Mat color(stripe.size(), CV_8UC3, random_color(random, 0, 255));
      cv::addWeighted(stripe, 0.45, color, 0.55, 0, stripe);
      at += width + size / 48 + below(random, size / 24);
    }
  }
  add_grain(random, image, 5);
  return image;
}

/// Blots in three tones: camouflage trousers.
inline cv::Mat blots(cfp::Random& random, int size, const cv::Scalar& ground) {
  cv::Mat image(size, size, CV_8UC3, ground);
  for (int i = 0; i < 700; ++i) {
    const cv::Scalar tone = ground * random.uniform(0.35, 1.7);
    const int y = below(random, size), x = below(random, size);
    const int high = 3 + below(random, size / 40), wide = 3 + below(random, size / 24);
    cv::ellipse(image, {x, y}, {wide, high}, random.uniform(0, 180), 0, 360, tone, cv::FILLED);
  }
  add_grain(random, image, 5);
  return image;
}

/// One colour with grain: denim, skin, plastic.
inline cv::Mat plain(cfp::Random& random, int size, const cv::Scalar& color, double grain) {
  cv::Mat image(size, size, CV_8UC3, color);
  add_grain(random, image, grain);
  return image;
}

/// A head unrolled: u is the angle around it (the face at u = 0.25), v runs from chin (0) to crown (1).
inline cv::Mat head(cfp::Random& random, int size, const cv::Scalar& skin, const cv::Scalar& hair) {
  cv::Mat image = plain(random, size, skin, 3);
  const auto at = [size](double u, double v) {
    return cv::Point(static_cast<int>(u * size), static_cast<int>(v * size));
  };
  cv::rectangle(image, at(0, 0.72), at(1, 1), hair, cv::FILLED);
  cv::rectangle(image, at(0.45, 0.35), at(1, 1), hair, cv::FILLED);
  cv::rectangle(image, at(0, 0.4), at(0.04, 1), hair, cv::FILLED);
  for (const double side : {-1.0, 1.0}) {
    cv::ellipse(image, at(0.25 + side * 0.065, 0.56), {size / 32, size / 60}, 0, 0, 360, {235, 235, 235}, cv::FILLED);
    cv::circle(image, at(0.25 + side * 0.065, 0.56), size / 70, {40, 30, 20}, cv::FILLED);
    cv::line(image, at(0.25 + side * 0.03, 0.62), at(0.25 + side * 0.11, 0.63), hair, size / 50);
  }
  cv::line(image, at(0.25, 0.55), at(0.255, 0.43), skin * 0.7, size / 50);
  cv::line(image, at(0.2, 0.34), at(0.3, 0.34), {70, 60, 140}, size / 40);
  for (int i = 0; i < 500; ++i) {
    const double y = random.uniform(0.3, 1), x = random.uniform();
    const cv::Point p = at(x, y);
    if (cv::norm(cv::Scalar(image.at<cv::Vec3b>(p)) - hair) < 40)
      cv::line(image, p, p + cv::Point(2, size / 24), hair * random.uniform(0.6, 1.8), 2);
  }
  return image;
}

}  // namespace synthetic
