// Where an image shows the room and not the people before it: outside of their boxes and, where there is a depth image,
// what in the boxes lies behind them.
#pragma once

#include <vector>

#include <opencv2/core.hpp>

#include "cfp/geometry/box.hpp"

namespace cfp_examples {

struct BoxedPerson {
  cfp::Box<float> box;
  float depth_m = 0;  // median of what is on the person; 0: unknown, and then all of the box may be the person's
};

// 255 where the room is seen, 0 elsewhere. Boxes are widened by a tenth: they seldom hold all of a person. depth:
// registered to the image, of its size; empty: none.
inline void room_mask(cv::Size size, const cv::Mat& depth, double metres_per_unit,
                      const std::vector<BoxedPerson>& people, cv::Mat& mask) {
  constexpr double behind_m = 0.5;  // an outstretched arm is nearer
  mask.create(size, CV_8U);
  mask.setTo(255);
  cv::Mat behind;
  for (const BoxedPerson& person : people) {
    const cfp::Box<float> box = cfp::clip(cfp::widened(person.box, 0.1F), float(size.width), float(size.height));
    if (!cfp::is_proper(box)) continue;
    const cv::Rect part = cv::Rect(cv::Point(int(box.x1), int(box.y1)), cv::Point(int(box.x2) + 1, int(box.y2) + 1)) &
                          cv::Rect(cv::Point(), size);
    if (depth.size() == size && person.depth_m > 0)
      cv::compare(depth(part), (double(person.depth_m) + behind_m) / metres_per_unit, behind, cv::CMP_GT);
    else
      behind = cv::Mat::zeros(part.size(), CV_8U);
    mask(part) &= behind;
  }
}

}  // namespace cfp_examples
