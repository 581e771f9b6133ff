// ORB keypoints spread over the image. OpenCV's detector keeps the strongest corners of the whole image, which crowd on
// a few textured things (often the people's clothes); here every cell of every level of the pyramid gives its best
// corners in turn, where a cell has fewer than its share the threshold falls, and most go to the room.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

namespace cfp_examples {

using OrbDescriptor = std::array<std::uint8_t, 32>;

struct FeatureOptions {
  int count = 1000;           // keypoints kept
  int levels = 8;             // of the image pyramid
  float scale_factor = 1.2F;  // between them
  int fast_threshold = 12;    // grey levels, and
  int lowest_threshold = 5;   // in cells where that finds too little
  int cell = 40;              // pixels, at the level's own scale
  double room_share = 0.6;    // of the keypoints, where the mask says room, if there are so many
};

// Standard deviation of a keypoint's position in pixels, per level: the corner is found on that level's grid.
inline std::vector<float> level_sigmas(const FeatureOptions& options) {
  std::vector<float> sigmas(static_cast<std::size_t>(options.levels), 1.0F);
  for (std::size_t i = 1; i < sigmas.size(); ++i) sigmas[i] = sigmas[i - 1] * options.scale_factor;
  return sigmas;
}

class FeatureExtractor {
 public:
  explicit FeatureExtractor(const FeatureOptions& options = {})
      : options_(options), orb_(cv::ORB::create(options.count, options.scale_factor, 1, edge)) {
    for (const float scale : level_sigmas(options)) levels_.push_back({int(levels_.size()), double(scale)});
  }

  // room: 8-bit, of the image's size, 0 where people may be (room_mask); empty: nowhere.
  void operator()(const cv::Mat& gray, const cv::Mat& room, std::vector<cv::KeyPoint>& keypoints,
                  std::vector<OrbDescriptor>& descriptors) {
    keypoints.clear();
    descriptors.clear();
    double shares = 0, corners = 0;
    for (const Level& level : levels_) shares += 1 / level.scale;
    for (std::size_t i = 0; i < levels_.size(); ++i) {
      Level& level = levels_[i];
      const cv::Size size(cvRound(gray.cols / level.scale), cvRound(gray.rows / level.scale));
      if (i == 0) level.image = gray;
      if (i > 0) cv::resize(levels_[i - 1].image, level.image, size, 0, 0, cv::INTER_LINEAR_EXACT);
      const double share = options_.count / level.scale / shares;  // as its side
      detect(level, share);
      level.weight = std::min(double(level.corners.size()), choice * share);
      corners += level.weight;
    }
    double wanted = 0, of_room = 0;  // what a level lacks the next one gives
    for (Level& level : levels_) {
      const double share = level.weight * std::min(1.0, options_.count / corners);
      wanted += share;
      of_room += options_.room_share * share;
      of_room -= double(select(level, room, wanted, of_room));
      wanted -= double(selected_.size());
      describe(level, keypoints, descriptors);
    }
  }

 private:
  static constexpr int choice = 3;              // corners to choose a keypoint from, if a level has so many
  static constexpr int edge = 19, radius = 15;  // px: of the image, without keypoints; of a keypoint's patch

  struct Level {
    int octave = 0;
    double scale = 1, weight = 0;
    cv::Mat image = {};
    std::vector<cv::KeyPoint> corners = {};
  };

  [[nodiscard]] std::size_t cell_of(const cv::Point2f& p) const {
    return static_cast<std::size_t>(int(p.y) / options_.cell * columns_ + int(p.x) / options_.cell);
  }

  void empty_cells(const cv::Mat& image) {
    columns_ = image.cols / options_.cell + 1;
    in_cell_.assign(static_cast<std::size_t>(columns_ * (image.rows / options_.cell + 1)), 0);
  }

  void detect(Level& level, double wanted) {
    const cv::Mat& image = level.image;
    level.corners.clear();
    empty_cells(image);
    const cv::Rect inside(edge, edge, image.cols - 2 * edge, image.rows - 2 * edge);
    if (inside.width <= 0 || inside.height <= 0) return;
    find(level, inside, options_.fast_threshold, 256);
    for (const cv::KeyPoint& k : level.corners) ++in_cell_[cell_of(k.pt)];
    const double per_pixel = wanted / inside.area();
    for (int y = 0; y < image.rows; y += options_.cell) {
      for (int x = 0; x < image.cols; x += options_.cell) {
        const cv::Rect cell = cv::Rect(x, y, options_.cell, options_.cell) & inside;
        if (in_cell_[cell_of(cell.tl())] < per_pixel * cell.area())
          find(level, cell, options_.lowest_threshold, options_.fast_threshold);
      }
    }
  }

