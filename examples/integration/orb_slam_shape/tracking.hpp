// ORB-SLAM2's Tracking for RGB-D in miniature: TrackWithMotionModel, TrackReferenceKeyFrame, Relocalization and
// TrackLocalMap, with matches that come into being inside them. The calls to cfp are marked; without a StaticWeights
// the class is the host as it was.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <list>
#include <vector>

#include "cfp/robust/pnp_ransac.hpp"
#include "cfp_glue.hpp"
#include "host.hpp"
#include "pose_optimization.hpp"

class Tracking {
 public:
  enum State { NOT_INITIALIZED, OK, LOST };

  Tracking(const Calibration& calibration, StaticWeights* pWeights) : mK(calibration), mpWeights(pWeights) {}

  // The pose of the camera, and whether there is one.
  bool Track(Frame frame) {
    mCurrentFrame = std::move(frame);
    mCurrentFrame.mvpMapPoints.assign(mCurrentFrame.mvKeysUn.size(), nullptr);
    mCurrentFrame.mvbOutlier.assign(mCurrentFrame.mvKeysUn.size(), false);
    if (mpWeights)  // cfp: boxes, objects, depth
      mpWeights->NewFrame(mCurrentFrame, mCurrentFrame.mvBoxes,
                          {mCurrentFrame.mvFlowPrevious, mCurrentFrame.mvFlowCurrent});
    if (mState == NOT_INITIALIZED) {
      CreateNewKeyFrame();
      mState = OK;
    } else {
      int nInliers = 0;
      if (mState == OK) {
        nInliers = mbVelocity ? TrackWithMotionModel() : 0;
        if (nInliers < 10) nInliers = TrackReferenceKeyFrame();
      } else {
        nInliers = Relocalization();
      }
      bool bOK = nInliers >= 10;
      if (bOK && mpWeights && mLastFrame.mbHasPose)
        mpWeights->FirstPose(mCurrentFrame, mLastFrame);  // cfp: constraints of the first pose
      if (bOK) bOK = TrackLocalMap();
      mState = bOK ? OK : LOST;
      mCurrentFrame.mbHasPose = bOK;
      mbVelocity = bOK && mLastFrame.mbHasPose;
      if (mbVelocity) mVelocity = mCurrentFrame.mTcw * Inverse(mLastFrame.mTcw);
      for (std::size_t i = 0; i < mCurrentFrame.mvpMapPoints.size(); ++i) {
        MapPoint* const p = mCurrentFrame.mvpMapPoints[i];
        if (p && (mCurrentFrame.mvbOutlier[i] || p->isBad() || p->mnObservations < 1))
          mCurrentFrame.mvpMapPoints[i] = nullptr;
      }
      if (bOK && NeedNewKeyFrame()) CreateNewKeyFrame();
    }
    mLastFrame = mCurrentFrame;
    return mState == OK;
  }

  const Frame& CurrentFrame() const { return mCurrentFrame; }
  int MatchesInliers() const { return mnMatchesInliers; }

 private:
  // Temporal points for the keypoints of the last frame that have depth and no map point, as UpdateLastFrame does.
  void UpdateLastFrame() {
    mlpTemporalPoints.clear();
    const Eigen::Matrix4f Twc = Inverse(mLastFrame.mTcw);
    for (std::size_t j = 0; j < mLastFrame.mvKeysUn.size(); ++j) {
      if (mLastFrame.mvpMapPoints[j] || mLastFrame.mvDepth[j] <= 0) continue;
      mlpTemporalPoints.emplace_back(UnprojectStereo(mLastFrame, j, Twc), mLastFrame.Row(j));
      if (mpWeights) mlpTemporalPoints.back().mStaticProbability = mLastFrame.mvStaticProbability[j];  // cfp: M = K
      mLastFrame.mvpMapPoints[j] = &mlpTemporalPoints.back();
    }
  }

  int TrackWithMotionModel() {
    UpdateLastFrame();
    mCurrentFrame.mTcw = mVelocity * mLastFrame.mTcw;
    int nMatches = SearchByProjection(mLastFrame.mvpMapPoints, 15, 1.0F);
    if (nMatches < 20) nMatches += SearchByProjection(mLastFrame.mvpMapPoints, 30, 1.0F);
    return nMatches < 20 ? 0 : PoseOptimization(mCurrentFrame, mK, mpWeights);
  }

