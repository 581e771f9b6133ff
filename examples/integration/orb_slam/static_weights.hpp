// cfp beside the Tracking of ORB-SLAM2, ORB-SLAM3 or a system built like them. README.md says where each call goes.
//
// Host names what differs between such systems (orb_slam.hpp, ../orb_slam_shape/cfp_glue.hpp): the types Frame and
// Camera, and the static functions Keys (of the image in which objects are detected), Descriptors and Pose
// (T_cam_world). Frame gets two members, std::vector<float> mvStaticProbability and mvWeight; its map points get
// mStaticProbability, a float, or std::atomic<float> where other threads read it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "cfp/frame/static_probability.hpp"

namespace cfp_integration {

// [glue]
template <typename Host>
class StaticWeights {
 public:
  using Frame = typename Host::Frame;

  StaticWeights(const typename Host::Camera& camera, const cfp::FrameOptions& options)
      : mProbability(camera, options) {}

  // When the frame has been made, before anything is matched: K of every keypoint. detections: not set when the
  // detector did not run on this image.
  void NewFrame(Frame& F, const std::optional<std::vector<cfp::Detection<float>>>& detections,
                const cfp::FlowPairs<float>& flow) {
    cfp::Frame<float> frame;
    frame.timestamp_s = F.mTimeStamp;
    frame.keypoints = Host::Keys(F);
    if (F.mvDepth.size() == frame.keypoints.size()) frame.depths = F.mvDepth;
    frame.descriptors = Host::Descriptors(F);
    frame.flow = flow;
    if (detections) frame.detections = *detections;
    const auto weight = mProbability.coarse(frame).weight;
    F.mvWeight.assign(weight.begin(), weight.end());
    Remember(F);
  }

  // Before every pose optimisation: its weights. 0 where there is no map point, or one that must not count.
  void Weigh(Frame& F) {
    GatherM(F);
    const auto weights = mProbability.weights(mM);
    F.mvWeight.assign(weights.begin(), weights.end());
  }

  // After the first pose of a frame that follows one with a pose: the constraints of that pose.
  void FirstPose(Frame& F, const Frame& last) {
    cfp::match_by_map_point(F.mvpMapPoints, last.mvpMapPoints, mScratch, mMatch);
    GatherM(F);
    std::size_t inliers = 0;
    for (std::size_t i = 0; i < mM.size(); ++i)
      inliers += mM[i] >= 0 && !F.mvbOutlier[i] && CountsAsInlier(F, i) ? 1 : 0;
    mProbability.fine({Host::Pose(F) * Host::Pose(last).inverse(), inliers}, mMatch, mM);
    Remember(F);
  }

  // When the frame has its last pose, and all matches of the local map: map points learn, once.
  void Learn(const Frame& F) const {
    for (std::size_t i = 0; Report().stage == cfp::Stage::fine && i < F.mvpMapPoints.size(); ++i) {
      if (!F.mvpMapPoints[i]) continue;
      const float m = mProbability.updated_map_point(i, F.mvpMapPoints[i]->mStaticProbability);
      F.mvpMapPoints[i]->mStaticProbability = m;
      if (cfp::is_deletable(m, mProbability.options().map_point)) F.mvpMapPoints[i]->SetBadFlag();
    }
  }

  // Where inliers are counted, and where a keypoint is about to make a map point (whose M is k, what is known of it).
  bool CountsAsInlier(const Frame& F, std::size_t i) const {
    return cfp::counts_as_inlier(F.mvWeight[i], mProbability.options());
  }
  bool MayCreate(float k) const { return cfp::may_create_map_point(k, mProbability.options()); }
  // Where a match is about to be drawn by a RANSAC.
  bool Trusts(std::size_t i, float m) const {
    return cfp::counts_as_inlier(mProbability.weight(i, m), mProbability.options());
  }

  void Reset() { mProbability.reset(); }
  const cfp::StaticProbability<typename Host::Camera>& Probability() const { return mProbability; }
  const cfp::FrameReport& Report() const { return mProbability.state().report; }

 private:
  // What is known of each keypoint without a map point.
  void Remember(Frame& F) const {
    F.mvStaticProbability.resize(mProbability.state().size());
    for (std::size_t i = 0; i < F.mvStaticProbability.size(); ++i)
      F.mvStaticProbability[i] = mProbability.static_probability(i, -1.0F);
  }

  // M of the map point of each keypoint.
  void GatherM(const Frame& F) {
    mM.assign(F.mvpMapPoints.size(), -1.0F);
    for (std::size_t i = 0; i < mM.size(); ++i)
      if (F.mvpMapPoints[i]) mM[i] = F.mvpMapPoints[i]->mStaticProbability;
  }

  cfp::StaticProbability<typename Host::Camera> mProbability;
  std::vector<std::int32_t> mScratch, mMatch;
  std::vector<float> mM;
};
// [glue]

}  // namespace cfp_integration
