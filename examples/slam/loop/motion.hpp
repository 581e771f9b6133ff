// How the camera should have moved: the velocity of the last two frames goes on.
#pragma once

#include <algorithm>
#include <optional>

#include "frame.hpp"

namespace cfp_slam {

class MotionModel {
 public:
  // Since the last frame; none without a velocity.
  [[nodiscard]] std::optional<cfp::SE3<double>> predict(const Frame& last, double time_s) const {
    constexpr double longest_s = 0.2;  // for which a velocity is believed
    if (!last.has_pose || !velocity_ || !(time_s > last.time_s)) return std::nullopt;
    const cfp::Vector6<double> step = *velocity_ * std::min(time_s - last.time_s, longest_s);
    return cfp::se3_exp(step);
  }

  void learn(const Frame& last, const Frame& frame) {
    velocity_.reset();
    if (frame.has_pose && last.has_pose && frame.time_s > last.time_s)
      velocity_ = cfp::se3_log(frame.T_cam_world * last.T_cam_world.inverse()) / (frame.time_s - last.time_s);
  }

 private:
  std::optional<cfp::Vector6<double>> velocity_;
};

}  // namespace cfp_slam
