// ORB-SLAM2's classes in miniature, by its names: what a host has before it knows of cfp. Added for cfp are
// MapPoint::mStaticProbability, Frame::mvStaticProbability and Frame::mvWeight. No OpenCV, so that the example builds
// everywhere: keypoints and matrices are own types.
#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <cstring>
#include <list>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cfp/detection/box_tracker_types.hpp"

using Descriptor = std::array<std::uint8_t, 32>;

inline int DescriptorDistance(const std::uint8_t* a, const std::uint8_t* b) {
  std::size_t bits = 0;
  for (int i = 0; i < 32; i += 8) {
    std::uint64_t x, y;
    std::memcpy(&x, a + i, 8);
    std::memcpy(&y, b + i, 8);
    bits += std::bitset<64>(x ^ y).count();
  }
  return static_cast<int>(bits);
}

struct Calibration {
  float fx, fy, cx, cy;
  int width, height;
};

struct KeyPoint {  // cv::KeyPoint
  struct {
    float x, y;
  } pt;
  float size = 31, angle = -1, response = 0;
  int octave = 0, class_id = -1;
};

class MapPoint {
 public:
  MapPoint(const Eigen::Vector3f& position, const std::uint8_t* descriptor) : mWorldPos(position) {
    std::memcpy(mDescriptor.data(), descriptor, 32);
  }
  const Eigen::Vector3f& GetWorldPos() const { return mWorldPos; }
  const Descriptor& GetDescriptor() const { return mDescriptor; }
  bool isBad() const { return mbBad; }
  void SetBadFlag() { mbBad = true; }

  float mStaticProbability = 1;  // cfp: M
  long mnLastFrameSeen = -1;
  int mnObservations = 0;  // 0: a temporal point of the motion model

 private:
  Eigen::Vector3f mWorldPos;
  Descriptor mDescriptor;
  bool mbBad = false;
};

struct Frame {
  long mnId = 0;
  double mTimeStamp = 0;
  std::vector<KeyPoint> mvKeysUn;
  std::vector<float> mvDepth;              // -1: none
  std::vector<std::uint8_t> mDescriptors;  // 32 bytes each
  std::vector<MapPoint*> mvpMapPoints;
  std::vector<bool> mvbOutlier;
  bool mbHasPose = false;
  Eigen::Matrix4f mTcw = Eigen::Matrix4f::Identity();
  std::vector<float> mvStaticProbability, mvWeight;  // cfp: K, and the weight of the observation
  // of the detector and the optical flow, which a dynamic SLAM has besides
  std::vector<cfp::Detection<float>> mvBoxes;
  std::vector<std::array<float, 2>> mvFlowPrevious, mvFlowCurrent;

  const std::uint8_t* Row(std::size_t i) const { return mDescriptors.data() + 32 * i; }
};

inline Eigen::Matrix4f Inverse(const Eigen::Matrix4f& T) {
  Eigen::Matrix4f inverse = Eigen::Matrix4f::Identity();
  inverse.topLeftCorner<3, 3>() = T.topLeftCorner<3, 3>().transpose();
  inverse.topRightCorner<3, 1>() = -inverse.topLeftCorner<3, 3>() * T.topRightCorner<3, 1>();
  return inverse;
}
