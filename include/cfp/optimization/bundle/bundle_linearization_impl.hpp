/// @file bundle_linearization_impl.hpp
/// Inside bundle_adjustment.hpp: cost and normal equations of one pose's observations, in chunks of structure-of-arrays
/// loops that any compiler turns into vector instructions.
///
/// Tangent of a pose: xi = (d, w) along the world's axes, about the camera's centre c: R <- R exp(hat(w)), c <- c - d.
/// Then p = R (x - c) moves by R (d + w x (x - c)) and the Jacobians of a residual are J_x and J_x G^T with G^T = [I,
/// -hat(x - c)]. With the 3x3 matrix N = omega J_x^T J_x and n = omega J_x^T r, omega = w rho'(s) / sigma^2, every
/// block of the normal equations follows: N (point), G N G^T (pose), G N (both), and gradients n and G n. So one
/// observation is six numbers N.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "cfp/optimization/bundle/bundle_index_impl.hpp"

namespace cfp::detail {

/// The normal equations at one state of poses and points.
struct BundleLinearization {
  static constexpr std::size_t slot_doubles = 9;   // N (00 01 02 11 12 22), n
  static constexpr std::size_t pose_doubles = 42;  // H: 6x6, both triangles; g
  std::vector<double> slots;
  std::vector<double> poses;  // free ranks only
  std::vector<double> costs;  // per rank; NaN when an observation is behind its camera
};

struct BundleState {
  std::vector<BundlePose> poses;  // per rank
  std::vector<double> points;     // three per point
};

struct BundleChunk {
  static constexpr int size = 32, lanes = 8;
  using Array = double[size];
  Array d[3];                // x - c
  Array row_u[3], row_v[3];  // d u / d x, d v / d x
  Array residual_u, residual_v, depth;
};

/// Fills rows, residuals (without the measurement) and depths of the first `count` points of the chunk; a point that
/// the camera does not see gets depth 0.
template <typename Camera>
void project_chunk(const Camera& camera, const BundlePose& pose, int count, BundleChunk& chunk) noexcept {
  using Real = typename Camera::ScalarType;
  const double* R = pose.rotation;
  for (int i = 0; i < count; ++i) {
    const double x = chunk.d[0][i], y = chunk.d[1][i], z = chunk.d[2][i];
    const Vector3<double> p(R[0] * x + R[1] * y + R[2] * z, R[3] * x + R[4] * y + R[5] * z,
                            R[6] * x + R[7] * y + R[8] * z);
    Vector2<Real> pixel = Vector2<Real>::Zero();
    Matrix23<Real> A = Matrix23<Real>::Zero();
    const bool seen = camera.project(p.template cast<Real>(), pixel, &A);
    chunk.depth[i] = seen ? p.z() : 0.0;
    chunk.residual_u[i] = static_cast<double>(pixel.x());
    chunk.residual_v[i] = static_cast<double>(pixel.y());
    for (int c = 0; c < 3; ++c) {
      chunk.row_u[c][i] = static_cast<double>(A(0, 0)) * R[c] + static_cast<double>(A(0, 1)) * R[3 + c] +
                          static_cast<double>(A(0, 2)) * R[6 + c];
      chunk.row_v[c][i] = static_cast<double>(A(1, 0)) * R[c] + static_cast<double>(A(1, 1)) * R[3 + c] +
                          static_cast<double>(A(1, 2)) * R[6 + c];
    }
  }
}

/// The same for the pinhole camera, without a branch.
template <typename Real>
void project_chunk(const PinholeCamera<Real>& camera, const BundlePose& pose, int count, BundleChunk& chunk) noexcept {
  const double* R = pose.rotation;
  const auto fx = static_cast<double>(camera.fx), fy = static_cast<double>(camera.fy);
  const auto cx = static_cast<double>(camera.cx), cy = static_cast<double>(camera.cy);
  for (int i = 0; i < count; ++i) {
    const double x = chunk.d[0][i], y = chunk.d[1][i], z = chunk.d[2][i];
    const double depth = R[6] * x + R[7] * y + R[8] * z;
    const double inv_z = 1 / depth;
    const double a = (R[0] * x + R[1] * y + R[2] * z) * inv_z, b = (R[3] * x + R[4] * y + R[5] * z) * inv_z;
    const double su = fx * inv_z, sv = fy * inv_z;
    chunk.depth[i] = depth;
    chunk.residual_u[i] = fx * a + cx;
    chunk.residual_v[i] = fy * b + cy;
    for (int c = 0; c < 3; ++c) {
      chunk.row_u[c][i] = su * (R[c] - a * R[6 + c]);
      chunk.row_v[c][i] = sv * (R[3 + c] - b * R[6 + c]);
    }
  }
}

/// Sums over the observations of one pose, one partial sum per lane: H's blocks N (6), hat(d) N (9), hat(d) N hat(d)^T
/// (6), and the gradient n (3), d x n (3).
struct BundlePoseSums {
  double lane[27][BundleChunk::lanes];
};

/// From N and n of a chunk to the pose's sums.
inline void add_to_pose(const BundleChunk& chunk, const BundleChunk::Array (&N)[6], const BundleChunk::Array (&n)[3],
                        int count, BundlePoseSums& sums) noexcept {
  for (int begin = 0; begin < count; begin += BundleChunk::lanes) {
    for (int l = 0; l < BundleChunk::lanes; ++l) {
      const int i = begin + l;
      const double x = chunk.d[0][i], y = chunk.d[1][i], z = chunk.d[2][i];
      const double n00 = N[0][i], n01 = N[1][i], n02 = N[2][i], n11 = N[3][i], n12 = N[4][i], n22 = N[5][i];
      const double c00 = y * n02 - z * n01, c01 = y * n12 - z * n11, c02 = y * n22 - z * n12;
      const double c10 = z * n00 - x * n02, c11 = z * n01 - x * n12, c12 = z * n02 - x * n22;
      const double c20 = x * n01 - y * n00, c21 = x * n11 - y * n01, c22 = x * n12 - y * n02;
      auto& s = sums.lane;
      s[0][l] += n00, s[1][l] += n01, s[2][l] += n02, s[3][l] += n11, s[4][l] += n12, s[5][l] += n22;
      s[6][l] += c00, s[7][l] += c01, s[8][l] += c02;
      s[9][l] += c10, s[10][l] += c11, s[11][l] += c12;
      s[12][l] += c20, s[13][l] += c21, s[14][l] += c22;
      s[15][l] += y * c02 - z * c01, s[16][l] += z * c00 - x * c02, s[17][l] += x * c01 - y * c00;
      s[18][l] += z * c10 - x * c12, s[19][l] += x * c11 - y * c10, s[20][l] += x * c21 - y * c20;
      const double g0 = n[0][i], g1 = n[1][i], g2 = n[2][i];
      s[21][l] += g0, s[22][l] += g1, s[23][l] += g2;
      s[24][l] += y * g2 - z * g1, s[25][l] += z * g0 - x * g2, s[26][l] += x * g1 - y * g0;
    }
  }
}

/// The sums as H (6x6) and g (6) of the pose.
inline void store_pose(const BundlePoseSums& sums, double* target) noexcept {
  double s[27];
  for (int e = 0; e < 27; ++e) {
    s[e] = 0;
    for (const double lane : sums.lane[e]) s[e] += lane;
  }
  static constexpr int symmetric[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      target[6 * c + r] = s[symmetric[r][c]];
      target[6 * c + 3 + r] = target[6 * (3 + r) + c] = s[6 + 3 * r + c];
      target[6 * (3 + c) + 3 + r] = s[15 + symmetric[r][c]];
    }
  }
  for (int r = 0; r < 6; ++r) target[36 + r] = s[21 + r];
}

