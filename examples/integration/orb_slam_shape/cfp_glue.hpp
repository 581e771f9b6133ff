// All that this host needs to use cfp: the names of its members, Frame::mvStaticProbability and mvWeight,
// MapPoint::mStaticProbability, and the calls marked "cfp:" in tracking.hpp. The class itself is the one for ORB-SLAM2.
#pragma once

#include "../orb_slam/static_weights.hpp"
#include "host.hpp"

extern template class cfp::StaticProbability<cfp::PinholeCamera<float>>;  // compiled in engines.cc alone

// [glue]
struct Miniature {
  using Frame = ::Frame;
  using Camera = cfp::PinholeCamera<float>;
  static cfp::PointSpan<float, 2> Keys(const Frame& F) {
    return {reinterpret_cast<const float*>(F.mvKeysUn.data()), F.mvKeysUn.size(), sizeof(KeyPoint)};
  }
  static cfp::DescriptorSpan Descriptors(const Frame& F) {
    return {F.mDescriptors.data(), F.mvKeysUn.size(), sizeof(Descriptor), sizeof(Descriptor)};
  }
  static cfp::SE3<double> Pose(const Frame& F) {
    return {F.mTcw.topLeftCorner<3, 3>().cast<double>(), F.mTcw.topRightCorner<3, 1>().cast<double>()};
  }
};
using StaticWeights = cfp_integration::StaticWeights<Miniature>;
// [glue]

inline StaticWeights MakeStaticWeights(const Calibration& c, int personClass) {
  cfp::FrameOptions options;
  options.classes = {{personClass, true}};
  options.tracker.image_width = c.width;
  options.tracker.image_height = c.height;
  return {cfp::PinholeCamera<float>{c.fx, c.fy, c.cx, c.cy}, options};
}
