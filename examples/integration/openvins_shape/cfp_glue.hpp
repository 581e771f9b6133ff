// All that a filter in the shape of OpenVINS needs to use cfp: this class as a member of VioManager, two calls per
// image, and the weight of a feature when its track has ended. A clone of the body instead of the camera: xi of the
// body gives Ad(T_cam_body) xi of its camera (uncertain_motion.hpp).
#pragma once

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <unordered_map>
#include <vector>

#include "cfp/frame/static_probability.hpp"
#include "host.hpp"

extern template class cfp::StaticProbability<cfp::PinholeCamera<float>>;  // compiled in engines.cc alone

// [glue]
class StaticTracks {
 public:
  StaticTracks(const cfp::PinholeCamera<float>& camera, const cfp::FrameOptions& options)
      : probability_(camera, options) {}

  // After feed_new_camera and propagate_and_clone. detections: null when the detector did not run on this image.
  void new_image(const ov_msckf::TrackKLT& tracker, const ov_msckf::State& state,
                 const std::vector<cfp::Detection<float>>* detections) {
    ids_.swap(last_ids_);
    pixels_.swap(last_pixels_);
    ids_ = tracker.get_last_ids();
    pixels_ = tracker.get_last_obs();
    cfp::match_by_map_point(ids_, last_ids_, scratch_, match_);
    from_.clear(), to_.clear();
    for (std::size_t i = 0; i < match_.size(); ++i) {
      if (match_[i] == cfp::no_match) continue;
      from_.push_back(last_pixels_[static_cast<std::size_t>(match_[i])]);
      to_.push_back(pixels_[i]);
    }
    m_.clear();
    for (const std::size_t id : ids_) m_.push_back(known_.count(id) > 0 ? known_[id].m : -1.0F);
    cfp::Frame<float> frame;
    frame.timestamp_s = state._timestamp;
    frame.keypoints = view(pixels_);
    frame.flow = {view(from_), view(to_)};
    frame.map_point_probability = m_;
    if (detections) frame.detections = *detections;
    if (state._clones.size() > 1) frame.T_cur_prev = last_motion(state);
    probability_.coarse(frame);
  }

  // Of a feature whose track has ended: its last weight.
  double weight(std::size_t featid) const {
    const auto found = known_.find(featid);
    return found == known_.end() ? 0 : static_cast<double>(found->second.weight);
  }

  // After the update by `used` features: the tracks that go on learn.
  void updated(const ov_msckf::State& state, std::size_t used) {
    if (state._clones.size() > 1) probability_.fine({last_motion(state).T_cur_prev, used}, match_, m_);
    std::unordered_map<std::size_t, Known> known;
    for (std::size_t i = 0; i < ids_.size(); ++i) {
      const float weight = probability_.weight(i, m_[i]);
      const float m = m_[i] < 0 ? probability_.static_probability(i, -1.0F) : probability_.updated_map_point(i, m_[i]);
      known[ids_[i]] = {m, weight};
    }
    known_.swap(known);
  }

  const cfp::FrameReport& report() const { return probability_.state().report; }

 private:
  struct Known {
    float m = -1, weight = 0;
  };

  static cfp::PointSpan<float, 2> view(const std::vector<ov_msckf::KeyPoint>& keypoints) {
    return {reinterpret_cast<const float*>(keypoints.data()), keypoints.size(), sizeof(ov_msckf::KeyPoint)};
  }

  // Between the last two clones, whose errors (theta, p) are xi = -(R dp, theta) of T_cam_world.
  static cfp::UncertainMotion<double> last_motion(const ov_msckf::State& state) {
    const auto cur = std::prev(state._clones.end()), prev = std::prev(cur);
    Eigen::Matrix<double, 12, 12> J = Eigen::Matrix<double, 12, 12>::Zero();
    cfp::SE3<double> T[2];
    for (const int k : {0, 1}) {
      const ov_msckf::Clone& clone = (k == 0 ? prev : cur)->second;
      T[k] = {clone.R_GtoC, -clone.R_GtoC * clone.p_CinG};
      J.block<3, 3>(6 * k, 6 * k + 3) = -clone.R_GtoC;
      J.block<3, 3>(6 * k + 3, 6 * k) = -Eigen::Matrix3d::Identity();
    }
    const Eigen::Matrix<double, 12, 12> P = state._Cov.bottomRightCorner<12, 12>();
    return cfp::relative_motion(T[0], T[1], J * P * J.transpose());
  }

  cfp::StaticProbability<cfp::PinholeCamera<float>> probability_;
  std::vector<std::size_t> ids_, last_ids_;
  std::vector<ov_msckf::KeyPoint> pixels_, last_pixels_, from_, to_;
  std::vector<std::int32_t> scratch_, match_;
  std::vector<float> m_;
  std::unordered_map<std::size_t, Known> known_;
};
// [glue]