/// One segment of one pose: fills its slots, adds to the pose's sums (null: the pose is fixed) and returns the cost.
template <bool Stereo, typename Camera, typename Loss>
double linearize_segment(const BundleIndex& index, std::size_t begin, std::size_t end, const Camera& camera,
                         double baseline_fx, const Loss& loss, const BundlePose& pose, const double* points,
                         double* slots, BundlePoseSums* sums) noexcept {
  BundleChunk chunk;
  BundleChunk::Array N[6], n[3], omega;
  [[maybe_unused]] BundleChunk::Array residual_r;
  double cost = 0;
  for (std::size_t first = begin; first < end; first += BundleChunk::size) {
    const int count = static_cast<int>((std::min)(end - first, to_index(BundleChunk::size)));
    const int padded = (count + BundleChunk::lanes - 1) / BundleChunk::lanes * BundleChunk::lanes;
    for (int i = 0; i < padded; ++i) {  // the last observation fills up the lanes, with weight 0
      const double* x = points + 3 * to_index(index.point[first + to_index((std::min)(i, count - 1))]);
      for (int c = 0; c < 3; ++c) chunk.d[c][i] = x[c] - pose.center[c];
      omega[i] = 0;
    }
    project_chunk(camera, pose, padded, chunk);
    for (int i = 0; i < count; ++i) {
      const std::size_t o = first + to_index(i);
      const double ru = chunk.residual_u[i] -= index.u[o];
      const double rv = chunk.residual_v[i] -= index.v[o];
      double s = ru * ru + rv * rv;
      if constexpr (Stereo) {
        residual_r[i] = ru + index.disparity[o] - baseline_fx / chunk.depth[i];
        s += residual_r[i] * residual_r[i];
      }
      s *= index.inv_sigma_sq[o];
      const bool seen = chunk.depth[i] > Tolerance<double>::min_depth;
      cost += seen ? index.weight[o] * loss.value(s) : std::numeric_limits<double>::quiet_NaN();
      omega[i] = index.weight[o] * index.inv_sigma_sq[o] * loss.first(s);
    }
    for (int i = 0; i < padded; ++i) {
      const double w = omega[i], wu = w * chunk.residual_u[i], wv = w * chunk.residual_v[i];
      const double u0 = chunk.row_u[0][i], u1 = chunk.row_u[1][i], u2 = chunk.row_u[2][i];
      const double v0 = chunk.row_v[0][i], v1 = chunk.row_v[1][i], v2 = chunk.row_v[2][i];
      const double a0 = w * u0, a1 = w * u1, a2 = w * u2, b0 = w * v0, b1 = w * v1, b2 = w * v2;
      N[0][i] = a0 * u0 + b0 * v0;
      N[1][i] = a0 * u1 + b0 * v1;
      N[2][i] = a0 * u2 + b0 * v2;
      N[3][i] = a1 * u1 + b1 * v1;
      N[4][i] = a1 * u2 + b1 * v2;
      N[5][i] = a2 * u2 + b2 * v2;
      n[0][i] = wu * u0 + wv * v0;
      n[1][i] = wu * u1 + wv * v1;
      n[2][i] = wu * u2 + wv * v2;
    }
    if constexpr (Stereo) {
      for (int i = count; i < padded; ++i) residual_r[i] = 0;
      const double* R2 = pose.rotation + 6;
      for (int i = 0; i < padded; ++i) {
        const double t = baseline_fx / (chunk.depth[i] * chunk.depth[i]);
        const double u0 = chunk.row_u[0][i] + t * R2[0], u1 = chunk.row_u[1][i] + t * R2[1],
                     u2 = chunk.row_u[2][i] + t * R2[2];
        const double a0 = omega[i] * u0, a1 = omega[i] * u1, a2 = omega[i] * u2, r = residual_r[i];
        N[0][i] += a0 * u0;
        N[1][i] += a0 * u1;
        N[2][i] += a0 * u2;
        N[3][i] += a1 * u1;
        N[4][i] += a1 * u2;
        N[5][i] += a2 * u2;
        n[0][i] += a0 * r;
        n[1][i] += a1 * r;
        n[2][i] += a2 * r;
      }
    }
    for (int i = 0; i < count; ++i) {
      const std::uint32_t slot = index.slot[first + to_index(i)];
      double* target = slots + BundleLinearization::slot_doubles * (slot / 2);
      if (slot % 2 == 0) {
        for (int e = 0; e < 6; ++e) target[e] = N[e][i];
        for (int e = 0; e < 3; ++e) target[6 + e] = n[e][i];
      } else {
        for (int e = 0; e < 6; ++e) target[e] += N[e][i];
        for (int e = 0; e < 3; ++e) target[6 + e] += n[e][i];
      }
    }
    if (sums != nullptr) add_to_pose(chunk, N, n, padded, *sums);
  }
  return cost;
}

/// All observations of one rank.
template <typename Camera, typename MonoLoss, typename StereoLoss>
void linearize_pose(const BundleIndex& index, int rank, const Camera& camera, double baseline_fx, const MonoLoss& mono,
                    const StereoLoss& stereo, const BundleState& state, BundleLinearization& out) noexcept {
  const std::size_t r = to_index(rank);
  BundlePoseSums sums = {};
  BundlePoseSums* const target = rank < index.free_poses ? &sums : nullptr;
  const std::size_t* begin = index.segment_begin.data() + 2 * r;
  const double* points = state.points.data();
  out.costs[r] = linearize_segment<false>(index, begin[0], begin[1], camera, baseline_fx, mono, state.poses[r], points,
                                          out.slots.data(), target) +
                 linearize_segment<true>(index, begin[1], begin[2], camera, baseline_fx, stereo, state.poses[r], points,
                                         out.slots.data(), target);
  if (target != nullptr) store_pose(sums, out.poses.data() + r * BundleLinearization::pose_doubles);
}

}  // namespace cfp::detail
