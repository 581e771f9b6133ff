/// @file bundle_chunk_impl.hpp
/// Inside bundle_adjustment.hpp: projections of a chunk of points into one camera, with their derivatives.
#pragma once

#include "cfp/core/types.hpp"
#include "cfp/geometry/camera.hpp"

namespace cfp::detail {

/// p_cam = rotation (x - center): exact for cameras far from the origin.
struct BundlePose {
  Matrix3<double> rotation;
  Vector3<double> center;
};

/// Up to 32 observations of one pose. What fills up the lanes has weight 0.
struct BundleChunk {
  static constexpr int size = 32, lanes = 8;
  using Array = double[size];
  Array u, v, disparity, weight, information;
  Array d[3];  // x - c
  Array projected[2];
  double row[2][3][size];  // d projected / d x
  Array depth;
  Array N[6], n[3];
};

inline namespace CFP_ISA {

/// Projects the first `count` points of the chunk; a point that the camera does not see gets depth 0.
template <typename Camera>
void project_chunk(const Camera& camera, const BundlePose& pose, int count, BundleChunk& chunk) noexcept {
  using Real = typename Camera::ScalarType;
  const Matrix3<double> R = pose.rotation;
  for (int i = 0; i < count; ++i) {
    const Vector3<double> p = R * Vector3<double>(chunk.d[0][i], chunk.d[1][i], chunk.d[2][i]);
    Vector2<Real> pixel = Vector2<Real>::Zero();
    Matrix23<Real> A = Matrix23<Real>::Zero();
    const bool seen = camera.project(p.template cast<Real>(), pixel, &A);
    const Matrix23<double> rows = A.template cast<double>().lazyProduct(R);
    chunk.depth[i] = seen ? p.z() : 0.0;
    for (int r = 0; r < 2; ++r) {
      chunk.projected[r][i] = static_cast<double>(pixel[r]);
      for (int c = 0; c < 3; ++c) chunk.row[r][c][i] = rows(r, c);
    }
  }
}

/// The same for the pinhole camera, without a branch.
template <typename Real>
void project_chunk(const PinholeCamera<Real>& camera, const BundlePose& pose, int count, BundleChunk& chunk) noexcept {
  const Matrix3<double> R = pose.rotation;
  const auto fx = static_cast<double>(camera.fx), fy = static_cast<double>(camera.fy);
  const auto cx = static_cast<double>(camera.cx), cy = static_cast<double>(camera.cy);
  for (int i = 0; i < count; ++i) {
    const double x = chunk.d[0][i], y = chunk.d[1][i], z = chunk.d[2][i];
    const double depth = R(2, 0) * x + R(2, 1) * y + R(2, 2) * z;
    const double inv_z = 1 / depth;
    const double a = (R(0, 0) * x + R(0, 1) * y + R(0, 2) * z) * inv_z,
                 b = (R(1, 0) * x + R(1, 1) * y + R(1, 2) * z) * inv_z;
    const double su = fx * inv_z, sv = fy * inv_z;
    chunk.depth[i] = depth;
    chunk.projected[0][i] = fx * a + cx;
    chunk.projected[1][i] = fy * b + cy;
    for (int c = 0; c < 3; ++c) {
      chunk.row[0][c][i] = su * (R(0, c) - a * R(2, c));
      chunk.row[1][c][i] = sv * (R(1, c) - b * R(2, c));
    }
  }
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
