// What the tracking loop knows of an object detector. Every detector here may be called from a thread of its own: it
// holds no global state and touches the image only during the call. One object serves one caller at a time.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>

#include "cfp/detection/box_tracker_types.hpp"

namespace cfp_examples {

using Detections = std::vector<cfp::Detection<float>>;

class Detector {
 public:
  virtual ~Detector() = default;

  // The boxes of an 8-bit BGR image taken at time_s: finite, x1 < x2, y1 < y2, clipped to the image, class_id an index
  // into classes(). Throws std::runtime_error that names the detector and what is wrong.
  virtual Detections detect(const cv::Mat& bgr, double time_s) = 0;

  // What is wrong when none of its boxes was of use so far; else empty.
  [[nodiscard]] virtual std::string complaint() const {
    if (classes_.empty() || class_of("person") >= 0) return {};
    return name_ + ": no class 'person': nothing that it finds can move";
  }

  [[nodiscard]] const std::vector<std::string>& classes() const { return classes_; }
  [[nodiscard]] const std::string& name() const { return name_; }

  // Index of a class name; -1: this detector does not know it.
  [[nodiscard]] int class_of(const std::string& class_name) const {
    for (std::size_t id = 0; id < classes_.size(); ++id) {
      if (classes_[id] == class_name) return static_cast<int>(id);
    }
    return -1;
  }

 protected:
  Detector(std::string name, std::vector<std::string> classes) : name_(std::move(name)), classes_(std::move(classes)) {}
  Detector(const Detector&) = default;
  Detector& operator=(const Detector&) = default;

  std::string name_;
  std::vector<std::string> classes_;
};

struct DetectorOptions {
  double min_score = 0;      // 0: the detector's own default
  double max_overlap = 0.5;  // of two boxes of a class with a larger IoU the surer one stays
};

}  // namespace cfp_examples
