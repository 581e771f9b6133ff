// A picture on the disk, or an error that names it: OpenCV only returns false where a disk is full.
#pragma once

#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <vector>

namespace cfp_examples {

inline void write_picture(const std::filesystem::path& file, const cv::Mat& picture,
                          const std::vector<int>& parameters = {}) {
  if (!cv::imwrite(file.string(), picture, parameters)) throw std::runtime_error("cannot write " + file.string());
}

}  // namespace cfp_examples
