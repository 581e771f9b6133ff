// Detectors without a network: none, a text file of another program's boxes, OpenCV's built-in people detector.
#pragma once

#include <algorithm>
#include <cmath>
#include <fstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/objdetect.hpp>

#include "../support/detections_file.hpp"
#include "detector_types.hpp"

namespace cfp_examples {

class NoDetector final : public Detector {
 public:
  NoDetector() : Detector("none", {}) {}
  Detections detect(const cv::Mat&, double) override { return {}; }
};

// The boxes of the file's frame that is nearest in time, none when it is further away than 5 ms: stamps written with
// fewer digits match, neighbouring images at up to 100 Hz do not.
class FileDetector final : public Detector {
 public:
  FileDetector(const std::string& file, const DetectorOptions& options) : Detector(file, {}), options_(options) {
    std::ifstream stream(file);
    DetectionsFile content = read_detections(stream, file);
    if (!content.error.empty()) throw std::runtime_error(content.error);
    classes_ = std::move(content.classes);
    frames_ = std::move(content.frames);
  }

  Detections detect(const cv::Mat& bgr, double time_s) override {
    Detections detections;
    const auto after = std::lower_bound(frames_.begin(), frames_.end(), time_s,
                                        [](const auto& f, double t) { return f.timestamp < t; });
    const auto distance = [&](const auto& frame) { return std::abs(frame.timestamp - time_s); };
    auto nearest = after;
    if (after != frames_.begin() && (after == frames_.end() || distance(after[-1]) <= distance(*after))) --nearest;
    if (nearest == frames_.end() || !(distance(*nearest) <= 0.005)) return detections;
    matched_ = true;
    for (const cfp::Detection<double>& d : nearest->detections) {
      const auto box = cfp::clip(d.box, double(bgr.cols), double(bgr.rows));
      const cfp::Box<float> rounded{float(box.x1), float(box.y1), float(box.x2), float(box.y2)};
      if (!cfp::is_proper(rounded) || !(options_.min_score <= 0 || d.score >= options_.min_score)) continue;
      detections.push_back({rounded, d.class_id, static_cast<float>(d.score)});
    }
    return detections;
  }

  [[nodiscard]] std::string complaint() const override {
    if (frames_.empty() || matched_) return Detector::complaint();
    return name_ + ": no image is within 5 ms of any of its " + std::to_string(frames_.size()) + " time stamps";
  }

 private:
  DetectorOptions options_;
  std::vector<DetectionFrame> frames_;
  bool matched_ = false;  // an image had one of the frames
};

// Histograms of oriented gradients with the linear support vector machine that OpenCV carries: upright, wholly visible
// people.
class HogDetector final : public Detector {
 public:
  explicit HogDetector(const DetectorOptions& options) : Detector("hog", {"person"}), options_(options) {
    hog_.setSVMDetector(cv::HOGDescriptor::getDefaultPeopleDetector());
  }

  Detections detect(const cv::Mat& bgr, double) override {
    Detections detections;
    if (bgr.cols < hog_.winSize.width || bgr.rows < hog_.winSize.height) return detections;
    std::vector<cv::Rect> found;
    std::vector<double> margins;
    try {
      cv::cvtColor(bgr, gray_, cv::COLOR_BGR2GRAY);
      hog_.detectMultiScale(gray_, found, margins, options_.min_score, {8, 8}, {8, 8}, 1.1, 2);
    } catch (const cv::Exception& error) {
      throw std::runtime_error("hog: " + error.err);
    }
    for (std::size_t i = 0; i < found.size(); ++i) {
      // The window it was trained with leaves a margin around the person.
      const auto w = static_cast<float>(found[i].width), h = static_cast<float>(found[i].height);
      const auto x = static_cast<float>(found[i].x) + 0.1F * w, y = static_cast<float>(found[i].y) + 0.07F * h;
      const cfp::Box<float> whole{x, y, x + 0.8F * w, y + 0.8F * h};
      const auto box = cfp::clip(whole, float(bgr.cols), float(bgr.rows));
      if (cfp::is_proper(box)) detections.push_back({box, 0, static_cast<float>(margins[i])});
    }
    return detections;
  }

 private:
  DetectorOptions options_;
  cv::HOGDescriptor hog_;
  cv::Mat gray_;
};

}  // namespace cfp_examples
