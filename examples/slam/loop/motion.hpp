// Where the camera should be: the velocity of the last two frames goes on.
#pragma once

#include <algorithm>
#include <optional>

#include "cfp/geometry/homography.hpp"
#include "frame.hpp"

namespace cfp_slam {

class MotionModel {
 public:
  struct Prediction {
    cfp::SE3<double> T_cam_world;
    std::optional<cfp::Matrix3<float>> image_motion;  // homography from the last image; none without a velocity
  };

  [[nodiscard]] Prediction predict(const Frame& last, double time_s, const View& view) const {
    if (!last.has_pose || !velocity_ || !(time_s > last.time_s)) return {last.T_cam_world, std::nullopt};
    const cfp::Vector6<double> step = *velocity_ * std::min(time_s - last.time_s, longest_s);
    const cfp::SE3<double> motion = cfp::se3_exp(step);
    return {motion * last.T_cam_world, cfp::rotation_homography(view.camera, motion.rotation.cast<float>())};
  }

  void learn(const Frame& last, const Frame& frame) {
    velocity_.reset();
    if (frame.has_pose && last.has_pose && frame.time_s > last.time_s)
      velocity_ = cfp::se3_log(frame.T_cam_world * last.T_cam_world.inverse()) / (frame.time_s - last.time_s);
  }

 private:
  static constexpr double longest_s = 0.2;  // for which a velocity is believed
  std::optional<cfp::Vector6<double>> velocity_;
};

}  // namespace cfp_slam
