// A detection network (ONNX) through OpenCV's dnn module, its family told from its outputs (network_outputs.hpp).
#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/dnn.hpp>
#include <opencv2/imgproc.hpp>

#include "coco_names.hpp"
#include "detector_types.hpp"
#include "network_outputs.hpp"

namespace cfp_examples {

// input.x = scale_x * image.x + left, and so for y.
struct InputMapping {
  float scale_x = 1, scale_y = 1, left = 0, top = 0;
  [[nodiscard]] cfp::Box<float> to_image(const cfp::Box<float>& b) const {
    return {(b.x1 - left) / scale_x, (b.y1 - top) / scale_y, (b.x2 - left) / scale_x, (b.y2 - top) / scale_y};
  }
};

// The image at the network's size: stretched, or at its own aspect ratio in the middle of a grey frame, as the families
// are trained.
inline InputMapping fit_image(const cv::Mat& bgr, cv::Size input, bool keep_aspect, cv::Mat& fitted) {
  const double scale_x = double(input.width) / bgr.cols, scale_y = double(input.height) / bgr.rows;
  if (!keep_aspect) {
    cv::resize(bgr, fitted, input, 0, 0, cv::INTER_LINEAR);
    return {float(scale_x), float(scale_y), 0, 0};
  }
  const double scale = (std::min)(scale_x, scale_y);
  const int width = std::clamp(int(std::lround(scale * bgr.cols)), 1, input.width);
  const int height = std::clamp(int(std::lround(scale * bgr.rows)), 1, input.height);
  const int left = (input.width - width) / 2, top = (input.height - height) / 2;
  fitted.create(input, bgr.type());
  fitted.setTo(cv::Scalar::all(114));
  cv::Mat inner = fitted(cv::Rect(left, top, width, height));
  cv::resize(bgr, inner, inner.size(), 0, 0, cv::INTER_LINEAR);
  return {float(width) / float(bgr.cols), float(height) / float(bgr.rows), float(left), float(top)};
}

// Class names: FILE.names beside the model, else COCO's for 80 classes and "person" for one.
inline std::vector<std::string> network_classes(const std::filesystem::path& model, int count) {
  const std::filesystem::path file = std::filesystem::path(model).replace_extension(".names");
  if (std::ifstream stream(file); stream) {
    std::vector<std::string> names;
    for (std::string line; std::getline(stream, line);) {
      if (!line.empty() && line.back() == '\r') line.pop_back();
      if (!line.empty()) names.push_back(line);
    }
    if (names.size() == static_cast<std::size_t>(count)) return names;
    throw std::runtime_error(file.string() + ": " + std::to_string(names.size()) + " names for the network's " +
                             std::to_string(count) + " classes");
  }
  if (count == 1) return {"person"};
  if (static_cast<std::size_t>(count) == std::size(coco_names)) return {std::begin(coco_names), std::end(coco_names)};
  throw std::runtime_error(model.string() + ": " + std::to_string(count) + " classes; name them, one per line, in " +
                           file.string());
}

// The network runs on the threads of cv::setNumThreads, a setting of the whole process. Beside a thread that extracts
// features leave that at its default: OpenCV shares one pool among its callers. cv::setNumThreads(1) keeps the network
// in its caller's thread.
class NetworkDetector final : public Detector {
 public:
  NetworkDetector(const std::filesystem::path& model, cv::Size input, const DetectorOptions& options)
      : Detector(model.filename().string(), {}), input_(input), options_(options) {
    const std::string file = model.string();
    if (!std::filesystem::is_regular_file(model)) throw std::runtime_error(file + ": no such file");
    try {
      net_ = cv::dnn::readNetFromONNX(file);
      output_names_ = net_.getUnconnectedOutLayersNames();
      const int shape[] = {1, 3, input_.height, input_.width};
      blob_.create(4, shape, CV_32F);
      blob_.setTo(0);
      forward();
    } catch (const cv::Exception& error) {
      throw std::runtime_error(file + ": OpenCV " CV_VERSION " cannot use this network with an input of " +
                               std::to_string(input.width) + "x" + std::to_string(input.height) +
                               " (FILE@SIZE for another): " + error.err);
    }
    try {
      const NetworkLayout layout = recognise(outputs_, input_);
      family_ = layout.family;
      classes_ = network_classes(model, layout.classes);
    } catch (const std::exception& error) {
      const std::string what = error.what();
      throw std::runtime_error(what.find(model.stem().string()) != std::string::npos ? what : file + ": " + what);
    }
  }

  Detections detect(const cv::Mat& bgr, double) override {
    Detections found;
    if (bgr.empty()) return found;
    const bool fastestdet = family_ == NetworkFamily::fastestdet;
    // The default of FastestDet: benchmarks/studies/detector_study.cpp.
    const float min_score = options_.min_score > 0 ? float(options_.min_score) : (fastestdet ? 0.6F : 0.4F);
    InputMapping mapping;
    try {
      mapping = fit_image(bgr, input_, !fastestdet, fitted_);
      // As the families are trained: the YOLOs on RGB, FastestDet on BGR.
      cv::dnn::blobFromImage(fitted_, blob_, 1 / 255.0, input_, {}, !fastestdet, false, CV_32F);
      forward();
    } catch (const cv::Exception& error) {
      throw std::runtime_error(name_ + ": " + error.err);
    }
    switch (family_) {
      case NetworkFamily::yolov5:
        decode_yolov5(outputs_[0], min_score, found);
        break;
      case NetworkFamily::yolov8:
        decode_yolov8(outputs_[0], min_score, found);
        break;
      case NetworkFamily::fastestdet:
        decode_fastestdet(outputs_[0], input_, min_score, found);
        break;
    }
    suppress(found, static_cast<float>(options_.max_overlap));
    for (auto& d : found) d.box = cfp::clip(mapping.to_image(d.box), float(bgr.cols), float(bgr.rows));
    found.erase(std::remove_if(found.begin(), found.end(), [](const auto& d) { return !cfp::is_proper(d.box); }),
                found.end());
    return found;
  }

  [[nodiscard]] NetworkFamily family() const { return family_; }
  [[nodiscard]] cv::Size input() const { return input_; }

 private:
  void forward() {
    net_.setInput(blob_);
    net_.forward(outputs_, output_names_);
  }

  cv::Size input_;
  DetectorOptions options_;
  NetworkFamily family_ = NetworkFamily::yolov5;
  cv::dnn::Net net_;
  std::vector<std::string> output_names_;
  std::vector<cv::Mat> outputs_;
  cv::Mat fitted_, blob_;
};

}  // namespace cfp_examples
