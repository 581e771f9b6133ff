// What the model thinks of a frame, as a picture like the paper's figures.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <vector>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "../record.hpp"
#include "cfp/core/span.hpp"
#include "cfp/frame/object_box.hpp"

namespace cfp_slam {

// Boxes: yellow where detected, orange where compensated, with O. Keypoints: grey outside boxes; inside from red (K =
// 0) to green (K = 1), filled on the foreground, a ring on the background.
inline cv::Mat annotate(const cv::Mat& bgr, const std::vector<cv::KeyPoint>& keypoints,
                        cfp::span<const float> static_probability, cfp::span<const cfp::KeypointLabel> label,
                        const std::vector<BoxRecord>& boxes) {
  cv::Mat picture = bgr.clone();
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    if (label[i] == cfp::KeypointLabel::outside) {
      cv::circle(picture, keypoints[i].pt, 1, {170, 170, 170}, cv::FILLED, cv::LINE_AA);
      continue;
    }
    const double k = std::clamp(static_cast<double>(static_probability[i]), 0.0, 1.0);
    const bool foreground = label[i] == cfp::KeypointLabel::foreground;
    cv::circle(picture, keypoints[i].pt, 3, {0, 255 * std::min(1.0, 2 * k), 255 * std::min(1.0, 2 - 2 * k)},
               foreground ? static_cast<int>(cv::FILLED) : 1, cv::LINE_AA);
  }
  for (const BoxRecord& box : boxes) {
    const cv::Scalar colour = box.compensated ? cv::Scalar(0, 140, 255) : cv::Scalar(0, 225, 255);
    const cv::Point corner(static_cast<int>(box.box.x1), static_cast<int>(box.box.y1));
    cv::rectangle(picture, corner, {static_cast<int>(box.box.x2), static_cast<int>(box.box.y2)}, colour, 2);
    char text[64];
    if (box.object_known) {
      std::snprintf(text, sizeof text, "%lld O %.2f%s", static_cast<long long>(box.id), box.object_probability,
                    box.compensated ? " compensated" : "");
    } else {
      std::snprintf(text, sizeof text, "%lld O unknown%s", static_cast<long long>(box.id),
                    box.compensated ? " compensated" : "");
    }
    const cv::Point place(std::max(corner.x + 4, 4), std::max(corner.y + 16, 16));
    cv::putText(picture, text, place, cv::FONT_HERSHEY_SIMPLEX, 0.45, {0, 0, 0}, 3, cv::LINE_AA);
    cv::putText(picture, text, place, cv::FONT_HERSHEY_SIMPLEX, 0.45, colour, 1, cv::LINE_AA);
  }
  return picture;
}

inline std::vector<unsigned char> jpeg_of(const cv::Mat& picture) {
  std::vector<unsigned char> bytes;
  cv::imencode(".jpg", picture, bytes, {cv::IMWRITE_JPEG_QUALITY, 80});
  return bytes;
}

}  // namespace cfp_slam
