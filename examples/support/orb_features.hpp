// ORB keypoints spread over the image. OpenCV's detector keeps the strongest corners of the whole image, which crowd on
// a few textured things (often the people's clothes); here every cell of the image gives its best corners in turn,
// most of them go to what is outside of all boxes, and where few are found the threshold falls.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include <opencv2/features2d.hpp>

#include "cfp/geometry/box.hpp"

namespace cfp_examples {

using OrbDescriptor = std::array<std::uint64_t, 4>;  // 256 bits

struct FeatureOptions {
  int count = 1000;           // keypoints kept
  int candidates = 3000;      // corners to choose from
  int levels = 8;             // of the image pyramid
  float scale_factor = 1.2F;  // between them
  int fast_threshold = 12;    // grey levels, and
  int lowest_threshold = 3;   // where that finds too little
  int cell = 40;              // pixels, at the level's own scale
  double room_share = 0.6;    // of the keypoints, outside of the boxes, if there are so many
};

class FeatureExtractor {
 public:
  explicit FeatureExtractor(const FeatureOptions& options = {})
      : options_(options),
        orb_(cv::ORB::create(options.candidates, options.scale_factor, options.levels, 19, 0, 2, cv::ORB::HARRIS_SCORE,
                             31, options.fast_threshold)),
        levels_(static_cast<std::size_t>(options.levels)) {}

  // boxes: where people may be.
  void operator()(const cv::Mat& gray, const std::vector<cfp::Box<float>>& boxes, std::vector<cv::KeyPoint>& keypoints,
                  std::vector<OrbDescriptor>& descriptors) {
    int threshold = options_.fast_threshold;
    do {
      orb_->setFastThreshold(threshold);
      orb_->detect(gray, candidates_);
      threshold /= 2;
    } while (candidates_.size() < static_cast<std::size_t>(options_.count) && threshold >= options_.lowest_threshold);
    select(gray.cols, gray.rows, boxes, keypoints);
    cv::Mat rows;
    orb_->compute(gray, keypoints, rows);
    descriptors.resize(keypoints.size());
    for (std::size_t i = 0; i < keypoints.size(); ++i)
      std::memcpy(descriptors[i].data(), rows.ptr(static_cast<int>(i)), sizeof(OrbDescriptor));
  }

 private:
  using Candidates = std::vector<cv::KeyPoint>::const_iterator;

  // Where people would take more than is left by the room's share, the room takes that first.
  void select(int width, int height, const std::vector<cfp::Box<float>>& boxes, std::vector<cv::KeyPoint>& keypoints) {
    const auto is_room = [&](const cv::KeyPoint& k) {
      return std::none_of(boxes.begin(), boxes.end(), [&](const auto& b) { return cfp::contains(b, k.pt.x, k.pt.y); });
    };
    const auto room_end = std::stable_partition(candidates_.begin(), candidates_.end(), is_room);
    const double wanted = std::min(double(candidates_.size()), double(options_.count));
    const double of_room = std::min(double(room_end - candidates_.begin()), options_.room_share * wanted);
    keypoints.clear();
    select(candidates_.begin(), candidates_.end(), wanted, width, height, keypoints);
    if (double(std::count_if(keypoints.begin(), keypoints.end(), is_room)) >= of_room) return;
    keypoints.clear();
    select(candidates_.begin(), room_end, of_room, width, height, keypoints);
    select(room_end, candidates_.end(), wanted - of_room, width, height, keypoints);
  }

  // The same share of every level's corners; within a level the best of each cell, then the second best of each, and so
  // on.
  void select(Candidates first, Candidates last, double wanted, int width, int height,
              std::vector<cv::KeyPoint>& keypoints) {
    for (auto& level : levels_) level.clear();
    for (auto k = first; k != last; ++k)
      levels_[static_cast<std::size_t>(std::clamp(k->octave, 0, options_.levels - 1))].push_back(*k);
    const double share = wanted / std::max(double(last - first), 1.0);
    float cell = static_cast<float>(options_.cell);
    for (auto& level : levels_) {
      spread(level, cell, width, height, static_cast<std::size_t>(std::lround(share * double(level.size()))),
             keypoints);
      cell *= options_.scale_factor;
    }
  }

  void spread(std::vector<cv::KeyPoint>& level, float cell, int width, int height, std::size_t wanted,
              std::vector<cv::KeyPoint>& keypoints) {
    if (wanted >= level.size()) {
      keypoints.insert(keypoints.end(), level.begin(), level.end());
      return;
    }
    const int columns = static_cast<int>(float(width) / cell) + 1, rows = static_cast<int>(float(height) / cell) + 1;
    std::sort(level.begin(), level.end(), [](const cv::KeyPoint& a, const cv::KeyPoint& b) {
      return a.response != b.response ? a.response > b.response
                                      : (a.pt.y != b.pt.y ? a.pt.y < b.pt.y : a.pt.x < b.pt.x);
    });
    in_cell_.assign(static_cast<std::size_t>(columns * rows), 0);
    rank_.clear();
    for (std::size_t i = 0; i < level.size(); ++i) {
      const int x = std::clamp(static_cast<int>(level[i].pt.x / cell), 0, columns - 1),
                y = std::clamp(static_cast<int>(level[i].pt.y / cell), 0, rows - 1);
      rank_.push_back({in_cell_[static_cast<std::size_t>(y * columns + x)]++, i});
    }
    std::sort(rank_.begin(), rank_.end());
    for (std::size_t i = 0; i < wanted; ++i) keypoints.push_back(level[rank_[i].second]);
  }

  FeatureOptions options_;
  cv::Ptr<cv::ORB> orb_;
  std::vector<cv::KeyPoint> candidates_;
  std::vector<std::vector<cv::KeyPoint>> levels_;
  std::vector<int> in_cell_;
  std::vector<std::pair<int, std::size_t>> rank_;  // (place in its cell, index)
};

// Standard deviation of a keypoint's position in pixels, per level: the corner is found on that level's grid.
inline std::vector<float> level_sigmas(const FeatureOptions& options) {
  std::vector<float> sigmas(static_cast<std::size_t>(options.levels), 1.0F);
  for (std::size_t i = 1; i < sigmas.size(); ++i) sigmas[i] = sigmas[i - 1] * options.scale_factor;
  return sigmas;
}

}  // namespace cfp_examples