  // Adds the corners of an area that reach the threshold and not `below`.
  void find(Level& level, const cv::Rect& area, int threshold, int below) {
    const cv::Point margin(3, 3);  // in which FAST finds nothing
    cv::FAST(level.image(cv::Rect(area.tl() - margin, area.br() + margin)), found_, threshold);
    for (cv::KeyPoint& k : found_) {
      if (k.response >= float(below)) continue;
      k.pt += cv::Point2f(area.tl() - margin);
      level.corners.push_back(k);
    }
  }

  // The best corner of each cell, then the second best of each, and so on; people get what the room leaves. Returns how
  // many the room got.
  std::ptrdiff_t select(Level& level, const cv::Mat& room, double wanted, double of_room) {
    std::vector<cv::KeyPoint>& corners = level.corners;
    const auto scale = static_cast<float>(level.scale);
    const auto is_room = [&](const cv::KeyPoint& k) {
      return room.empty() || room.at<unsigned char>(cv::Point(k.pt * scale)) != 0;
    };
    std::stable_sort(corners.begin(), corners.end(),
                     [](const cv::KeyPoint& a, const cv::KeyPoint& b) { return a.response > b.response; });
    empty_cells(level.image);
    for (auto& round : rounds_) round.clear();
    for (const cv::KeyPoint& k : corners) {
      const auto round = static_cast<std::size_t>(in_cell_[cell_of(k.pt)]++);
      if (round == rounds_.size()) rounds_.emplace_back();
      rounds_[round].push_back(k);
    }
    const auto total = static_cast<std::size_t>(std::lround(std::min(wanted, double(corners.size()))));
    const auto in_room = double(std::count_if(corners.begin(), corners.end(), is_room));
    auto for_people = std::lround(double(total) - std::clamp(of_room, 0.0, std::min(in_room, double(total))));
    std::ptrdiff_t chosen_of_room = 0;
    selected_.clear();
    for (const auto& round : rounds_) {
      for (const cv::KeyPoint& k : round) {
        if (selected_.size() == total) return chosen_of_room;
        const bool of_people = !is_room(k);
        if (of_people && for_people-- <= 0) continue;
        selected_.push_back(k);
        chosen_of_room += of_people ? 0 : 1;
      }
    }
    return chosen_of_room;
  }

  void describe(const Level& level, std::vector<cv::KeyPoint>& keypoints, std::vector<OrbDescriptor>& descriptors) {
    for (cv::KeyPoint& k : selected_) k.angle = angle(level.image, k.pt);
    cv::Mat rows;
    orb_->compute(level.image, selected_, rows);
    for (int i = 0; i < rows.rows; ++i) {
      cv::KeyPoint& k = keypoints.emplace_back(selected_[static_cast<std::size_t>(i)]);
      k.pt *= level.scale;
      k.size = static_cast<float>((2 * radius + 1) * level.scale);
      k.octave = level.octave;
      std::memcpy(descriptors.emplace_back().data(), rows.ptr(i), sizeof(OrbDescriptor));
    }
  }

  // Towards the centre of intensity of the round patch, which cv::ORB computes only for keypoints of its own.
  static float angle(const cv::Mat& image, const cv::Point& at) {
    int x_sum = 0, y_sum = 0;
    for (int y = -radius; y <= radius; ++y) {
      const auto* row = image.ptr(at.y + y) + at.x;
      const int half_width = half_widths[static_cast<std::size_t>(std::abs(y))];
      int sum = 0;
      for (int x = -half_width; x <= half_width; ++x) {
        sum += row[x];
        x_sum += x * row[x];
      }
      y_sum += y * sum;
    }
    return cv::fastAtan2(float(y_sum), float(x_sum));
  }
  static constexpr std::array<int, radius + 1> half_widths = {15, 15, 15, 15, 14, 14, 14, 13,
                                                              13, 12, 11, 10, 9,  8,  6,  3};

  FeatureOptions options_;
  cv::Ptr<cv::ORB> orb_;  // of one level: the pyramid is ours
  std::vector<Level> levels_;
  int columns_ = 0;           // of cells, at this level
  std::vector<int> in_cell_;  // corners, so far
  std::vector<cv::KeyPoint> found_, selected_;
  std::vector<std::vector<cv::KeyPoint>> rounds_;
};

}  // namespace cfp_examples
