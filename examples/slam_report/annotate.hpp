// What the model thought of a frame, as a picture like the paper's figures.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "../slam_runs/run_record.hpp"
#include "../support/tum.hpp"

namespace cfp_slam {

// Boxes: yellow where detected, orange where compensated, with O. Keypoints inside them: from red (weight 0) to green
// (1), filled on the foreground, a ring on the background.
inline cv::Mat annotate(const cv::Mat& bgr, const RunFrame& frame) {
  cv::Mat picture = bgr.clone();
  for (const BoxKeypoint& p : frame.box_keypoints) {
    const double w = std::clamp(static_cast<double>(p.weight >= 0 ? p.weight : p.static_probability()), 0.0, 1.0);
    cv::circle(picture, cv::Point2f(p.x, p.y), 3, {0, 255 * std::min(1.0, 2 * w), 255 * std::min(1.0, 2 - 2 * w)},
               p.foreground ? static_cast<int>(cv::FILLED) : 1, cv::LINE_AA);
  }
  for (const BoxRecord& box : frame.boxes) {
    const cv::Scalar colour = box.compensated ? cv::Scalar(0, 140, 255) : cv::Scalar(0, 225, 255);
    const cv::Point corner(static_cast<int>(box.box.x1), static_cast<int>(box.box.y1));
    cv::rectangle(picture, corner, {static_cast<int>(box.box.x2), static_cast<int>(box.box.y2)}, colour, 2);
    const std::string text = std::to_string(box.id) +
                             ": O=" + (box.object_known ? cfp_examples::fixed(box.object_probability, 2) : "unknown") +
                             (box.compensated ? " compensated" : "");
    const cv::Point place(std::max(corner.x + 4, 4), std::max(corner.y + 16, 16));
    cv::putText(picture, text, place, cv::FONT_HERSHEY_SIMPLEX, 0.45, {0, 0, 0}, 3, cv::LINE_AA);
    cv::putText(picture, text, place, cv::FONT_HERSHEY_SIMPLEX, 0.45, colour, 1, cv::LINE_AA);
  }
  return picture;
}

// `count` pictures, spread over the run.
inline void add_pictures(RunRecord& run, const std::filesystem::path& recording, std::size_t count) {
  const std::size_t every = count > 0 ? std::max<std::size_t>(run.frames.size() / count, 1) : run.frames.size() + 1;
  for (std::size_t k = every / 2; k < run.frames.size(); k += every) {
    const RunFrame& frame = run.frames[k];
    const cv::Mat image = cv::imread((recording / frame.image).string());
    if (image.empty()) continue;
    AnnotatedFrame picture{frame.time_s, to_string(frame.outcome), {}};
    cv::imencode(".jpg", annotate(image, frame), picture.jpeg, {cv::IMWRITE_JPEG_QUALITY, 80});
    run.pictures.push_back(picture);
  }
}

}  // namespace cfp_slam
