/// @file opencv_flow.hpp
/// Optical-flow pairs for the object stage by OpenCV's pyramidal Lucas-Kanade: corners, found at half resolution, carry
/// the camera's motion, and the host's own keypoints inside boxes the objects'. Pyramids are built once per image and
/// kept for the next one. Needs OpenCV's libraries imgproc and video. What the defaults cost and buy against the usual
/// way: benchmarks/studies/object_flow_study.cpp.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "cfp/core/options.hpp"
#include "cfp/core/span.hpp"
#include "cfp/geometry/box.hpp"
#include "cfp/geometry/flow_pairs.hpp"
#include "cfp/interop/opencv.hpp"

namespace cfp {

struct OpticalFlowOptions {
  int corners = 500;  ///< at most, over the whole image, found at half resolution: they carry the camera's motion; >= 0
  double corner_distance = 6;    ///< between two of them, px; >= 0
  double corner_quality = 0.01;  ///< least strength of a corner, as a share of the strongest one's; in (0, 1)
  double room_share = 0.6;       ///< of the corners, where `track` is told that the room is seen, if there are so many;
                                 ///< in [0, 1]
  int keypoints_per_box = 100;   ///< at most, besides, in each box, one per cell of a grid; >= 0
  int keypoints_outside = 0;     ///< at most, outside all boxes, likewise; >= 0
  int window = 11;               ///< side of the patch that is tracked, px; >= 3
  int levels = 4;                ///< of the pyramid, >= 1
  int iterations = 20;           ///< per level, >= 1
  double precision = 0.02;       ///< an update below this ends the iterations, px; >= 0
};

inline namespace CFP_ISA {

[[nodiscard]] constexpr OptionPath invalid_field(const OpticalFlowOptions& o) noexcept {
  if (o.corners < 0) return "corners";
  if (!detail::non_negative(o.corner_distance)) return "corner_distance";
  if (!(o.corner_quality > 0 && o.corner_quality < 1)) return "corner_quality";
  if (!(o.room_share >= 0 && o.room_share <= 1)) return "room_share";
  if (o.keypoints_per_box < 0) return "keypoints_per_box";
  if (o.keypoints_outside < 0) return "keypoints_outside";
  if (o.window < 3) return "window";
  if (o.levels < 1) return "levels";
  if (o.iterations < 1) return "iterations";
  if (!detail::non_negative(o.precision)) return "precision";
  return {};
}

/// One per camera. Not thread-safe.
class OpticalFlowTracker {
 public:
  /// Options outside their ranges are the caller's error: see `validate`.
  explicit OpticalFlowTracker(const OpticalFlowOptions& options = {}) : options_(options) {
    CFP_ASSERT(!invalid_field(options));
  }

  /// Makes the pairs between the image of the last call and this one (8-bit grey; none after the first call, or when
  /// the size has changed). keypoints and boxes are those of the previous image, which is where tracking starts;
  /// improper boxes hold nothing. room: 8-bit, 0 where the previous image shows what may move, people in boxes but not
  /// what is seen behind them; empty, or of another size than the image: unknown. Throws cv::Exception where an image
  /// is not 8-bit grey, and stays as it was.
  void track(const cv::Mat& gray, const std::vector<cv::KeyPoint>& keypoints, span<const Box<float>> boxes,
             const cv::Mat& room = {}) {
    CV_Assert(gray.empty() || gray.type() == CV_8UC1);
    std::swap(previous_pyramid_, pyramid_);
    const bool first = gray.empty() || previous_pyramid_.empty() || previous_pyramid_[0].size() != gray.size();
    from_.clear();
    to_.clear();
    if (gray.empty()) return reset();
    const cv::Size window(options_.window, options_.window);
    // A copy of the image (the last argument): the caller may overwrite it before the next call. Isolated: what lies
    // around a part of a larger image is not read.
    const int border = cv::BORDER_REFLECT_101 | cv::BORDER_ISOLATED;
    const int top = cv::buildOpticalFlowPyramid(gray, pyramid_, window, options_.levels - 1, true, border,
                                                cv::BORDER_CONSTANT, false);
    if (first) return;
    choose(keypoints, boxes, gray.size());
    find_corners(room);
    if (from_.empty()) return;

    const cv::TermCriteria stop(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, options_.iterations,
                                options_.precision);
    cv::calcOpticalFlowPyrLK(previous_pyramid_, pyramid_, from_, to_, found_, error_, window, top, stop);
    std::size_t kept = 0;
    for (std::size_t i = 0; i < from_.size(); ++i) {
      const cv::Point2f& to = to_[i];
      if (found_[i] == 0 || !(to.x >= 0 && to.y >= 0 && to.x < float(gray.cols) && to.y < float(gray.rows))) continue;
      from_[kept] = from_[i];
      to_[kept++] = to;
    }
    from_.resize(kept);
    to_.resize(kept);
  }

  /// Pixels of the pairs in the previous and in the current image; valid until the next call.
  [[nodiscard]] const std::vector<cv::Point2f>& previous() const { return from_; }
  [[nodiscard]] const std::vector<cv::Point2f>& current() const { return to_; }

  /// The same as views, for Frame::flow.
  [[nodiscard]] FlowPairs<float> pairs() const { return {view(from_), view(to_)}; }

  /// Forgets the last image: the next call makes no pairs.
  void reset() { pyramid_.clear(); }

 private:
  // The strongest keypoint of every cell; the cells of each box are at most as many as it may have points, and so for
  // the rest. A keypoint belongs to the first box that holds it.
  void choose(const std::vector<cv::KeyPoint>& keypoints, span<const Box<float>> boxes, cv::Size size) {
    const auto width = static_cast<float>(size.width), height = static_cast<float>(size.height);
    taken_.assign(keypoints.size(), 0);
    const auto add = [&](const Box<float>& box, int points) {
      int across = 0, down = 0;
      if (is_proper(box) && points > 0) {
        const float side = std::sqrt(box.width() * box.height() / static_cast<float>(points));
        across = std::clamp(static_cast<int>(box.width() / side), 1, points);
        down = std::clamp(static_cast<int>(box.height() / side), 1, points / across);
      }
      strongest_.assign(static_cast<std::size_t>(across * down), nullptr);
      for (std::size_t i = 0; i < keypoints.size(); ++i) {
        const cv::KeyPoint& k = keypoints[i];
        if (taken_[i] != 0 || !contains(box, k.pt.x, k.pt.y)) continue;
        taken_[i] = 1;
        if (across == 0) continue;
        const auto cell = [](float x, float length, int n) {
          return std::clamp(static_cast<int>(x / length * static_cast<float>(n)), 0, n - 1);
        };
        const int column = cell(k.pt.x - box.x1, box.width(), across), row = cell(k.pt.y - box.y1, box.height(), down);
        const cv::KeyPoint*& best = strongest_[static_cast<std::size_t>(row * across + column)];
        if (best == nullptr || k.response > best->response) best = &k;
      }
      for (const cv::KeyPoint* k : strongest_) {
        if (k != nullptr) from_.push_back(k->pt);
      }
    };
    for (const Box<float>& box : boxes) add(clip(box, width, height), options_.keypoints_per_box);
    add({0, 0, width, height}, options_.keypoints_outside);
  }

  // The strongest, of which the room has its share. Near people have many strong corners and the room around them few,
  // but it is these that tell the camera's motion.
  void find_corners(const cv::Mat& room) {
    if (options_.corners <= 0) return;
    const bool half = previous_pyramid_.size() > 2;  // images and derivatives take turns
    const float scale = half ? 2 : 1;
    const bool known = room.type() == CV_8U && room.size() == previous_pyramid_[0].size();
    cv::goodFeaturesToTrack(previous_pyramid_[half ? 2 : 0], corners_, known ? 0 : options_.corners,
                            options_.corner_quality, options_.corner_distance / double(scale));
    for (cv::Point2f& corner : corners_) corner *= scale;
    const auto is_room = [&](const cv::Point2f& corner) { return known && room.at<uchar>(cv::Point(corner)) != 0; };
    const auto in_room = std::count_if(corners_.begin(), corners_.end(), is_room);
    auto left = static_cast<std::ptrdiff_t>(options_.corners);
    auto for_others = left - std::min<std::ptrdiff_t>(std::lround(options_.room_share * options_.corners), in_room);
    for (const cv::Point2f& corner : corners_) {
      if (left == 0) break;
      if (!is_room(corner) && for_others-- <= 0) continue;
      from_.push_back(corner);
      --left;
    }
  }

  OpticalFlowOptions options_;
  std::vector<cv::Mat> previous_pyramid_, pyramid_;
  std::vector<char> taken_;
  std::vector<const cv::KeyPoint*> strongest_;
  std::vector<cv::Point2f> from_, to_, corners_;
  std::vector<unsigned char> found_;
  std::vector<float> error_;
};

}  // namespace CFP_ISA
}  // namespace cfp
