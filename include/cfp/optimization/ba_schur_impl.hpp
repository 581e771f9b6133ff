/// @file ba_schur_impl.hpp
/// Inside weighted_ba.hpp: eliminates the points from the damped normal equations and recovers their steps.
///
/// Per point, with V = sum of its N, g = sum of its n: V' = V + lambda D_x, and every pair of observations a, b of it takes
/// W_a V'^-1 W_b^T from block (a, b) of the reduced camera system, W = G N. D is isotropic per point, and per pose for translation
/// and rotation (mean of the diagonal), so that the iterates do not depend on the direction of the world's axes.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "cfp/optimization/ba_linearization_impl.hpp"

namespace cfp::detail {

/// The reduced camera system and what the points need afterwards.
struct BaSchur {
  static constexpr std::size_t point_doubles = 10;  // V'^-1 (00 01 02 11 12 22), g, D
  std::vector<double> blocks[ba_parts];             // 36 per block, column-major
  std::vector<double> right_side[ba_parts];         // 6 per free rank
  std::vector<double> scratch[ba_parts];            // 36 per free slot of one point: W^T, W V'^-1
  std::vector<double> points;
};

/// The scale of the damping for a block of three: the mean of its diagonal, never quite zero.
[[nodiscard]] inline double damping_scale(double trace) noexcept { return (std::max)(trace / 3, 1e-30); }

/// Inverse of the symmetric V (00 01 02 11 12 22) through V = L D L^T; false when it is not positive definite.
[[nodiscard]] inline bool invert_symmetric(const double (&V)[6], double* inverse) noexcept {
  const double i0 = 1 / V[0];
  const double l1 = V[1] * i0, l2 = V[2] * i0;
  const double d1 = V[3] - l1 * V[1];
  const double i1 = 1 / d1;
  const double t = V[4] - l2 * V[1];
  const double l3 = t * i1;
  const double d2 = V[5] - l2 * V[2] - l3 * t;
  if (!(V[0] > 0 && d1 > 0 && d2 > 0)) return false;
  const double i2 = 1 / d2;
  const double m2 = l1 * l3 - l2;  // L^-1 = [1, -l1 1, m2 -l3 1]
  inverse[5] = i2;
  inverse[4] = -l3 * i2;
  inverse[3] = i1 + l3 * l3 * i2;
  inverse[2] = m2 * i2;
  inverse[1] = -l1 * i1 - l3 * m2 * i2;
  inverse[0] = i0 + l1 * l1 * i1 + m2 * m2 * i2;
  return true;
}

inline void multiply_symmetric(const double* S, const double (&x)[3], double (&y)[3]) noexcept {
  y[0] = S[0] * x[0] + S[1] * x[1] + S[2] * x[2];
  y[1] = S[1] * x[0] + S[3] * x[1] + S[4] * x[2];
  y[2] = S[2] * x[0] + S[4] * x[1] + S[5] * x[2];
}

/// W^T = N G^T = [N, (hat(d) N)^T] as a column-major 3x6 matrix.
inline void cross_block(const double* N, double x, double y, double z, double* Wt) noexcept {
  Wt[0] = N[0], Wt[1] = N[1], Wt[2] = N[2];
  Wt[3] = N[1], Wt[4] = N[3], Wt[5] = N[4];
  Wt[6] = N[2], Wt[7] = N[4], Wt[8] = N[5];
  Wt[9] = y * N[2] - z * N[1], Wt[10] = y * N[4] - z * N[3], Wt[11] = y * N[5] - z * N[4];
  Wt[12] = z * N[0] - x * N[2], Wt[13] = z * N[1] - x * N[4], Wt[14] = z * N[2] - x * N[5];
  Wt[15] = x * N[1] - y * N[0], Wt[16] = x * N[3] - y * N[1], Wt[17] = x * N[4] - y * N[2];
}

/// The share of one part of the points in the reduced system; part 0 starts from the poses' own blocks. False when a point's
/// block is not positive definite, which only rounding or overflow can cause.
[[nodiscard]] inline bool eliminate_points(const BaIndex& index, const BaState& state, const BaLinearization& linear, double lambda, int part,
                                           BaSchur& schur) noexcept {
  using Block = Eigen::Map<Matrix6<double>>;
  using Wide = Eigen::Map<const Eigen::Matrix<double, 3, 6>>;
  using Tall = Eigen::Map<Eigen::Matrix<double, 6, 3>>;
  double* const blocks = schur.blocks[part].data();
  double* const right_side = schur.right_side[part].data();
  double* const scratch = schur.scratch[part].data();
  std::fill(schur.blocks[part].begin(), schur.blocks[part].end(), 0.0);
  std::fill(schur.right_side[part].begin(), schur.right_side[part].end(), 0.0);
  if (part == 0) {
    for (std::size_t k = 0; k < to_index(index.free_poses); ++k) {
      const double* pose = linear.poses.data() + k * BaLinearization::pose_doubles;
      double* diagonal = blocks + 36 * to_index(index.diagonal_block[k]);
      std::copy(pose, pose + 36, diagonal);
      const double t = lambda * damping_scale(pose[0] + pose[7] + pose[14]), r = lambda * damping_scale(pose[21] + pose[28] + pose[35]);
      for (std::size_t e = 0; e < 3; ++e) diagonal[7 * e] += t, diagonal[7 * (e + 3)] += r;
      for (std::size_t e = 0; e < 6; ++e) right_side[6 * k + e] = -pose[36 + e];
    }
  }
  for (std::size_t j = to_index(index.point_part[to_index(part)]); j < to_index(index.point_part[to_index(part) + 1]); ++j) {
    const double* slot = linear.slots.data() + BaLinearization::slot_doubles * index.slot_begin[j];
    const double* const slots_end = linear.slots.data() + BaLinearization::slot_doubles * index.slot_begin[j + 1];
    double sum[9] = {};
    for (const double* s = slot; s != slots_end; s += BaLinearization::slot_doubles) {
      for (int e = 0; e < 9; ++e) sum[e] += s[e];
    }
    const double scale = damping_scale(sum[0] + sum[3] + sum[5]);
    const double V[6] = {sum[0] + lambda * scale, sum[1], sum[2], sum[3] + lambda * scale, sum[4], sum[5] + lambda * scale};
    const double g[3] = {sum[6], sum[7], sum[8]};
    double* const point = schur.points.data() + BaSchur::point_doubles * j;
    if (!invert_symmetric(V, point)) return false;
    point[6] = g[0], point[7] = g[1], point[8] = g[2], point[9] = scale;
    double Vg[3];
    multiply_symmetric(point, g, Vg);

    const double* x = state.points.data() + 3 * j;
    const int* rank = index.slot_rank.data() + index.slot_begin[j];
    const int* pair = index.pair_block.data() + index.pair_begin[j];
    for (int a = 0; a < index.free_slots[j]; ++a, slot += BaLinearization::slot_doubles) {
      const double* c = state.poses[to_index(rank[a])].center;
      double* const Wt = scratch + 36 * a;
      cross_block(slot, x[0] - c[0], x[1] - c[1], x[2] - c[2], Wt);
      Tall WV(Wt + 18);
      for (int r = 0; r < 6; ++r) {
        const double w[3] = {Wt[3 * r], Wt[3 * r + 1], Wt[3 * r + 2]};
        double y[3];
        multiply_symmetric(point, w, y);
        WV(r, 0) = y[0], WV(r, 1) = y[1], WV(r, 2) = y[2];
        right_side[6 * rank[a] + r] += w[0] * Vg[0] + w[1] * Vg[1] + w[2] * Vg[2];
      }
      for (int b = 0; b <= a; ++b, ++pair) {
        Block(blocks + 36 * to_index(*pair)).noalias() -= WV.lazyProduct(Wide(scratch + 36 * b));
      }
    }
  }
  return true;
}

/// The points' steps from the poses' steps (6 per free rank): x_next = x + h. Returns the part's share of h^T (lambda D h - g).
[[nodiscard]] inline double move_points(const BaIndex& index, const BaState& state, const BaLinearization& linear, const BaSchur& schur, double lambda,
                                        const double* pose_steps, int part, BaState& next) noexcept {
  double promised = 0;
  for (std::size_t j = to_index(index.point_part[to_index(part)]); j < to_index(index.point_part[to_index(part) + 1]); ++j) {
    const double* point = schur.points.data() + BaSchur::point_doubles * j;
    const double* x = state.points.data() + 3 * j;
    const double* slot = linear.slots.data() + BaLinearization::slot_doubles * index.slot_begin[j];
    const int* rank = index.slot_rank.data() + index.slot_begin[j];
    double sum[3] = {point[6], point[7], point[8]};
    for (int a = 0; a < index.free_slots[j]; ++a, slot += BaLinearization::slot_doubles) {
      const double* c = state.poses[to_index(rank[a])].center;
      const double* xi = pose_steps + 6 * rank[a];
      const double d0 = x[0] - c[0], d1 = x[1] - c[1], d2 = x[2] - c[2];
      const double moved[3] = {xi[0] + xi[4] * d2 - xi[5] * d1, xi[1] + xi[5] * d0 - xi[3] * d2, xi[2] + xi[3] * d1 - xi[4] * d0};
      double y[3];
      multiply_symmetric(slot, moved, y);
      for (int e = 0; e < 3; ++e) sum[e] += y[e];
    }
    double h[3];
    multiply_symmetric(point, sum, h);
    for (std::size_t e = 0; e < 3; ++e) {
      next.points[3 * j + e] = x[e] - h[e];
      promised += h[e] * (lambda * point[9] * h[e] + point[6 + e]);
    }
  }
  return promised;
}

/// The poses' steps applied; fixed ranks are copied. Returns their share of h^T (lambda D h - g).
[[nodiscard]] inline double move_poses(const BaIndex& index, const BaState& state, const BaLinearization& linear, double lambda,
                                       const double* pose_steps, BaState& next) noexcept {
  double promised = 0;
  for (std::size_t k = 0; k < state.poses.size(); ++k) {
    next.poses[k] = state.poses[k];
    if (k >= to_index(index.free_poses)) continue;
    const double* xi = pose_steps + 6 * k;
    const double* H = linear.poses.data() + k * BaLinearization::pose_doubles;
    const double t = lambda * damping_scale(H[0] + H[7] + H[14]), r = lambda * damping_scale(H[21] + H[28] + H[35]);
    for (std::size_t e = 0; e < 6; ++e) promised += xi[e] * ((e < 3 ? t : r) * xi[e] - H[36 + e]);
    using Rotation = Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>;
    Rotation rotation(next.poses[k].rotation);
    rotation = Matrix3<double>(rotation) * so3_exp(Vector3<double>(xi[3], xi[4], xi[5]));
    for (std::size_t e = 0; e < 3; ++e) next.poses[k].center[e] -= xi[e];
  }
  return promised;
}

}  // namespace cfp::detail
