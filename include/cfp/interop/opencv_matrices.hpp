/// @file opencv_matrices.hpp
/// What a cv::Mat holds as cfp's values and back: depths at pixels, a pose, a camera. Needs opencv2/core's headers and
/// none of its libraries, as opencv.hpp, which includes it.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include <opencv2/core/mat.hpp>

#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"
#include "cfp/core/status.hpp"
#include "cfp/geometry/kannala_brandt_camera.hpp"
#include "cfp/geometry/radial_tangential_camera.hpp"
#include "cfp/math/se3.hpp"

namespace cfp {
namespace detail {
inline namespace CFP_ISA {

[[nodiscard]] inline bool is_matrix(const cv::Mat& matrix) noexcept {
  return matrix.dims == 2 && matrix.data != nullptr && matrix.rows > 0 && matrix.cols > 0;
}
[[nodiscard]] inline bool is_real_matrix(const cv::Mat& matrix) noexcept {
  return is_matrix(matrix) && (matrix.type() == CV_32FC1 || matrix.type() == CV_64FC1);
}
[[nodiscard]] inline bool is_pose_matrix(const cv::Mat& matrix) noexcept {
  return is_real_matrix(matrix) && matrix.cols == 4 && (matrix.rows == 4 || matrix.rows == 3);
}

// cv::Mat::ptr checks in debug builds by calling the library; the address arithmetic does not.
template <typename T>
[[nodiscard]] T* row_of(const cv::Mat& matrix, int row) noexcept {
  return reinterpret_cast<T*>(matrix.data + matrix.step.p[0] * static_cast<std::size_t>(row));
}

// An element of a CV_16U, CV_32F or CV_64F matrix.
[[nodiscard]] inline double element(const cv::Mat& matrix, int row, int column) noexcept {
  if (matrix.type() == CV_16UC1) return row_of<const std::uint16_t>(matrix, row)[column];
  if (matrix.type() == CV_32FC1) return static_cast<double>(row_of<const float>(matrix, row)[column]);
  return row_of<const double>(matrix, row)[column];
}

// Metres at the nearest pixel, -1: none.
[[nodiscard]] inline float depth_at(const cv::Mat& depth, double x, double y, double metres_per_unit) noexcept {
  // Compared before the conversion to int: NaN and values beyond int take the failing branch.
  const double column = x + 0.5, row = y + 0.5;
  if (!(column >= 0 && column < depth.cols && row >= 0 && row < depth.rows)) return -1.0F;
  const double metres = metres_per_unit * element(depth, static_cast<int>(row), static_cast<int>(column));
  const bool valid = metres > 0 && metres <= static_cast<double>((std::numeric_limits<float>::max)());
  return valid && static_cast<float>(metres) > 0 ? static_cast<float>(metres) : -1.0F;
}

// Whether the depths to both sides are no plane's with this one: over a plane, 1 / z is linear in the image.
[[nodiscard]] inline bool is_depth_edge(const cv::Mat& depth, double x, double y, double metres_per_unit, float metres,
                                        double edge_px) noexcept {
  constexpr double direction[4][2] = {{1, 0}, {0, 1}, {0.7071, 0.7071}, {0.7071, -0.7071}};
  for (const double(&d)[2] : direction) {
    const float before = depth_at(depth, x - edge_px * d[0], y - edge_px * d[1], metres_per_unit);
    const float after = depth_at(depth, x + edge_px * d[0], y + edge_px * d[1], metres_per_unit);
    if (before > 0 && after > 0 && std::abs(metres / before + metres / after - 2) > 0.05F) return true;
  }
  return false;
}

// fx, fy, cx, cy and four or `most` coefficients, or none; false for what is no camera.
template <typename Scalar>
[[nodiscard]] bool read_camera(const cv::Mat& camera_matrix, const cv::Mat& distortion, int most,
                               Scalar (&values)[9]) noexcept {
  if (!is_real_matrix(camera_matrix) || camera_matrix.rows != 3 || camera_matrix.cols != 3) return false;
  const PinholeCamera<double> pinhole{element(camera_matrix, 0, 0), element(camera_matrix, 1, 1),
                                      element(camera_matrix, 0, 2), element(camera_matrix, 1, 2)};
  const Matrix3<double> K = pinhole.matrix();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      if (element(camera_matrix, row, column) != K(row, column)) return false;
    }
  }
  const PinholeCamera<Scalar> read = pinhole.template cast<Scalar>();
  values[0] = read.fx, values[1] = read.fy, values[2] = read.cx, values[3] = read.cy;
  if (distortion.data != nullptr) {  // empty() is a call of the library
    const int count = distortion.rows * distortion.cols;
    if (!is_real_matrix(distortion) || (distortion.rows != 1 && distortion.cols != 1)) return false;
    if (count != 4 && count != most) return false;
    for (int i = 0; i < count; ++i)
      values[4 + i] =
          static_cast<Scalar>(element(distortion, distortion.rows == 1 ? 0 : i, distortion.rows == 1 ? i : 0));
  }
  return read.fx > 0 && read.fy > 0 && std::all_of(values, values + 9, [](Scalar value) { return is_finite(value); });
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// Depth in metres at each pixel, from a single-channel CV_16U, CV_32F or CV_64F image whose values times
/// `metres_per_unit` are metres (TUM RGB-D: 1.0 / 5000; millimetres: 0.001; metres: 1). The nearest pixel is read,
/// pixel centres at integer coordinates; ORB-SLAM2 cuts the fraction off instead. -1, ORB-SLAM2's mark for "none", for
/// a pixel outside the image and for depth that is zero, negative or not finite. `edge_px` > 0: -1 also at the edge of
/// a surface, where the depth may be the other surface's, as colour and depth differ in time and place and stereo
/// widens what is near: where the depths `edge_px` to either side, along the rows, the columns or a diagonal, are off
/// from a plane through all three by more than 5 %. For the depths of Frame::flow (benchmarks/studies/
/// object_flow_study.cpp). depth_m.size() == pixels.size(). invalid_input, and -1 everywhere: no image, another type,
/// or metres_per_unit not positive and finite. not_enough_data: no pixel has depth. Allocates nothing.
inline Status sample_depth(const cv::Mat& depth, const PointSpan<float, 2>& pixels, double metres_per_unit,
                           span<float> depth_m, double edge_px = 0) noexcept {
  CFP_ASSERT(depth_m.size() == pixels.size());
  for (float& metres : depth_m) metres = -1.0F;
  if (!detail::is_real_matrix(depth) && !(detail::is_matrix(depth) && depth.type() == CV_16UC1))
    return Status::invalid_input;
  if (!(metres_per_unit > 0 && is_finite(metres_per_unit))) return Status::invalid_input;
  Status status = Status::not_enough_data;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const double x = static_cast<double>(pixels(i, 0)), y = static_cast<double>(pixels(i, 1));
    const float metres = detail::depth_at(depth, x, y, metres_per_unit);
    if (!(metres > 0) || (edge_px > 0 && detail::is_depth_edge(depth, x, y, metres_per_unit, metres, edge_px)))
      continue;
    depth_m[i] = metres;
    status = Status::ok;
  }
  return status;
}

/// A pose from the upper 3x4 part of a 4x4 or 3x4 matrix, CV_32F or CV_64F (ORB-SLAM2's Tcw is T_cam_world). The
/// rotation is normalised, as products of float matrices drift. invalid_input, and pose untouched: another size or
/// type, or what is no rigid motion (see `is_rigid_motion`).
template <typename Scalar>
[[nodiscard]] Status to_se3(const cv::Mat& matrix, SE3<Scalar>& pose) noexcept {
  if (!detail::is_pose_matrix(matrix)) return Status::invalid_input;
  SE3<double> read;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) read.rotation(row, column) = detail::element(matrix, row, column);
    read.translation[row] = detail::element(matrix, row, 3);
  }
  if (!is_rigid_motion(read)) return Status::invalid_input;
  read.rotation = normalized_rotation(read.rotation);
  pose = read.template cast<Scalar>();
  return Status::ok;
}

