/// @file opencv.hpp
/// OpenCV's types as cfp's views and values. It needs opencv2/core's headers and none of its libraries (no OpenCV
/// object is made here, elements are read through their addresses), so including it forces nothing on a program. Names
/// follow ORB-SLAM2-like systems: keypoints in std::vector<cv::KeyPoint>, depth as CV_16U or CV_32F, poses as 4x4
/// CV_32F.
#pragma once

#include <vector>

#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include "cfp/core/span.hpp"
#include "cfp/frame/descriptor_matching.hpp"
#include "cfp/frame/label_image.hpp"
#include "cfp/geometry/box.hpp"
#include "cfp/interop/opencv_matrices.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// Views of OpenCV's point vectors; valid while the vector is neither destroyed nor resized. Nothing is copied.
template <typename Scalar>
[[nodiscard]] PointSpan<Scalar, 2> view(const std::vector<cv::Point_<Scalar>>& points) noexcept {
  return {reinterpret_cast<const Scalar*>(points.data()), points.size(), sizeof(cv::Point_<Scalar>)};
}
template <typename Scalar>
[[nodiscard]] PointSpan<Scalar, 3> view(const std::vector<cv::Point3_<Scalar>>& points) noexcept {
  return {reinterpret_cast<const Scalar*>(points.data()), points.size(), sizeof(cv::Point3_<Scalar>)};
}
/// The positions `pt` of keypoints, in pixels, where they lie among the other fields.
[[nodiscard]] inline PointSpan<float, 2> view(const std::vector<cv::KeyPoint>& keypoints) noexcept {
  return {reinterpret_cast<const float*>(keypoints.data()), keypoints.size(), sizeof(cv::KeyPoint)};
}
template <typename Element>
void view(const std::vector<Element>&& temporary) = delete;

/// The rows of a CV_8U matrix of binary descriptors, for Frame::descriptors; empty for any other matrix.
[[nodiscard]] inline DescriptorSpan descriptor_view(const cv::Mat& descriptors) noexcept {
  if (!detail::is_matrix(descriptors) || descriptors.type() != CV_8UC1) return {};
  return {descriptors.data, static_cast<std::size_t>(descriptors.rows), static_cast<std::size_t>(descriptors.cols),
          descriptors.step.p[0]};
}

/// A CV_8U label image, for Frame::labels; empty for any other image.
[[nodiscard]] inline LabelImage label_view(const cv::Mat& labels) noexcept {
  if (!detail::is_matrix(labels) || labels.type() != CV_8UC1) return {};
  return {labels.data, labels.cols, labels.rows, labels.step.p[0]};
}

/// The box of a rectangle: [x, x + width] x [y, y + height], the borders OpenCV draws between pixels. Improper, as the
/// rectangle is empty, when width or height is not positive. Box<float> or Box<double>: to_box<float>(rectangle).
template <typename Scalar, typename Coordinate>
[[nodiscard]] constexpr Box<Scalar> to_box(const cv::Rect_<Coordinate>& rectangle) noexcept {
  const auto x = static_cast<Scalar>(rectangle.x), y = static_cast<Scalar>(rectangle.y);
  return {x, y, x + static_cast<Scalar>(rectangle.width), y + static_cast<Scalar>(rectangle.height)};
}

}  // namespace CFP_ISA
}  // namespace cfp
