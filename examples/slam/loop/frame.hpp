// One RGB-D frame as the loop sees it.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include <opencv2/core.hpp>

#include "../../support/keypoint_grid.hpp"
#include "../../support/orb_features.hpp"
#include "cfp/geometry/any_camera.hpp"
#include "cfp/math/se3.hpp"

namespace cfp_slam {

using Camera = cfp::AnyCamera<float>;  // of the images
using Descriptor = cfp_examples::OrbDescriptor;
using cfp_examples::KeypointGrid;
inline constexpr int no_point = -1;

template <typename Element, typename Is>
void remove_where(std::vector<Element>& list, const Is& is) {
  list.erase(std::remove_if(list.begin(), list.end(), is), list.end());
}

// The camera of the undistorted images: their size, and how sure a keypoint's position is per pyramid level.
struct View {
  cfp::PinholeCamera<float> camera;
  cfp::PinholeCamera<double> exact;  // the same one, for the solvers
  int width = 0, height = 0;
  std::vector<float> scales;    // of the pyramid's levels
  float keypoint_sigma_px = 1;  // standard deviation of one coordinate, at level 0
  double baseline_fx = 0;       // of the depth camera seen as a stereo camera, pixels times metres
  float scale_factor = 1.2F;    // between two levels

  [[nodiscard]] float scale(const cv::KeyPoint& keypoint) const {
    return scales[static_cast<std::size_t>(keypoint.octave)];
  }
  [[nodiscard]] float sigma(const cv::KeyPoint& keypoint) const { return keypoint_sigma_px * scale(keypoint); }
  // Whether the point, in the camera's frame, is in the image, and where.
  [[nodiscard]] bool sees(const cfp::Vector3<double>& point, cfp::Vector2<double>& pixel) const {
    return exact.project(point, pixel) && pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < width && pixel.y() < height;
  }
};

// Keypoint i of frame k: pixel in the image, pixel without distortion, depth, map point.
struct Frame {
  double time_s = 0;
  std::vector<cv::KeyPoint> keypoints;
  std::vector<Descriptor> descriptors;
  std::vector<std::array<float, 2>> pixels;  // undistorted; NaN where the lens model has no ray
  std::vector<float> depths_m;               // -1: none
  std::vector<float> static_probability;     // K after the last stage
  std::vector<float> map_point_probability;  // M of the point seen, in the map or known from the last frame only
  std::vector<int> map_point;                // index into the map, or no_point
  cfp::SE3<double> T_cam_world;
  bool has_pose = false;

  [[nodiscard]] std::size_t size() const { return keypoints.size(); }
  // The point that keypoint i sees by its depth, in the camera's frame. Precondition: it has one.
  [[nodiscard]] cfp::Vector3<double> back_project(std::size_t i, const cfp::PinholeCamera<float>& camera) const {
    cfp::Vector3<float> ray = cfp::Vector3<float>::Zero();
    (void)camera.unproject({pixels[i][0], pixels[i][1]}, ray);
    return static_cast<double>(depths_m[i]) * ray.cast<double>();
  }
};

}  // namespace cfp_slam
