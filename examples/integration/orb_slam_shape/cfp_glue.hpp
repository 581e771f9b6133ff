// All that an ORB-SLAM-like system needs to use cfp: this class, one member in MapPoint (mStaticProbability), and the
// calls marked "cfp:" in tracking.hpp.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "cfp/frame/static_probability.hpp"
#include "host.hpp"

// [glue]
class StaticWeights {
 public:
  StaticWeights(const Calibration& c, int personClass)
      : mProbability(cfp::PinholeCamera<float>{c.fx, c.fy, c.cx, c.cy}, options(c, personClass)) {}

  // In Track(), before anything is matched.
  void NewFrame(const Frame& F) {
    cfp::Frame<float> frame;
    frame.timestamp_s = F.mTimeStamp;
    frame.keypoints = {&F.mvKeysUn.data()->pt.x, F.mvKeysUn.size(), sizeof(KeyPoint)};
    frame.depths = F.mvDepth;
    frame.descriptors = {F.mDescriptors.data(), F.mvKeysUn.size(), 32, 32};
    frame.flow = {F.mvFlowPrevious, F.mvFlowCurrent};
    mDetections.clear();
    for (const BoundingBox& b : F.mvBoxes) mDetections.push_back({{b.x1, b.y1, b.x2, b.y2}, b.classId, b.score});
    frame.detections = mDetections;
    mReport = mProbability.coarse(frame).report;
  }

  // After the first pose of the frame, when the last frame has one, too. Every M learns from the frame.
  void FirstPose(Frame& F, const Frame& last, int nInliers) {
    std::unordered_map<const MapPoint*, std::int32_t> indexInLast;
    for (std::size_t j = 0; j < last.mvpMapPoints.size(); ++j) {
      if (last.mvpMapPoints[j]) indexInLast[last.mvpMapPoints[j]] = static_cast<std::int32_t>(j);
    }
    mMatch.assign(F.mvKeysUn.size(), cfp::no_match);
    mM.assign(F.mvKeysUn.size(), -1.0F);
    for (std::size_t i = 0; i < F.mvpMapPoints.size(); ++i) {
      if (!F.mvpMapPoints[i]) continue;
      mM[i] = F.mvpMapPoints[i]->mStaticProbability;
      const auto found = indexInLast.find(F.mvpMapPoints[i]);
      if (found != indexInLast.end()) mMatch[i] = found->second;
    }
    const Eigen::Matrix4d T = (F.mTcw * Inverse(last.mTcw)).cast<double>();
    const cfp::SE3<double> T_cur_prev{T.topLeftCorner<3, 3>(), T.topRightCorner<3, 1>()};
    mReport = mProbability.fine({T_cur_prev, static_cast<std::size_t>(nInliers)}, mMatch, mM).report;
    for (std::size_t i = 0; i < F.mvpMapPoints.size(); ++i) Learn(F.mvpMapPoints[i], mM[i]);
  }

  // In TrackLocalMap(): M of the points that SearchLocalPoints has just found learns, too.
  void Joined(const Frame& F, std::size_t i) {
    Learn(F.mvpMapPoints[i], mProbability.updated_map_point(i, F.mvpMapPoints[i]->mStaticProbability));
  }

  // In Optimizer::PoseOptimization(): the information is multiplied by it, 0 leaves the edge out.
  float Weight(const Frame& F, std::size_t i) const {
    return mProbability.weight(i, F.mvpMapPoints[i]->mStaticProbability);
  }
  // Where mnMatchesInliers is counted.
  bool CountsAsInlier(const Frame& F, std::size_t i) const {
    return cfp::counts_as_inlier(Weight(F, i), mProbability.options());
  }
  // In CreateNewKeyFrame(), before a point is made of a keypoint with depth, and M of the new point.
  bool MayCreate(std::size_t i) const { return mProbability.may_create_map_point(i); }
  float Initial(std::size_t i) const { return mProbability.state().static_probability[i]; }
  const cfp::FrameReport& Report() const { return mReport; }

 private:
  static cfp::FrameOptions options(const Calibration& c, int personClass) {
    cfp::FrameOptions o;
    o.classes = {{personClass, true}};
    o.tracker.image_width = c.width;
    o.tracker.image_height = c.height;
    return o;
  }
  void Learn(MapPoint* pMP, float m) const {
    if (!pMP) return;
    pMP->mStaticProbability = m;
    if (cfp::is_deletable(m, mProbability.options().map_point)) pMP->SetBadFlag();
  }

  cfp::StaticProbability<cfp::PinholeCamera<float>> mProbability;
  cfp::FrameReport mReport;
  std::vector<cfp::Detection<float>> mDetections;
  std::vector<std::int32_t> mMatch;
  std::vector<float> mM;
};
// [glue]
