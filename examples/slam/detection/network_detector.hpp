// A detection network through OpenCV's dnn module: ONNX or Darknet, its family told from its outputs
// (network_outputs.hpp).
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
#include "network_input_size.hpp"
#include "network_outputs.hpp"

namespace cfp_slam {

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
  // model: .onnx, or .cfg / .weights with the other one of the same stem beside it. input: 0 x 0 takes the size the
  // file states.
  NetworkDetector(const std::filesystem::path& model, cv::Size input, const DetectorOptions& options)
      : Detector(model.filename().string(), {}), input_(input), options_(options) {
    const std::string file = model.string();
    const std::string extension = model.extension().string();
    const bool darknet = extension == ".cfg" || extension == ".weights";
    try {
      if (darknet) {
        const auto cfg = std::filesystem::path(model).replace_extension(".cfg"),
                   weights = std::filesystem::path(model).replace_extension(".weights");
        for (const auto& part : {cfg, weights}) require_file(part);
        net_ = cv::dnn::readNetFromDarknet(cfg.string(), weights.string());
        if (input_.empty()) input_ = darknet_input_size(cfg);
      } else {
        require_file(model);
        net_ = cv::dnn::readNetFromONNX(file);
        if (input_.empty()) input_ = onnx_input_size(model);
      }
      if (input_.empty()) throw std::runtime_error("does not state its input size: write FILE@WIDTHxHEIGHT");
      output_names_ = net_.getUnconnectedOutLayersNames();
      const int shape[] = {1, 3, input_.height, input_.width};
      blob_.create(4, shape, CV_32F);
      blob_.setTo(0);
      forward();
      const NetworkLayout layout = recognise(outputs_, input_, darknet);
      family_ = layout.family;
      classes_ = network_classes(model, layout.classes);
    } catch (const cv::Exception& error) {
      throw std::runtime_error(file + ": OpenCV " CV_VERSION " cannot use this network: " + error.err);
    } catch (const std::exception& error) {
      const std::string what = error.what();
      throw std::runtime_error(what.find(model.stem().string()) != std::string::npos ? what : file + ": " + what);
    }
  }

  Detections detect(const cv::Mat& bgr, double) override {
    Detections found;
    if (bgr.empty()) return found;
    const bool letterbox = family_ == NetworkFamily::yolov5 || family_ == NetworkFamily::yolov8;
    const float min_score = options_.min_score > 0 ? float(options_.min_score) : default_score();
    InputMapping mapping;
    try {
      mapping = fit_image(bgr, input_, letterbox, fitted_);
      make_blob();
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
      case NetworkFamily::darknet:
        for (const cv::Mat& output : outputs_) decode_darknet(output, input_, min_score, found);
        break;
      case NetworkFamily::nanodet:
        decode_nanodet(outputs_, input_, min_score, found);
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
  static void require_file(const std::filesystem::path& file) {
    if (!std::filesystem::is_regular_file(file)) throw std::runtime_error(file.string() + ": no such file");
  }

  // As the families are trained: NanoDet on BGR less ImageNet's mean over its deviation, FastestDet on BGR / 255, the
  // YOLOs on RGB / 255.
  void make_blob() {
    if (family_ != NetworkFamily::nanodet) {
      cv::dnn::blobFromImage(fitted_, blob_, 1 / 255.0, input_, {}, family_ != NetworkFamily::fastestdet, false,
                             CV_32F);
      return;
    }
    cv::dnn::blobFromImage(fitted_, blob_, 1, input_, {103.53, 116.28, 123.675}, false, false, CV_32F);
    const double deviation[] = {57.375, 57.12, 58.395};
    for (int c = 0; c < 3; ++c) {
      cv::Mat plane(input_, CV_32F, blob_.ptr<float>(0, c));
      plane *= 1 / deviation[c];
    }
  }

  void forward() {
    net_.setInput(blob_);
    net_.forward(outputs_, output_names_);
  }

  // Chosen by benchmarks/studies/detector_study.cpp, except for YOLOv5 and YOLOv8, of which no network is at hand.
  [[nodiscard]] float default_score() const {
    switch (family_) {
      case NetworkFamily::nanodet:
        return 0.4F;
      case NetworkFamily::fastestdet:
        return 0.6F;
      case NetworkFamily::darknet:
        return 0.5F;
      default:
        return 0.4F;
    }
  }

  cv::Size input_;
  DetectorOptions options_;
  NetworkFamily family_ = NetworkFamily::yolov5;
  cv::dnn::Net net_;
  std::vector<std::string> output_names_;
  std::vector<cv::Mat> outputs_;
  cv::Mat fitted_, blob_;
};

}  // namespace cfp_slam
