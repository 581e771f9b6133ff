// stella_vslam's data in miniature, by its names, as far as weights are concerned: a frame's observation is a struct of
// arrays, landmarks are shared pointers, poses are Eigen matrices. Added for cfp: landmark::static_probability_.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include <Eigen/Core>

namespace stella_vslam {

using Mat44_t = Eigen::Matrix4d;
using Vec3_t = Eigen::Vector3d;

namespace camera {
struct perspective {
  double fx_, fy_, cx_, cy_;
  unsigned int cols_, rows_;
};
}  // namespace camera

namespace data {

struct keypoint {  // cv::KeyPoint
  struct {
    float x, y;
  } pt;
  int octave = 0;
};

class landmark {
 public:
  explicit landmark(const Vec3_t& pos_w) : pos_w_(pos_w) {}
  Vec3_t get_pos_in_world() const { return pos_w_; }
  bool will_be_erased() const { return will_be_erased_; }
  void prepare_for_erasing() { will_be_erased_ = true; }

  float static_probability_ = 1;  // cfp: M

 private:
  Vec3_t pos_w_;
  bool will_be_erased_ = false;
};

struct frame_observation {
  std::vector<keypoint> undist_keypts_;
  std::vector<float> depths_;  // -1: none
};

class frame {
 public:
  std::vector<std::shared_ptr<landmark>> get_landmarks() const { return landmarks_; }
  Mat44_t get_pose_cw() const { return pose_cw_; }

  double timestamp_ = 0;
  frame_observation frm_obs_;
  std::vector<std::shared_ptr<landmark>> landmarks_;
  Mat44_t pose_cw_ = Mat44_t::Identity();
};

}  // namespace data
}  // namespace stella_vslam
