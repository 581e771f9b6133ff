// What StaticWeights must know of ORB-SLAM2 and ORB-SLAM3, and optical flow for both. Templates, so that nothing of
// theirs is needed here: `StaticWeights<OrbSlam2<ORB_SLAM2::Frame>>`.
#pragma once

#include <optional>
#include <vector>

#include <opencv2/core.hpp>

#include "../../support/room_mask.hpp"
#include "cfp/frame/frame_state.hpp"
#include "cfp/geometry/any_camera.hpp"
#include "cfp/interop/opencv.hpp"
#include "cfp/interop/opencv_flow.hpp"
#include "static_weights.hpp"

// Compiled in ../engines.cc alone: Tracking.cc includes this header, and is compiled often.
extern template class cfp::StaticProbability<cfp::AnyCamera<float>>;

namespace cfp_integration {

// Objects are detected in the image as the lens gives it, so the keypoints are those before undistortion (mvKeys, not
// mvKeysUn) and the camera is the one with its distortion.
template <typename FrameType>
struct OrbSlam2 {
  using Frame = FrameType;
  using Camera = cfp::AnyCamera<float>;
  // Of Tracking's members; none: it is not supported.
  static std::optional<Camera> CameraOf(const cv::Mat& K, const cv::Mat& distortion) {
    cfp::RadialTangentialCamera<float> camera;
    if (cfp::to_camera(K, distortion, camera) != cfp::Status::ok) return std::nullopt;
    return Camera{camera};
  }
  static cfp::PointSpan<float, 2> Keys(const Frame& F) { return cfp::view(F.mvKeys); }
  static cfp::DescriptorSpan Descriptors(const Frame& F) { return cfp::descriptor_view(F.mDescriptors); }
  static cfp::SE3<double> Pose(const Frame& F) {
    cfp::SE3<double> T_cam_world;
    return cfp::to_se3(F.mTcw, T_cam_world) == cfp::Status::ok ? T_cam_world : cfp::SE3<double>{};
  }
};

// ORB-SLAM3 1.0 has Sophus poses and cameras of two models. Not the pair of fisheye cameras (Nleft != -1).
template <typename FrameType>
struct OrbSlam3 : OrbSlam2<FrameType> {
  using Camera = typename OrbSlam2<FrameType>::Camera;
  template <typename Model>
  static std::optional<Camera> CameraOf(Model* model, const Model* second, const cv::Mat& K,
                                        const cv::Mat& distortion) {
    if (second != nullptr) return std::nullopt;
    if (model->GetType() != model->CAM_FISHEYE) return OrbSlam2<FrameType>::CameraOf(K, distortion);
    const auto p = [&](int i) { return model->getParameter(i); };
    return Camera{cfp::KannalaBrandtCamera<float>{p(0), p(1), p(2), p(3), p(4), p(5), p(6), p(7)}};
  }
  static cfp::SE3<double> Pose(const FrameType& F) {
    const auto T_cam_world = F.GetPose();
    return {T_cam_world.rotationMatrix().template cast<double>(), T_cam_world.translation().template cast<double>()};
  }
};

inline cfp::FrameOptions StaticWeightsOptions(int personClass, int width, int height) {
  cfp::FrameOptions options;
  options.classes = {{personClass, true}};
  options.tracker.image_width = width;
  options.tracker.image_height = height;
  return options;
}

// Flow from the image of the last call to this one; the views hold until the next call.
class FrameFlow {
 public:
  // gray as extracted from, depth in metres (empty: none), the keypoints of this frame, and what is known of the last
  // one: corners go to the room outside of its boxes and, by depth, behind the people in them, as far as possible.
  cfp::FlowPairs<float> Next(const cv::Mat& gray, const cv::Mat& depth, const std::vector<cv::KeyPoint>& keys,
                             const cfp::FrameState<float>& last) {
    mBoxes.clear();
    mPeople.clear();
    for (const auto& box : last.boxes) {
      mBoxes.push_back(box.box);
      mPeople.push_back({box.box, cfp::of_track(last.current.object_depths, box.id)});
    }
    cfp_examples::room_mask(gray.size(), mLastDepth, 1, mPeople, mRoom);
    mTracker.track(gray, mLastKeys, mBoxes, mRoom);
    cfp::FlowPairs<float> flow = mTracker.pairs();
    mDepths.resize(flow.previous.size());
    if (cfp::sample_depth(mLastDepth, flow.previous, 1, mDepths) == cfp::Status::ok) flow.previous_depths = mDepths;
    mLastKeys = keys;
    depth.copyTo(mLastDepth);
    return flow;
  }
  void Reset() { mTracker.reset(); }

 private:
  cfp::OpticalFlowTracker mTracker;
  std::vector<cv::KeyPoint> mLastKeys;
  cv::Mat mLastDepth, mRoom;
  std::vector<cfp::Box<float>> mBoxes;
  std::vector<cfp_examples::BoxedPerson> mPeople;
  std::vector<float> mDepths;
};

}  // namespace cfp_integration