  int TrackReferenceKeyFrame() {
    if (mvKeyFrames.empty()) return 0;
    mCurrentFrame.mTcw = mLastFrame.mTcw;
    const int nMatches = SearchByDescriptor(mvKeyFrames.back());
    return nMatches < 15 ? 0 : PoseOptimization(mCurrentFrame, mK, mpWeights);
  }

  // PnP in RANSAC against the keyframes, newest first, then the optimiser.
  int Relocalization() {
    for (auto keyframe = mvKeyFrames.rbegin(); keyframe != mvKeyFrames.rend(); ++keyframe) {
      std::fill(mCurrentFrame.mvpMapPoints.begin(), mCurrentFrame.mvpMapPoints.end(), nullptr);
      if (SearchByDescriptor(*keyframe) < 15) continue;
      std::vector<Eigen::Vector3f> points;
      std::vector<std::array<float, 2>> pixels;
      std::vector<float> weights;
      if (mpWeights) mpWeights->Weigh(mCurrentFrame);  // cfp
      for (std::size_t i = 0; i < mCurrentFrame.mvpMapPoints.size(); ++i) {
        if (!mCurrentFrame.mvpMapPoints[i]) continue;
        points.push_back(mCurrentFrame.mvpMapPoints[i]->GetWorldPos());
        pixels.push_back({mCurrentFrame.mvKeysUn[i].pt.x, mCurrentFrame.mvKeysUn[i].pt.y});
        weights.push_back(mpWeights ? mCurrentFrame.mvWeight[i] : 1.0F);  // cfp
      }
      const cfp::PinholeCamera<float> camera{mK.fx, mK.fy, mK.cx, mK.cy};
      const auto pose = cfp::pnp_ransac(points, pixels, weights, camera, cfp::PnpRansacOptions{}, mRansacWorkspace);
      if (!pose.found()) continue;
      mCurrentFrame.mTcw.topLeftCorner<3, 3>() = pose.T_cam_world.rotation;
      mCurrentFrame.mTcw.topRightCorner<3, 1>() = pose.T_cam_world.translation;
      const int nInliers = PoseOptimization(mCurrentFrame, mK, mpWeights);
      if (nInliers >= 30) return nInliers;
    }
    return 0;
  }

  bool TrackLocalMap() {
    std::vector<MapPoint*> local;
    for (std::size_t k = mvKeyFrames.size(); k-- > 0 && mvKeyFrames.size() - k <= 10;)
      local.insert(local.end(), mvKeyFrames[k].mvpMapPoints.begin(), mvKeyFrames[k].mvpMapPoints.end());
    SearchByProjection(local, 5, 0.8F);
    PoseOptimization(mCurrentFrame, mK, mpWeights);
    if (mpWeights) mpWeights->Learn(mCurrentFrame);  // cfp: every M, once
    mnMatchesInliers = 0;
    for (std::size_t i = 0; i < mCurrentFrame.mvpMapPoints.size(); ++i) {
      if (!mCurrentFrame.mvpMapPoints[i] || mCurrentFrame.mvbOutlier[i]) continue;
      if (!mpWeights || mpWeights->CountsAsInlier(mCurrentFrame, i)) ++mnMatchesInliers;  // cfp
    }
    return mnMatchesInliers >= 30;
  }

  bool NeedNewKeyFrame() const {
    return mCurrentFrame.mnId >= mnLastKeyFrameId + 10 ||
           (mCurrentFrame.mnId > mnLastKeyFrameId + 2 && mnMatchesInliers < mnReferenceMatches / 2);
  }

