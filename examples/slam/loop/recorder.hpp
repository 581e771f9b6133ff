// Watches the model at work on one frame and notes what report and tables want to know.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include <opencv2/core.hpp>

#include "../record.hpp"
#include "cfp/frame/static_probability_pipeline.hpp"
#include "frame.hpp"

namespace cfp_slam {

// Pixel labels of cfp_synthetic.
enum class PixelLabel : unsigned char { still = 0, moving = 1, still_part = 2 };

class Recorder {
 public:
  Recorder(RunRecord& run, FrameRecord& frame, const cv::Mat& labels) : run_(run), frame_(frame), labels_(labels) {}

  // Called after every step of the pipeline.
  void operator()(cfp::PipelineStep step, const cfp::FrameResult<float>& known, const Frame& frame) {
    if (step == cfp::PipelineStep::objects) note_boxes(known);
    if (step == cfp::PipelineStep::first_keypoints)
      first_.assign(known.static_probability.begin(), known.static_probability.end());
    // The step before the last pose: K is the first stage's or, where that could run, the second's.
    if (step == cfp::PipelineStep::first_keypoints || step == cfp::PipelineStep::second_keypoints)
      note_keypoints(known);
    if (step == cfp::PipelineStep::second_keypoints && !labels_.empty()) note_samples(known, frame);
  }

  [[nodiscard]] const std::vector<float>& static_probability() const { return last_; }
  [[nodiscard]] const std::vector<cfp::KeypointLabel>& label() const { return label_; }

 private:
  void note_boxes(const cfp::FrameResult<float>& known) {
    for (std::size_t b = 0; b < known.boxes.size(); ++b) {
      const auto& box = known.boxes[b];
      const auto& object = known.objects[b];
      const bool is_known = object.status == cfp::Status::ok;
      frame_.boxes.push_back({box.id, box.box, box.compensated(), object.static_probability, is_known, object.pairs});
      if (!labels_.empty() && is_known) note_object(box.box, object.static_probability);
    }
  }

  // A box counts as moving when a third of the person in it moves, as static when less than a twentieth does.
  void note_object(const cfp::Box<float>& box, double probability) {
    const cv::Rect inside = cv::Rect(cv::Point(static_cast<int>(box.x1), static_cast<int>(box.y1)),
                                     cv::Point(static_cast<int>(box.x2), static_cast<int>(box.y2))) &
                            cv::Rect(0, 0, labels_.cols, labels_.rows);
    if (inside.empty()) return;
    const cv::Mat part = labels_(inside);
    const double moving = cv::countNonZero(part == static_cast<int>(PixelLabel::moving)),
                 still = cv::countNonZero(part == static_cast<int>(PixelLabel::still_part));
    if (moving + still < 200) return;
    const double share = moving / (moving + still);
    if (share >= 0.05 && share <= 1.0 / 3) return;
    run_.object.probability.push_back(static_cast<float>(probability));
    run_.object.is_static.push_back(share < 0.05 ? char(1) : char(0));
  }

  void note_keypoints(const cfp::FrameResult<float>& known) {
    last_.assign(known.static_probability.begin(), known.static_probability.end());
    label_.assign(known.label.begin(), known.label.end());
    frame_.keypoint_histogram = {};
    for (std::size_t i = 0; i < last_.size(); ++i) {
      if (label_[i] == cfp::KeypointLabel::outside) continue;
      const auto bins = frame_.keypoint_histogram.size();
      ++frame_.keypoint_histogram[(std::min)(static_cast<std::size_t>(last_[i] * static_cast<float>(bins)), bins - 1)];
    }
  }

  // Keypoints inside boxes with a match, so that both stages are judged on the same ones. Two kinds have no side to be
  // on and are left out: parts of people that happen to be still, and corners whose patch shows a person and the room,
  // which move with the outline.
  void note_samples(const cfp::FrameResult<float>& known, const Frame& frame) {
    const auto add = [](LabelledSamples& samples, float probability, bool is_static) {
      samples.probability.push_back(probability);
      samples.is_static.push_back(is_static ? char(1) : char(0));
    };
    for (std::size_t i = 0; i < frame.size(); ++i) {
      if (known.label[i] == cfp::KeypointLabel::outside || !(frame.map_point_probability[i] >= 0)) continue;
      const PixelLabel label = label_of_patch(frame.keypoints[i]);
      if (label == PixelLabel::still_part) continue;
      add(run_.first_stage, first_[i], label == PixelLabel::still);
      add(run_.second_stage, known.static_probability[i], label == PixelLabel::still);
      add(run_.map_point, frame.map_point_probability[i], label == PixelLabel::still);
    }
  }

  // The label that all pixels of the corner's circle (radius 3 at its level) share; still_part where they differ.
  [[nodiscard]] PixelLabel label_of_patch(const cv::KeyPoint& keypoint) const {
    const int radius = static_cast<int>(std::ceil(3 * keypoint.size / 31)), x = cvRound(keypoint.pt.x),
              y = cvRound(keypoint.pt.y);
    const cv::Rect patch =
        cv::Rect(x - radius, y - radius, 2 * radius + 1, 2 * radius + 1) & cv::Rect(0, 0, labels_.cols, labels_.rows);
    if (patch.empty()) return PixelLabel::still_part;
    const unsigned char first = labels_.at<unsigned char>(patch.tl());
    return cv::countNonZero(labels_(patch) != first) == 0 ? static_cast<PixelLabel>(first) : PixelLabel::still_part;
  }

  RunRecord& run_;
  FrameRecord& frame_;
  const cv::Mat& labels_;
  std::vector<float> first_, last_;
  std::vector<cfp::KeypointLabel> label_;
};

}  // namespace cfp_slam