/// A camera from OpenCV's matrices, CV_32F or CV_64F: the 3x3 camera matrix, and k1, k2, p1, p2 or k1, k2, p1, p2, k3
/// as a row or a column (empty: no distortion). invalid_input, and camera untouched: another size or type, a skew, a
/// last row but (0, 0, 1), a focal length that is not positive, an element that is not finite. For images without
/// distortion: camera.pinhole().
template <typename Scalar>
[[nodiscard]] Status to_camera(const cv::Mat& camera_matrix, const cv::Mat& distortion,
                               RadialTangentialCamera<Scalar>& camera) noexcept {
  Scalar v[9] = {};
  if (!detail::read_camera(camera_matrix, distortion, 5, v)) return Status::invalid_input;
  camera = {v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7], v[8]};
  return Status::ok;
}
/// The same of OpenCV's fisheye model, whose coefficients are k1, k2, k3, k4.
template <typename Scalar>
[[nodiscard]] Status to_camera(const cv::Mat& camera_matrix, const cv::Mat& distortion,
                               KannalaBrandtCamera<Scalar>& camera) noexcept {
  Scalar v[9] = {};
  if (!detail::read_camera(camera_matrix, distortion, 4, v)) return Status::invalid_input;
  camera = {v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7]};
  return Status::ok;
}

/// Writes the pose into the upper 3x4 part of the caller's 4x4 or 3x4 matrix, CV_32F or CV_64F, and (0, 0, 0, 1) into
/// the fourth row if there is one. invalid_input, and the matrix untouched, for another size or type. The matrix shares
/// its elements with its shallow copies, as always in OpenCV.
template <typename Scalar>
[[nodiscard]] Status write_pose(const SE3<Scalar>& pose, cv::Mat& matrix) noexcept {
  if (!detail::is_pose_matrix(matrix)) return Status::invalid_input;
  const Matrix4<Scalar> T = pose.matrix();
  for (int row = 0; row < matrix.rows; ++row) {
    for (int column = 0; column < 4; ++column) {
      if (matrix.type() == CV_32FC1)
        detail::row_of<float>(matrix, row)[column] = static_cast<float>(T(row, column));
      else
        detail::row_of<double>(matrix, row)[column] = static_cast<double>(T(row, column));
    }
  }
  return Status::ok;
}

}  // namespace CFP_ISA
}  // namespace cfp