  void CreateNewKeyFrame() {
    mCurrentFrame.mbHasPose = true;
    const Eigen::Matrix4f Twc = Inverse(mCurrentFrame.mTcw);
    int nPoints = 0;
    for (std::size_t i = 0; i < mCurrentFrame.mvKeysUn.size(); ++i) {
      MapPoint*& pMP = mCurrentFrame.mvpMapPoints[i];
      if (pMP) {
        ++nPoints;
        continue;
      }
      if (mCurrentFrame.mvDepth[i] <= 0) continue;
      const float k = mpWeights ? mCurrentFrame.mvStaticProbability[i] : 1.0F;
      if (mpWeights && !mpWeights->MayCreate(k)) continue;  // cfp: no landmark of what moves
      mlpMapPoints.emplace_back(UnprojectStereo(mCurrentFrame, i, Twc), mCurrentFrame.Row(i));
      mlpMapPoints.back().mStaticProbability = k;  // cfp
      pMP = &mlpMapPoints.back();
      pMP->mnObservations = 1;
      ++nPoints;
    }
    mvKeyFrames.push_back(mCurrentFrame);
    mnLastKeyFrameId = mCurrentFrame.mnId;
    mnReferenceMatches = nPoints;
  }

  // ORBmatcher's searches: by projection into the current frame, and over all descriptors.
  int SearchByProjection(const std::vector<MapPoint*>& points, float th, float ratio) {
    int nMatches = 0;
    for (MapPoint* const p : mCurrentFrame.mvpMapPoints) {
      if (p) p->mnLastFrameSeen = mCurrentFrame.mnId;
    }
    for (MapPoint* const p : points) {
      if (!p || p->isBad() || p->mnLastFrameSeen == mCurrentFrame.mnId) continue;
      const Eigen::Vector3f x = (mCurrentFrame.mTcw * p->GetWorldPos().homogeneous()).head<3>();
      if (x.z() <= 0) continue;
      const float u = mK.fx * x.x() / x.z() + mK.cx, v = mK.fy * x.y() / x.z() + mK.cy;
      int best = 101, second = 256;
      std::size_t at = 0;
      for (std::size_t i = 0; i < mCurrentFrame.mvKeysUn.size(); ++i) {
        const auto& pt = mCurrentFrame.mvKeysUn[i].pt;
        if (mCurrentFrame.mvpMapPoints[i] || std::abs(pt.x - u) > th || std::abs(pt.y - v) > th) continue;
        const int d = DescriptorDistance(p->GetDescriptor().data(), mCurrentFrame.Row(i));
        second = std::min(second, std::max(d, best));
        if (d < best) best = d, at = i;
      }
      if (best > 100 || !(static_cast<float>(best) <= ratio * static_cast<float>(second))) continue;
      mCurrentFrame.mvpMapPoints[at] = p;
      p->mnLastFrameSeen = mCurrentFrame.mnId;
      ++nMatches;
    }
    return nMatches;
  }

  int SearchByDescriptor(const Frame& keyframe) {
    int nMatches = 0;
    for (MapPoint* const p : keyframe.mvpMapPoints) {
      if (!p || p->isBad()) continue;
      int best = 51;
      std::size_t at = 0;
      for (std::size_t i = 0; i < mCurrentFrame.mvKeysUn.size(); ++i) {
        if (mCurrentFrame.mvpMapPoints[i]) continue;
        const int d = DescriptorDistance(p->GetDescriptor().data(), mCurrentFrame.Row(i));
        if (d < best) best = d, at = i;
      }
      if (best > 50) continue;
      mCurrentFrame.mvpMapPoints[at] = p;
      ++nMatches;
    }
    return nMatches;
  }

  Eigen::Vector3f UnprojectStereo(const Frame& F, std::size_t i, const Eigen::Matrix4f& Twc) const {
    const float z = F.mvDepth[i];
    const Eigen::Vector4f x((F.mvKeysUn[i].pt.x - mK.cx) * z / mK.fx, (F.mvKeysUn[i].pt.y - mK.cy) * z / mK.fy, z, 1);
    return (Twc * x).head<3>();
  }

  Calibration mK;
  StaticWeights* mpWeights;
  State mState = NOT_INITIALIZED;
  Frame mCurrentFrame, mLastFrame;
  bool mbVelocity = false;
  Eigen::Matrix4f mVelocity;
  std::vector<Frame> mvKeyFrames;
  std::list<MapPoint> mlpMapPoints, mlpTemporalPoints;
  cfp::PnpRansacWorkspace mRansacWorkspace;
  long mnLastKeyFrameId = 0;
  int mnMatchesInliers = 0, mnReferenceMatches = 0;
};
