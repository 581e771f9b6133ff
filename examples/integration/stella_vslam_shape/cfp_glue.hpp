// All that a system in the shape of stella_vslam needs to use cfp: this class as a member of tracking_module, and
// landmark::static_probability_ (std::atomic<float> there, as the mapping module reads it). Keypoints are undistorted:
// objects must be detected in the undistorted image, too.
#pragma once

#include <cstdint>
#include <vector>

#include "cfp/frame/static_probability.hpp"
#include "host.hpp"

extern template class cfp::StaticProbability<cfp::PinholeCamera<float>>;  // compiled in engines.cc alone

// [glue]
class static_weights {
 public:
  static_weights(const stella_vslam::camera::perspective& c, int person_class)
      : probability_({static_cast<float>(c.fx_), static_cast<float>(c.fy_), static_cast<float>(c.cx_),
                      static_cast<float>(c.cy_)},
                     options(c, person_class)) {}

  // tracking_module::feed_frame, before track(). detections: null when the detector did not run.
  void new_frame(const stella_vslam::data::frame& frm, const std::vector<cfp::Detection<float>>* detections,
                 const cfp::FlowPairs<float>& flow) {
    const auto& obs = frm.frm_obs_;
    cfp::Frame<float> frame;
    frame.timestamp_s = frm.timestamp_;
    const auto* const first = reinterpret_cast<const float*>(obs.undist_keypts_.data());
    frame.keypoints = {first, obs.undist_keypts_.size(), sizeof(obs.undist_keypts_[0])};
    frame.depths = obs.depths_;
    frame.flow = flow;
    if (detections) frame.detections = *detections;
    report_ = probability_.coarse(frame).report;
  }

  // Before every optimize of module::pose_optimizer: the weight of each observation's edge, 0 leaves it out.
  cfp::span<const float> weights(const stella_vslam::data::frame& frm) {
    gather(frm);
    return probability_.weights(m_);
  }

  // After the first pose (motion_based_track, bow_match_based_track, robust_match_based_track).
  void first_pose(const stella_vslam::data::frame& frm, const stella_vslam::data::frame& last, unsigned int num_valid) {
    cfp::match_by_map_point(frm.landmarks_, last.landmarks_, scratch_, match_);
    gather(frm);
    report_ = probability_.fine({pose(frm) * pose(last).inverse(), num_valid}, match_, m_).report;
  }

  // After the last pose (optimize_current_frame_with_local_map): landmarks learn.
  void learn(const stella_vslam::data::frame& frm) {
    gather(frm);
    for (std::size_t i = 0; report_.stage == cfp::Stage::fine && i < m_.size(); ++i) {
      if (m_[i] < 0) continue;
      const float m = frm.landmarks_[i]->static_probability_ = probability_.updated_map_point(i, m_[i]);
      if (cfp::is_deletable(m, probability_.options().map_point)) frm.landmarks_[i]->prepare_for_erasing();
    }
  }

  // keyframe_inserter and mapping_module: whether a keypoint may make a landmark, and its M.
  bool may_create(std::size_t i) const { return probability_.may_create_map_point(i); }
  float initial(std::size_t i) const { return probability_.static_probability(i, -1.0F); }
  const cfp::FrameReport& report() const { return report_; }

 private:
  static cfp::FrameOptions options(const stella_vslam::camera::perspective& c, int person_class) {
    cfp::FrameOptions o;
    o.classes = {{person_class, true}};
    o.tracker.image_width = c.cols_;
    o.tracker.image_height = c.rows_;
    return o;
  }
  static cfp::SE3<double> pose(const stella_vslam::data::frame& frm) {
    const stella_vslam::Mat44_t T = frm.get_pose_cw();
    return {T.topLeftCorner<3, 3>(), T.topRightCorner<3, 1>()};
  }
  void gather(const stella_vslam::data::frame& frm) {
    m_.assign(frm.landmarks_.size(), -1.0F);
    for (std::size_t i = 0; i < m_.size(); ++i)
      if (frm.landmarks_[i] && !frm.landmarks_[i]->will_be_erased()) m_[i] = frm.landmarks_[i]->static_probability_;
  }

  cfp::StaticProbability<cfp::PinholeCamera<float>> probability_;
  cfp::FrameReport report_;
  std::vector<std::int32_t> scratch_, match_;
  std::vector<float> m_;
};
// [glue]
