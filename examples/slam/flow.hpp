// Optical-flow pairs for the object stage: keypoints of the previous image, which the front end has anyway, tracked into the current
// one by pyramidal Lucas-Kanade. Pyramids are built once per image and kept for the next one. The defaults and what they cost and
// buy against the usual way (corners of their own, whole image): benchmarks/studies/object_flow_study.cpp.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/video/tracking.hpp>

#include "cfp/core/span.hpp"
#include "cfp/geometry/box.hpp"

namespace cfp_slam {

struct FlowOptions {
  int points_per_box = 150;  // at most, spread over the box; one per cell of a grid
  int points_outside = 250;  // at most, spread over the rest of the image: they support the camera's motion
  // In boxes: corners of their own, found at half resolution, as keypoints are scarce on plain clothes. false: keypoints.
  bool corners_in_boxes = true;
  bool corners_outside = false;
  double corner_quality = 0.01;  // least strength of a corner relative to the strongest of its box
  float corner_distance = 6;     // between corners, px
  int window = 15;               // side of the patch that is tracked, px
  int levels = 4;                // of the pyramid, >= 1
  int iterations = 20;           // per level
  double precision = 0.02;       // an update below this ends the iterations, px
  bool backward = true;          // track back as well ...
  float max_backward_px = 0.5F;  // ... and drop what does not return to where it came from
};

class FlowTracker {
 public:
  explicit FlowTracker(const FlowOptions& options = {}) : options_(options) {}

  // Makes the pairs between the image of the last call and this one (8-bit grey; none after the first call, or when the size
  // has changed). keypoints and boxes are those of the previous image, which is where tracking starts; improper boxes hold nothing.
  void track(const cv::Mat& gray, const std::vector<cv::KeyPoint>& keypoints, cfp::span<const cfp::Box<float>> boxes) {
    std::swap(previous_pyramid_, pyramid_);
    const bool first = gray.empty() || previous_pyramid_.empty() || previous_pyramid_[0].size() != gray.size();
    pyramid_.clear();
    from_.clear();
    to_.clear();
    const cv::Size window(options_.window, options_.window);
    if (gray.empty()) return;
    const int top = cv::buildOpticalFlowPyramid(gray, pyramid_, window, options_.levels - 1, true);
    if (first) return;
    choose(keypoints, boxes, gray.size());
    if (from_.empty()) return;

    const cv::TermCriteria stop(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, options_.iterations, options_.precision);
    cv::calcOpticalFlowPyrLK(previous_pyramid_, pyramid_, from_, to_, found_, error_, window, top, stop);
    keep([&](std::size_t i) {
      return found_[i] != 0 && to_[i].x >= 0 && to_[i].y >= 0 && to_[i].x < float(gray.cols) && to_[i].y < float(gray.rows);
    });
    if (!options_.backward || from_.empty()) return;
    cv::calcOpticalFlowPyrLK(pyramid_, previous_pyramid_, to_, back_, found_, error_, window, top, stop);
    keep([&](std::size_t i) {
      return found_[i] != 0 && std::hypot(back_[i].x - from_[i].x, back_[i].y - from_[i].y) <= options_.max_backward_px;
    });
  }

  // Pixels of the pairs in the previous and in the current image; valid until the next call.
  [[nodiscard]] const std::vector<cv::Point2f>& previous() const { return from_; }
  [[nodiscard]] const std::vector<cv::Point2f>& current() const { return to_; }

  // Forgets the last image: the next call makes no pairs.
  void reset() { pyramid_.clear(); }

 private:
  // The strongest keypoint of every cell; the cells of each box are as many as it may have points, and so for the rest.
  void choose(const std::vector<cv::KeyPoint>& keypoints, cfp::span<const cfp::Box<float>> boxes, cv::Size size) {
    const auto width = static_cast<float>(size.width), height = static_cast<float>(size.height);
    regions_.clear();
    std::size_t cells = 0;
    const auto add = [&](const cfp::Box<float>& box, int points) {
      Region region{box, 0, 0, cells};
      if (cfp::is_proper(box) && points > 0) {
        const float side = std::sqrt(box.width() * box.height() / static_cast<float>(points));
        region.across = std::clamp(static_cast<int>(box.width() / side), 1, points);
        region.down = std::clamp(static_cast<int>(box.height() / side), 1, points / region.across);
      }
      cells += static_cast<std::size_t>(region.across * region.down);
      regions_.push_back(region);
    };
    for (const cfp::Box<float>& box : boxes) add(cfp::clip(box, width, height), options_.points_per_box);
    add({0, 0, width, height}, options_.points_outside);

    strongest_.assign(cells, nullptr);
    for (const cv::KeyPoint& k : keypoints) {
      const auto region =
          std::find_if(regions_.begin(), regions_.end(), [&](const Region& r) { return cfp::contains(r.box, k.pt.x, k.pt.y); });
      if (region == regions_.end() || region->across == 0) continue;
      if (region + 1 == regions_.end() ? options_.corners_outside : options_.corners_in_boxes) continue;
      const auto cell = [](float x, float length, int n) {
        return static_cast<std::size_t>(std::clamp(static_cast<int>(x / length * static_cast<float>(n)), 0, n - 1));
      };
      const std::size_t column = cell(k.pt.x - region->box.x1, region->box.width(), region->across);
      const std::size_t row = cell(k.pt.y - region->box.y1, region->box.height(), region->down);
      const cv::KeyPoint*& best = strongest_[region->first + row * static_cast<std::size_t>(region->across) + column];
      if (best == nullptr || k.response > best->response) best = &k;
    }
    for (const cv::KeyPoint* k : strongest_) {
      if (k != nullptr) from_.push_back(k->pt);
    }
    for (std::size_t r = 0; r < regions_.size(); ++r) {
      const bool outside = r + 1 == regions_.size();
      if (outside ? !options_.corners_outside : !options_.corners_in_boxes) continue;
      const int points = outside ? options_.points_outside : options_.points_per_box;
      const cv::Mat& half = previous_pyramid_[2];
      const cfp::Box<float>& b = regions_[r].box;
      const cv::Rect part =
          cv::Rect(cv::Point(int(b.x1 / 2), int(b.y1 / 2)), cv::Point(int(b.x2 / 2), int(b.y2 / 2))) & cv::Rect({0, 0}, half.size());
      if (part.width < 8 || part.height < 8) continue;
      cv::goodFeaturesToTrack(half(part), corners_, points, options_.corner_quality, double(options_.corner_distance) / 2);
      for (const cv::Point2f& c : corners_) from_.push_back({2 * (c.x + float(part.x)), 2 * (c.y + float(part.y))});
    }
  }

  template <typename Good>
  void keep(const Good& good) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < from_.size(); ++i) {
      if (!good(i)) continue;
      from_[kept] = from_[i];
      to_[kept++] = to_[i];
    }
    from_.resize(kept);
    to_.resize(kept);
  }

  struct Region {
    cfp::Box<float> box;
    int across, down;   // cells
    std::size_t first;  // cell
  };

  FlowOptions options_;
  std::vector<cv::Mat> previous_pyramid_, pyramid_;
  std::vector<Region> regions_;
  std::vector<const cv::KeyPoint*> strongest_;
  std::vector<cv::Point2f> from_, to_, back_, corners_;
  std::vector<unsigned char> found_;
  std::vector<float> error_;
};

}  // namespace cfp_slam
