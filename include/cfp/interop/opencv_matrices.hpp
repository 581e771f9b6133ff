/// @file opencv_matrices.hpp
/// What a cv::Mat holds as cfp's values and back: depths at pixels, a pose, a camera. Needs opencv2/core's headers and
/// none of its libraries, as opencv.hpp, which includes it.
#pragma once

#include <cstddef>
#include <cstring>
#include <limits>

#include <opencv2/core/mat.hpp>

#include <Eigen/Core>

#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"
#include "cfp/core/status.hpp"
#include "cfp/geometry/radial_tangential_camera.hpp"
#include "cfp/math/matrix3.hpp"
#include "cfp/math/se3.hpp"

namespace cfp {
namespace detail {
inline namespace CFP_ISA {

// cv::Mat::at checks in debug builds by calling the library; the address arithmetic does not.
template <typename T>
[[nodiscard]] T matrix_element(const cv::Mat& matrix, int row, int column) noexcept {
  T value;
  std::memcpy(
      &value,
      matrix.data + matrix.step.p[0] * static_cast<std::size_t>(row) + sizeof(T) * static_cast<std::size_t>(column),
      sizeof(T));
  return value;
}

[[nodiscard]] inline bool is_matrix(const cv::Mat& matrix) noexcept {
  return matrix.dims == 2 && matrix.data != nullptr && matrix.rows > 0 && matrix.cols > 0;
}

// An element of a CV_32F or CV_64F matrix.
[[nodiscard]] inline double real_element(const cv::Mat& matrix, int row, int column) noexcept {
  return matrix.type() == CV_32FC1 ? static_cast<double>(matrix_element<float>(matrix, row, column))
                                   : matrix_element<double>(matrix, row, column);
}

[[nodiscard]] inline bool is_real_matrix(const cv::Mat& matrix) noexcept {
  return is_matrix(matrix) && (matrix.type() == CV_32FC1 || matrix.type() == CV_64FC1);
}

template <typename T>
bool sample_depth_of(const cv::Mat& depth, const PointSpan<float, 2>& pixels, double metres_per_unit,
                     span<float> depth_m) noexcept {
  bool any = false;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    depth_m[i] = -1.0F;
    // Compared before the conversion to int: NaN and values beyond int take the failing branch.
    const double column = static_cast<double>(pixels(i, 0)) + 0.5, row = static_cast<double>(pixels(i, 1)) + 0.5;
    if (!(column >= 0 && column < depth.cols && row >= 0 && row < depth.rows)) continue;
    const double metres = metres_per_unit * static_cast<double>(matrix_element<T>(depth, static_cast<int>(row),
                                                                                  static_cast<int>(column)));
    if (!(metres > 0 && metres <= static_cast<double>((std::numeric_limits<float>::max)()))) continue;
    depth_m[i] = static_cast<float>(metres);
    any = any || depth_m[i] > 0;
  }
  return any;
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// Depth in metres at each pixel, from a single-channel CV_16U, CV_32F or CV_64F image whose values times
/// `metres_per_unit` are metres (TUM RGB-D: 1.0 / 5000; millimetres: 0.001; metres: 1). The nearest pixel is read,
/// pixel centres at integer coordinates; ORB-SLAM2 cuts the fraction off instead. -1, ORB-SLAM2's mark for "none", for
/// a pixel outside the image and for depth that is zero, negative or not finite. depth_m.size() == pixels.size().
/// invalid_input, and -1 everywhere: no image, another type, or metres_per_unit not positive and finite.
/// not_enough_data: no pixel has depth. Allocates nothing.
inline Status sample_depth(const cv::Mat& depth, const PointSpan<float, 2>& pixels, double metres_per_unit,
                           span<float> depth_m) noexcept {
  CFP_ASSERT(depth_m.size() == pixels.size());
  const int type = detail::is_matrix(depth) && metres_per_unit > 0 && is_finite(metres_per_unit) ? depth.type() : -1;
  bool any = false;
  switch (type) {
    case CV_16UC1:
      any = detail::sample_depth_of<unsigned short>(depth, pixels, metres_per_unit, depth_m);
      break;
    case CV_32FC1:
      any = detail::sample_depth_of<float>(depth, pixels, metres_per_unit, depth_m);
      break;
    case CV_64FC1:
      any = detail::sample_depth_of<double>(depth, pixels, metres_per_unit, depth_m);
      break;
    default:
      for (float& metres : depth_m) metres = -1.0F;
      return Status::invalid_input;
  }
  return any ? Status::ok : Status::not_enough_data;
}

/// A pose from the upper 3x4 part of a 4x4 or 3x4 matrix, CV_32F or CV_64F (ORB-SLAM2's Tcw is T_cam_world). The
/// rotation is normalised, as products of float matrices drift. invalid_input, and pose untouched: another size or
/// type, an element that is not finite, a reflection, or a rotation part R with an element of R R^T - I beyond 0.01.
template <typename Scalar>
Status to_se3(const cv::Mat& matrix, SE3<Scalar>& pose) noexcept {
  if (!detail::is_real_matrix(matrix) || matrix.cols != 4 || (matrix.rows != 4 && matrix.rows != 3))
    return Status::invalid_input;
  SE3<double> read;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      const double value = detail::real_element(matrix, row, column);
      if (!is_finite(static_cast<Scalar>(value))) return Status::invalid_input;
      (column < 3 ? read.rotation(row, column) : read.translation[row]) = value;
    }
  }
  const Matrix3<double> excess = read.rotation * read.rotation.transpose() - Matrix3<double>::Identity();
  if (!(excess.cwiseAbs().maxCoeff() <= 0.01) || !(determinant(read.rotation) > 0)) return Status::invalid_input;
  read.rotation = normalized_rotation(read.rotation);
  pose = read.template cast<Scalar>();
  return Status::ok;
}

/// A camera from OpenCV's matrices, CV_32F or CV_64F: the 3x3 camera matrix, and k1, k2, p1, p2 or k1, k2, p1, p2, k3
/// as a row or a column (empty: no distortion). invalid_input, and camera untouched: another size or type, a skew, a
/// focal length that is not positive, an element that is not finite. For images without distortion: camera.pinhole().
template <typename Scalar>
[[nodiscard]] Status to_camera(const cv::Mat& camera_matrix, const cv::Mat& distortion,
                               RadialTangentialCamera<Scalar>& camera) noexcept {
  if (!detail::is_real_matrix(camera_matrix) || camera_matrix.rows != 3 || camera_matrix.cols != 3)
    return Status::invalid_input;
  double values[9] = {detail::real_element(camera_matrix, 0, 0), detail::real_element(camera_matrix, 1, 1),
                      detail::real_element(camera_matrix, 0, 2), detail::real_element(camera_matrix, 1, 2)};
  if (distortion.data != nullptr) {  // empty() is a call of the library
    const int count = distortion.rows * distortion.cols;
    if (!detail::is_real_matrix(distortion) || (distortion.rows != 1 && distortion.cols != 1))
      return Status::invalid_input;
    if (count != 4 && count != 5) return Status::invalid_input;
    for (int i = 0; i < count; ++i)
      values[4 + i] = detail::real_element(distortion, distortion.rows == 1 ? 0 : i, distortion.rows == 1 ? i : 0);
  }
  for (const double value : values) {
    if (!is_finite(static_cast<Scalar>(value))) return Status::invalid_input;
  }
  if (!(values[0] > 0 && values[1] > 0) || detail::real_element(camera_matrix, 0, 1) != 0) return Status::invalid_input;
  camera.fx = static_cast<Scalar>(values[0]);
  camera.fy = static_cast<Scalar>(values[1]);
  camera.cx = static_cast<Scalar>(values[2]);
  camera.cy = static_cast<Scalar>(values[3]);
  camera.k1 = static_cast<Scalar>(values[4]);
  camera.k2 = static_cast<Scalar>(values[5]);
  camera.p1 = static_cast<Scalar>(values[6]);
  camera.p2 = static_cast<Scalar>(values[7]);
  camera.k3 = static_cast<Scalar>(values[8]);
  return Status::ok;
}

/// Writes the pose into the upper 3x4 part of the caller's 4x4 or 3x4 matrix, CV_32F or CV_64F, and (0, 0, 0, 1) into
/// the fourth row if there is one. invalid_input, and the matrix untouched, for another size or type. The matrix shares
/// its elements with its shallow copies, as always in OpenCV.
template <typename Scalar>
Status write_pose(const SE3<Scalar>& pose, cv::Mat& matrix) noexcept {
  if (!detail::is_matrix(matrix) || matrix.cols != 4 || (matrix.rows != 4 && matrix.rows != 3))
    return Status::invalid_input;
  const bool is_float = matrix.type() == CV_32FC1;
  if (!is_float && matrix.type() != CV_64FC1) return Status::invalid_input;
  for (int row = 0; row < matrix.rows; ++row) {
    for (int column = 0; column < 4; ++column) {
      const Scalar value =
          row == 3 ? Scalar(column == 3 ? 1 : 0) : (column < 3 ? pose.rotation(row, column) : pose.translation[row]);
      unsigned char* const row_start = matrix.data + matrix.step.p[0] * static_cast<std::size_t>(row);
      const auto as_float = static_cast<float>(value);
      const auto as_double = static_cast<double>(value);
      if (is_float) {
        std::memcpy(row_start + sizeof(float) * static_cast<std::size_t>(column), &as_float, sizeof(float));
      } else {
        std::memcpy(row_start + sizeof(double) * static_cast<std::size_t>(column), &as_double, sizeof(double));
      }
    }
  }
  return Status::ok;
}

}  // namespace CFP_ISA
}  // namespace cfp
