/// @file frame.hpp
/// What a host hands over for one frame, and the types that the steps of a frame share. Everything is a view of the
/// host's own arrays; everything but the keypoints may be missing.
#pragma once

#include <optional>

#include "cfp/core/span.hpp"
#include "cfp/core/types.hpp"
#include "cfp/detection/box_tracker_types.hpp"
#include "cfp/frame/descriptor_matching.hpp"
#include "cfp/frame/label_image.hpp"
#include "cfp/geometry/flow_pairs.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/math/uncertain_motion.hpp"

namespace cfp {

/// Where a keypoint lies relative to the objects of its frame.
enum class KeypointLabel : std::uint8_t {
  outside,     ///< on no object that was reported: K = 1, never changed
  foreground,  ///< on the object of its box
  background,  ///< inside its box, behind the object or before it
  invalid      ///< its pixel is not finite: K = 0, and no evidence for or against a map point
};

/// The box of a keypoint in none.
inline constexpr std::int32_t no_box = -1;
/// The match of a keypoint without one.
inline constexpr std::int32_t no_match = -1;
/// The object of a keypoint on none.
inline constexpr std::int32_t no_object = -1;

/// Frame k. All pixels are those of the image in which the objects were detected; the camera knows its distortion.
template <typename Scalar>
struct Frame {
  double timestamp_s = 0;
  PointSpan<Scalar, 2> keypoints;
  /// One per keypoint, metres along z; not positive or not finite: no depth there. Empty: all of a box is foreground.
  span<const Scalar> depths;
  /// Of the object detector, all classes. Not set: it did not run on this frame. Set and empty: it saw nothing.
  std::optional<span<const Detection<Scalar>>> detections;
  FlowPairs<Scalar> flow;  ///< empty: the objects are unknown
  /// For hosts that segment: per keypoint, the index of the detection it lies on, or no_object. It then decides what in
  /// a box lies on the object, in place of the depths. A detection that it never names, and a compensated box, are
  /// treated as if there were no mask.
  span<const std::int32_t> object_of_keypoint;
  /// The same as an image, which also labels the flow pairs: label v belongs to detection v - 1.
  LabelImage labels;
  DescriptorSpan descriptors;  ///< binary, one per keypoint: `fine` then matches what lies in boxes by itself
  span<const Scalar> map_point_probability;  ///< M per keypoint if matches are known by now, negative: no map point
  /// The camera's motion since frame k-1, if the host knows it by now, and its standard deviations in metres and
  /// radians: {T, 0.003, 0.001}. Flow with depths is fused with it; where the two differ by more than their covariances
  /// allow, this motion is dropped (FrameReport::motion_refused), or that of the flow if this one explains most of its
  /// outliers. Flow without depths refines it, with a larger covariance where the flow contradicts it (motion_refused,
  /// too; refine_camera_motion). The host's F takes precedence unless this motion is exact. {T, 0, 0} means exact: an
  /// error of a millimetre then looks like motion of whoever stands nearby. Not set: the motion of the previous frame
  /// is extrapolated, see FlowModelOptions::camera_acceleration_m_s2.
  std::optional<UncertainMotion<double>> T_cur_prev;
  std::optional<Matrix3<Scalar>> fundamental;  ///< F of the undistorted flow pairs, if the host has an exact one
  /// Homography from the previous image to this one, applied to the predicted boxes (rotation_homography). Not set:
  /// estimated from the flow outside the boxes (image_motion.hpp). Identity: the boxes follow their own motion only.
  std::optional<Matrix3<Scalar>> image_motion;
};

/// The pose that the host's optimiser found with the coarse weights.
struct PoseEstimate {
  SE3<double> T_cur_prev;   ///< maps points of camera k-1 into camera k
  std::size_t inliers = 0;  ///< N_BA: observations that the pose rests on; of a filter: the tracks that it weighed
};

}  // namespace cfp
