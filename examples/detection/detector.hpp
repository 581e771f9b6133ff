// Object detectors of the SLAM example, chosen by one word of the command line.
#pragma once

#include <cstdio>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>

#include "detector_types.hpp"
#include "network_detector.hpp"
#include "simple_detectors.hpp"

namespace cfp_examples {

// spec, and what it makes:
//   none                        no boxes
//   hog                         OpenCV's built-in people detector
//   FILE.txt                    boxes of a detections text file, by time stamp
//   FILE.onnx[@SIZE]            a network and its input: 640, or WIDTHxHEIGHT; without it 640
// Throws std::runtime_error that names the file and what is wrong with it.
inline std::unique_ptr<Detector> make_detector(const std::string& spec, const DetectorOptions& options = {}) {
  if (spec == "none") return std::make_unique<NoDetector>();
  if (spec == "hog") return std::make_unique<HogDetector>(options);
  std::filesystem::path file = spec;
  cv::Size input{640, 640};
  if (const std::size_t at = spec.rfind('@'); at != std::string::npos && !std::filesystem::exists(file)) {
    int width = 0, height = 0, end = 0;
    const std::string size = spec.substr(at + 1);
    const int read = std::sscanf(size.c_str(), "%5d%nx%5d%n", &width, &end, &height, &end);
    if (read == 1) height = width;
    if (read < 1 || end != static_cast<int>(size.size()) || width < 1 || height < 1 || width > 8192 || height > 8192)
      throw std::runtime_error(spec + ": '" + size + "' is no size such as 640 or 640x480");
    input = {width, height};
    file = spec.substr(0, at);
  }
  const std::string extension = file.extension().string();
  if (extension == ".txt") return std::make_unique<FileDetector>(file.string(), options);
  if (extension == ".onnx") return std::make_unique<NetworkDetector>(file, input, options);
  throw std::runtime_error("no detector '" + spec + "': none, hog, FILE.txt or FILE.onnx");
}

}  // namespace cfp_examples
