// cfp beside the Tracking of ORB-SLAM2, ORB-SLAM3 or a system built like them. README.md says where each call goes.
//
// Host names what differs between such systems (orb_slam2.hpp, orb_slam3.hpp, ../orb_slam_shape/cfp_glue.hpp): the
// types Frame, MapPoint and Camera, and the static functions Keys (of the image in which objects are detected),
// Descriptors and Pose (T_cam_world). Frame gets two members, std::vector<float> mvStaticProbability and mvWeight;
// MapPoint gets mStaticProbability, a float, or std::atomic<float> where other threads read it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <unordered_map>
#include <vector>

#include "cfp/frame/static_probability.hpp"

namespace cfp_integration {

// [glue]
template <typename Host>
class StaticWeights {
 public:
  using Frame = typename Host::Frame;
  using MapPoint = typename Host::MapPoint;

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
    if (detections) frame.detections = cfp::span<const cfp::Detection<float>>(*detections);
    mReport = mProbability.coarse(frame).report;
    Remember(F);
  }

  // Before every pose optimisation: its weights. 0 where there is no map point, or one that must not count.
  void Weigh(Frame& F) {
    mM.assign(F.mvpMapPoints.size(), -1.0F);
    for (std::size_t i = 0; i < mM.size(); ++i)
      if (F.mvpMapPoints[i]) mM[i] = F.mvpMapPoints[i]->mStaticProbability;
    const auto weights = mProbability.weights(mM);
    F.mvWeight.assign(weights.begin(), weights.end());
  }

  // After the first pose of a frame that follows one with a pose: the constraints of that pose.
  void FirstPose(Frame& F, const Frame& last) {
    std::unordered_map<const MapPoint*, std::int32_t> indexInLast;
    for (std::size_t j = 0; j < last.mvpMapPoints.size(); ++j)
      if (last.mvpMapPoints[j]) indexInLast[last.mvpMapPoints[j]] = static_cast<std::int32_t>(j);
    mMatch.assign(F.mvpMapPoints.size(), cfp::no_match);
    mM.assign(F.mvpMapPoints.size(), -1.0F);
    std::size_t inliers = 0;
    for (std::size_t i = 0; i < F.mvpMapPoints.size(); ++i) {
      if (!F.mvpMapPoints[i]) continue;
      mM[i] = F.mvpMapPoints[i]->mStaticProbability;
      const auto found = indexInLast.find(F.mvpMapPoints[i]);
      if (found != indexInLast.end()) mMatch[i] = found->second;
      inliers += !F.mvbOutlier[i] && CountsAsInlier(F, i) ? 1 : 0;
    }
    mReport = mProbability.fine({Host::Pose(F) * Host::Pose(last).inverse(), inliers}, mMatch, mM).report;
    Remember(F);
  }

  // When the frame has its last pose, and all matches of the local map: map points learn, once.
  void Learn(const Frame& F) const {
    for (std::size_t i = 0; mReport.stage == cfp::Stage::fine && i < F.mvpMapPoints.size(); ++i) {
      if (!F.mvpMapPoints[i]) continue;
      const float m = mProbability.updated_map_point(i, F.mvpMapPoints[i]->mStaticProbability);
      F.mvpMapPoints[i]->mStaticProbability = m;
      if (cfp::is_deletable(m, mProbability.options().map_point)) F.mvpMapPoints[i]->SetBadFlag();
    }
  }

  // Where inliers are counted, and where a keypoint is about to make a map point (whose M is its K).
  bool CountsAsInlier(const Frame& F, std::size_t i) const {
    return cfp::counts_as_inlier(F.mvWeight[i], mProbability.options());
  }
  bool MayCreate(float k) const { return cfp::may_create_map_point(k, mProbability.options()); }
  // Where a match is about to be drawn by a RANSAC.
  bool Trusts(std::size_t i, const MapPoint& MP) const {
    return cfp::counts_as_inlier(mProbability.weight(i, MP.mStaticProbability), mProbability.options());
  }

  void Reset() { mProbability.reset(); }
  const cfp::StaticProbability<typename Host::Camera>& Probability() const { return mProbability; }
  const cfp::FrameReport& Report() const { return mReport; }

 private:
  // What is known of each keypoint without a map point.
  void Remember(Frame& F) const {
    F.mvStaticProbability.resize(mProbability.state().size());
    for (std::size_t i = 0; i < F.mvStaticProbability.size(); ++i)
      F.mvStaticProbability[i] = mProbability.static_probability(i, -1.0F);
  }

  cfp::StaticProbability<typename Host::Camera> mProbability;
  cfp::FrameReport mReport;
  std::vector<std::int32_t> mMatch;
  std::vector<float> mM;
};
// [glue]

}  // namespace cfp_integration
