// The probabilities of a run against the true labels of every pixel.
#pragma once

#include <cmath>
#include <cstddef>

#include <opencv2/core.hpp>

#include "run_record.hpp"

namespace cfp_slam {

// Pixel labels of cfp_synthetic.
enum class PixelLabel : unsigned char { still = 0, moving = 1, still_part = 2 };

// The label that all pixels of the corner's circle (radius 3 at its level) share; still_part where they differ.
inline PixelLabel label_of_patch(const cv::Mat& labels, float x, float y, float size) {
  const int radius = static_cast<int>(std::ceil(3 * size / 31));
  const cv::Rect patch = cv::Rect(cvRound(x) - radius, cvRound(y) - radius, 2 * radius + 1, 2 * radius + 1) &
                         cv::Rect(0, 0, labels.cols, labels.rows);
  if (patch.empty()) return PixelLabel::still_part;
  const unsigned char first = labels.at<unsigned char>(patch.tl());
  return cv::countNonZero(labels(patch) != first) == 0 ? static_cast<PixelLabel>(first) : PixelLabel::still_part;
}

inline void add_sample(LabelledSamples& samples, double probability, bool is_static) {
  samples.probability.push_back(static_cast<float>(probability));
  samples.is_static.push_back(is_static ? char(1) : char(0));
}

// A box counts as moving when a third of the person in it moves, as static when less than a twentieth does.
inline void add_object(const BoxRecord& box, const cv::Mat& labels, LabelledSamples& samples) {
  const cv::Rect inside =
      cv::Rect(cv::Point(int(box.box.x1), int(box.box.y1)), cv::Point(int(box.box.x2), int(box.box.y2))) &
      cv::Rect(0, 0, labels.cols, labels.rows);
  if (inside.empty()) return;
  const double moving = cv::countNonZero(labels(inside) == static_cast<int>(PixelLabel::moving)),
               still = cv::countNonZero(labels(inside) == static_cast<int>(PixelLabel::still_part));
  const double share = moving / (moving + still);
  if (moving + still < 200 || (share >= 0.05 && share <= 1.0 / 3)) return;
  add_sample(samples, box.object_probability, share < 0.05);
}

// Keypoints inside boxes with a match, so that both stages are judged on the same ones. Two kinds have no side to be on
// and are left out: parts of people that happen to be still, and corners whose patch shows a person and the room, which
// move with the outline.
inline void add_samples(const RunFrame& frame, const cv::Mat& labels, RunRecord& run) {
  for (const BoxRecord& box : frame.boxes) {
    if (box.object_known) add_object(box, labels, run.object);
  }
  for (const BoxKeypoint& keypoint : frame.box_keypoints) {
    if (!(keypoint.fine >= 0 && keypoint.map_point >= 0)) continue;
    const PixelLabel label = label_of_patch(labels, keypoint.x, keypoint.y, keypoint.size);
    if (label == PixelLabel::still_part) continue;
    add_sample(run.first_stage, keypoint.coarse, label == PixelLabel::still);
    add_sample(run.second_stage, keypoint.fine, label == PixelLabel::still);
    add_sample(run.map_point, keypoint.map_point, label == PixelLabel::still);
    add_sample(run.weight, keypoint.weight, label == PixelLabel::still);
  }
}

}  // namespace cfp_slam
