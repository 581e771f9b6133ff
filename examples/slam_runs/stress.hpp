// What goes wrong in reality, made of any recording: frames that never come, images that show nothing, detections that
// are silent, late, stuck or absurd. The disturbance begins after a third of the recording and ends before its last
// frames, so that a run shows what it does to the poses, and whether they come back.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "../detection/detector_types.hpp"
#include "../slam/loop/run.hpp"
#include "cfp/core/random.hpp"

namespace cfp_slam {

using cfp_examples::Detections;
using cfp_examples::SequenceFrame;

// Frames [first, last) of the recording are disturbed. What is empty leaves things as they are.
struct Stress {
  std::string name;
  std::size_t first = 0, last = 0;
  std::function<bool(std::size_t frame)> dropped;  // these frames never come
  std::function<void(std::size_t frame, SequenceFrame&)> image;
  // `seen`: what the detector found in each frame so far, this one included, which is what it is to say instead.
  std::function<Detections(std::size_t frame, const std::vector<Detections>& seen)> detections;

  [[nodiscard]] bool holds(std::size_t frame) const { return frame >= first && frame < last; }
};

namespace detail {

inline void each_image(SequenceFrame& frame, const std::function<void(cv::Mat&)>& change) {
  for (cv::Mat* image : {&frame.bgr, &frame.depth}) {
    if (image->empty()) continue;
    cv::Mat copy = image->clone();
    change(copy);
    *image = copy;
  }
}

// A board with a pattern of its own, 1.1 m away, crosses the view from left to right; no detector knows it.
inline void carry_board(double progress, double width_share, double metres, double units, SequenceFrame& frame) {
  const int width = static_cast<int>(width_share * frame.bgr.cols);
  const int left = static_cast<int>(progress * (frame.bgr.cols + width)) - width;
  const cv::Rect board = cv::Rect(left, 0, width, frame.bgr.rows) & cv::Rect({0, 0}, frame.bgr.size());
  if (board.empty() || frame.depth.empty()) return;
  frame.bgr = frame.bgr.clone();
  frame.depth = frame.depth.clone();
  for (int y = 0; y < board.height; ++y) {
    for (int x = board.x; x < board.x + board.width; ++x) {
      const unsigned cell_x = static_cast<unsigned>((x - left) / 9), cell_y = static_cast<unsigned>(y / 9);
      const auto grey = static_cast<unsigned char>(40 + ((cell_x * 2654435761U) ^ (cell_y * 2246822519U)) % 170U);
      frame.bgr.at<cv::Vec3b>(y, x) = {grey, grey, grey};
    }
  }
  frame.depth(board).setTo(metres * units);
}

inline cfp::Detection<float> box_of(double x1, double y1, double x2, double y2) {
  return {{float(x1), float(y1), float(x2), float(y2)}, 0, 0.9F};
}

}  // namespace detail

// All that the recording is long enough for.
inline std::vector<Stress> stresses(std::size_t frames, double rate_hz, const cfp_examples::TumCamera& camera) {
  const std::size_t first = frames / 3;
  std::vector<Stress> all{{"none", 0, 0, {}, {}, {}}};
  const auto add = [&](const char* name, double length, auto member, auto change) {
    Stress stress;
    stress.name = name;
    stress.first = first;
    stress.last = first + static_cast<std::size_t>(std::lround(length));
    stress.*member = change;
    if (stress.last + 20 <= frames) all.push_back(std::move(stress));
  };
  const auto drop = [&](const char* name, double length, std::size_t keep_each) {
    add(name, length, &Stress::dropped,
        [=](std::size_t k) { return k >= first && (keep_each == 0 || (k - first) % keep_each != 0); });
  };
  const double rest = static_cast<double>(frames - first) - 20;
  drop("gap of 1 s", rate_hz, 0);
  drop("gap of 2 s", 2 * rate_hz, 0);
  drop("gap of 3 s", 3 * rate_hz, 0);
  drop("every 3rd frame", rest, 3);
  drop("every 6th frame", rest, 6);

  add("turned by 180 degrees", 10, &Stress::image,
      [](std::size_t, SequenceFrame& f) { detail::each_image(f, [](cv::Mat& image) { cv::flip(image, image, -1); }); });
  add("covered", 10, &Stress::image, [](std::size_t, SequenceFrame& f) {
    detail::each_image(f, [](cv::Mat& image) { image.setTo(cv::Scalar::all(image.channels() == 3 ? 60 : 0)); });
  });
  // The camera sees the left half of everything, then for two seconds the right half, of which no map knows, then all.
  add("halves", 2 * rate_hz, &Stress::image, [first](std::size_t k, SequenceFrame& f) {
    detail::each_image(f, [&](cv::Mat& image) {
      const cv::Rect hidden(k < first ? image.cols / 2 : 0, 0, image.cols / 2, image.rows);
      image(hidden).setTo(cv::Scalar::all(image.channels() == 3 ? 60 : 0));
    });
  });
  if (all.back().name == "halves") all.back().first = 0;
  add("motion blur", 12, &Stress::image, [](std::size_t, SequenceFrame& f) {
    cv::Mat blurred;
    cv::blur(f.bgr, blurred, {31, 3});
    f.bgr = blurred;
  });
  add("dark", 30, &Stress::image, [](std::size_t, SequenceFrame& f) { f.bgr = f.bgr * 0.12; });
  add("overexposed", 30, &Stress::image, [](std::size_t, SequenceFrame& f) { f.bgr = f.bgr * 2.2; });
  add("no depth", 15, &Stress::image, [](std::size_t, SequenceFrame& f) { f.depth = f.depth * 0; });
  add("depth holes", 45, &Stress::image, [](std::size_t k, SequenceFrame& f) {
    f.depth = f.depth.clone();
    cfp::Random random(k + 1, "depth holes");
    for (int hole = 0; hole < 60; ++hole) {
      const auto at = [&](int size) { return static_cast<int>(random() % static_cast<std::uint64_t>(size)); };
      cv::circle(f.depth, {at(f.depth.cols), at(f.depth.rows)}, f.depth.cols / 12, cv::Scalar::all(0), cv::FILLED);
    }
  });
  const auto carry = [&](const char* name, double share, double length) {
    add(name, length, &Stress::image, [=, units = camera.depth_units_per_metre](std::size_t k, SequenceFrame& f) {
      detail::carry_board(static_cast<double>(k - first) / length, share, 1.1, units, f);
    });
  };
  carry("board over 40 %", 0.4, 60);
  carry("board over 70 %", 0.7, 60);
  carry("board over all, slowly", 1, 120);

  const auto detections = [&](const char* name, double length, auto change) {
    add(name, length, &Stress::detections, change);
  };
  detections("detector silent", 30, [](std::size_t, const std::vector<Detections>&) { return Detections{}; });
  detections("detector late", 30, [](std::size_t, const std::vector<Detections>& seen) {
    return seen[seen.size() - std::min<std::size_t>(seen.size(), 6)];
  });
  detections("detector stuck", 30, [first](std::size_t k, const std::vector<Detections>& seen) {
    return seen[seen.size() - std::min(seen.size(), k - first + 2)];
  });
  const double w = camera.width, h = camera.height;
  detections("boxes of nothing", 20, [=](std::size_t, const std::vector<Detections>& seen) {
    Detections boxes = seen.back();
    boxes.push_back(detail::box_of(0.05 * w, 0.1 * h, 0.5 * w, 0.95 * h));
    boxes.push_back(detail::box_of(0.55 * w, 0.1 * h, 0.95 * w, 0.95 * h));
    return boxes;
  });
  detections("absurd boxes", 20, [=](std::size_t, const std::vector<Detections>&) {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    return Detections{detail::box_of(0, 0, w, h), detail::box_of(nan, 0, w, h), detail::box_of(w, h, 0, 0)};
  });
  return all;
}

// The recording's first frames under a stress. Recording and stress must stay.
inline FrameSource stressed(const cfp_examples::Sequence& sequence, const Stress& stress, std::size_t frames) {
  FrameSource source(sequence);
  std::vector<std::size_t> kept;
  for (std::size_t k = 0; k < std::min(frames, sequence.size()); ++k) {
    if (!(stress.holds(k) && stress.dropped && stress.dropped(k))) kept.push_back(k);
  }
  source.size = kept.size();
  source.load = [&sequence, &stress, kept = std::move(kept)](std::size_t i) {
    SequenceFrame frame = sequence.load(kept[i]);
    if (frame.usable && stress.image && stress.holds(kept[i])) stress.image(kept[i], frame);
    return frame;
  };
  return source;
}

// A detector under a stress; frames come in the order of time.
class StressedDetector final : public cfp_examples::Detector {
 public:
  StressedDetector(cfp_examples::Detector& detector, const cfp_examples::Sequence& sequence, const Stress& stress)
      : Detector(detector.name(), detector.classes()), detector_(detector), sequence_(sequence), stress_(stress) {}

  Detections detect(const cv::Mat& bgr, double time_s) override {
    while (frame_ + 1 < sequence_.size() && sequence_.time_s(frame_) < time_s) ++frame_;
    seen_.push_back(detector_.detect(bgr, time_s));
    return stress_.detections && stress_.holds(frame_) ? stress_.detections(frame_, seen_) : seen_.back();
  }

 private:
  cfp_examples::Detector& detector_;
  const cfp_examples::Sequence& sequence_;
  const Stress& stress_;
  std::size_t frame_ = 0;
  std::vector<Detections> seen_;
};

}  // namespace cfp_slam
