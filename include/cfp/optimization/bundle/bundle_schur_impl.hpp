/// @file bundle_schur_impl.hpp
/// Inside bundle_adjustment.hpp: eliminates points, or poses, from the damped normal equations and recovers their
/// steps.
///
/// Per point, with V = sum of its N, g = sum of its n: V' = V + lambda D_x, and every pair of links a, b of it takes
/// W_a V'^-1 W_b^T from block (a, b) of the reduced system, W = G N. D is isotropic per point, and per pose for
/// translation and rotation (mean of the diagonal), so that the iterates do not depend on the direction of the world's
/// axes.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "cfp/math/so3.hpp"
#include "cfp/optimization/bundle/bundle_linearization_impl.hpp"
#include "cfp/optimization/bundle/symmetric3_impl.hpp"

namespace cfp::detail {

/// The reduced system, and what is needed to recover the steps of what was eliminated.
struct BundleSchur {
  static constexpr std::size_t point_doubles = 10;  // V'^-1 (00 01 02 11 12 22), g, D
  static constexpr std::size_t pair_doubles = 30;   // W = G N (6x3), V'^-1 N (3x3), both column-major, d = x - c
  static constexpr std::size_t coupling_doubles = 18;
  std::vector<double> blocks[bundle_parts];      // N N per block, column-major
  std::vector<double> right_side[bundle_parts];  // N per block row
  std::vector<double> pairs[bundle_parts];       // pair_doubles per free link of one point
  std::vector<double> points;
  std::vector<double> triangles, couplings;  // poses eliminated: L^-1 and L^-1 g per pose, L^-1 W per link
  std::vector<double> pose_steps;            // 6 per free pose
  BlockFactor factor;
};

inline namespace CFP_ISA {

/// The scale of the damping for a block of three: the mean of its diagonal, never quite zero.
[[nodiscard]] inline double damping_scale(double trace) noexcept { return (std::max)(trace / 3, 1e-30); }

/// V' of point j, and in schur.points what its step needs; false when V' is not positive definite, which only rounding
/// or overflow can cause.
[[nodiscard]] inline bool damp_point(const BundleIndex& index, const BundleLinearization& linear, double lambda,
                                     std::size_t j, double (&V)[6], BundleSchur& schur) noexcept {
  double sum[9] = {};
  for (std::size_t l = index.link_begin[j]; l < index.link_begin[j + 1]; ++l) {
    for (std::size_t e = 0; e < 9; ++e) sum[e] += linear.links[BundleLinearization::link_doubles * l + e];
  }
  const double scale = damping_scale(sum[0] + sum[3] + sum[5]);
  std::copy(sum, sum + 6, V);
  for (const int diagonal : {0, 3, 5}) V[diagonal] += lambda * scale;
  double* const point = schur.points.data() + BundleSchur::point_doubles * j;
  std::copy(sum + 6, sum + 9, point + 6), point[9] = scale;
  return invert_symmetric(V, point);
}

/// H' = H + lambda D of a pose, column-major.
inline void damp_pose(const double* pose, double lambda, double* damped) noexcept {
  std::copy(pose, pose + 36, damped);
  const double t = lambda * damping_scale(pose[0] + pose[7] + pose[14]),
               r = lambda * damping_scale(pose[21] + pose[28] + pose[35]);
  for (int e = 0; e < 3; ++e) damped[7 * e] += t, damped[7 * (e + 3)] += r;
}

/// W = G N = [N; hat(d) N] of a link, column-major.
inline void couple(const double* N, const double (&d)[3], double* W) noexcept {
  const double n[3][3] = {{N[0], N[1], N[2]}, {N[1], N[3], N[4]}, {N[2], N[4], N[5]}};
  for (int c = 0; c < 3; ++c, W += 6) {
    W[0] = n[0][c], W[1] = n[1][c], W[2] = n[2][c];
    W[3] = d[1] * n[2][c] - d[2] * n[1][c];
    W[4] = d[2] * n[0][c] - d[0] * n[2][c];
    W[5] = d[0] * n[1][c] - d[1] * n[0][c];
  }
}

/// What the pairs of one link need.
inline void prepare_pairs(const double* N, const double (&d)[3], const double* V_inverse, double* out) noexcept {
  couple(N, d, out);
  const double n[3][3] = {{N[0], N[1], N[2]}, {N[1], N[3], N[4]}, {N[2], N[4], N[5]}};
  for (int c = 0; c < 3; ++c) {
    double column[3];
    multiply_symmetric(V_inverse, n[c], column);
    std::copy(column, column + 3, out + 18 + 3 * c);
    out[27 + c] = d[c];
  }
}

/// Takes W_b V'^-1 W_a^T from the blocks (b, a) of all pairs a <= b < count of the links of one point. Half of each
/// block follows from the other: with T = W_b V'^-1 N_a it is [T, T hat(d_a)^T].
template <int Rows = 6>
void subtract_pairs(const double* links, int count, const int* pair, double* blocks) noexcept {
  using Vector = Eigen::Matrix<double, Rows, 1>;
  using Column = Eigen::Map<Vector>;
  using ConstColumn = Eigen::Map<const Vector>;
  for (int a = 0; a < count; ++a) {
    const double* const p = links + BundleSchur::pair_doubles * to_index(a) + 18;
    const double x = p[9], y = p[10], z = p[11];
    for (int b = a; b < count; ++b, ++pair) {
      const double* const w = links + BundleSchur::pair_doubles * to_index(b);
      const ConstColumn w0(w), w1(w + 6), w2(w + 12);
      const Vector t0 = w0 * p[0] + w1 * p[1] + w2 * p[2];
      const Vector t1 = w0 * p[3] + w1 * p[4] + w2 * p[5];
      const Vector t2 = w0 * p[6] + w1 * p[7] + w2 * p[8];
      double* const block = blocks + 36 * to_index(*pair);
      Column(block) -= t0, Column(block + 6) -= t1, Column(block + 12) -= t2;
      Column(block + 18) -= t2 * y - t1 * z;
      Column(block + 24) -= t0 * z - t2 * x;
      Column(block + 30) -= t1 * x - t0 * y;
    }
  }
}

/// The share of one part of the points in the reduced system; part 0 starts from the poses' own blocks. False as
/// damp_point.
template <int Rows = 6>
[[nodiscard]] bool eliminate_points(const BundleIndex& index, const BundleState& state,
                                    const BundleLinearization& linear, double lambda, std::size_t part,
                                    BundleSchur& schur) noexcept {
  double* const blocks = schur.blocks[part].data();
  double* const right_side = schur.right_side[part].data();
  double* const pairs = schur.pairs[part].data();
  std::fill(schur.blocks[part].begin(), schur.blocks[part].end(), 0.0);
  std::fill(schur.right_side[part].begin(), schur.right_side[part].end(), 0.0);
  for (std::size_t k = 0; part == 0 && k < to_index(index.free_poses); ++k) {
    const double* pose = linear.poses.data() + k * BundleLinearization::pose_doubles;
    damp_pose(pose, lambda, blocks + 36 * to_index(index.diagonal_block[k]));
    for (std::size_t e = 0; e < 6; ++e) right_side[6 * k + e] = -pose[36 + e];
  }
  for (std::size_t j = to_index(index.point_part[part]); j < to_index(index.point_part[part + 1]); ++j) {
    double V[6];
    if (!damp_point(index, linear, lambda, j, V, schur)) return false;
    const double* const point = schur.points.data() + BundleSchur::point_doubles * j;
    const double gradient[3] = {point[6], point[7], point[8]};
    double Vg[3];
    multiply_symmetric(point, gradient, Vg);
    const double* x = state.points.data() + 3 * j;
    const double* link = linear.links.data() + BundleLinearization::link_doubles * index.link_begin[j];
    for (std::size_t a = 0; a < to_index(index.free_links[j]); ++a, link += BundleLinearization::link_doubles) {
      const std::size_t k = to_index(index.link_pose[index.link_begin[j] + a]);
      const double* c = state.poses[k].center;
      const double d[3] = {x[0] - c[0], x[1] - c[1], x[2] - c[2]};
      prepare_pairs(link, d, point, pairs + BundleSchur::pair_doubles * a);
      double n[3];
      multiply_symmetric(link, Vg, n);
      double* const g = right_side + 6 * k;
      g[0] += n[0], g[1] += n[1], g[2] += n[2];
      add_cross(d, n, g + 3);
    }
    subtract_pairs<Rows>(pairs, index.free_links[j], index.pair_block.data() + index.pair_begin[j], blocks);
  }
  return true;
}

/// The points' steps from the poses' steps: x_next = x + h. Returns the part's share of h^T (lambda D h - g).
[[nodiscard]] inline double move_points(const BundleIndex& index, const BundleState& state,
                                        const BundleLinearization& linear, const BundleSchur& schur, double lambda,
                                        BundleState& next) noexcept {
  double promised = 0;
  for (std::size_t j = 0; j < index.caller_point.size(); ++j) {
    const double* point = schur.points.data() + BundleSchur::point_doubles * j;
    const double* x = state.points.data() + 3 * j;
    const double* link = linear.links.data() + BundleLinearization::link_doubles * index.link_begin[j];
    double sum[3] = {point[6], point[7], point[8]};
    for (std::size_t a = 0; a < to_index(index.free_links[j]); ++a, link += BundleLinearization::link_doubles) {
      const std::size_t k = to_index(index.link_pose[index.link_begin[j] + a]);
      const double* c = state.poses[k].center;
      const double* xi = schur.pose_steps.data() + 6 * k;
      const double d[3] = {x[0] - c[0], x[1] - c[1], x[2] - c[2]}, w[3] = {xi[3], xi[4], xi[5]};
      double moved[3] = {xi[0], xi[1], xi[2]}, y[3];
      add_cross(w, d, moved);
      multiply_symmetric(link, moved, y);
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

/// The poses' steps applied; fixed poses are copied. Returns their share of h^T (lambda D h - g).
[[nodiscard]] inline double move_poses(const BundleIndex& index, const BundleState& state,
                                       const BundleLinearization& linear, const BundleSchur& schur, double lambda,
                                       BundleState& next) noexcept {
  double promised = 0;
  for (std::size_t k = 0; k < state.poses.size(); ++k) {
    next.poses[k] = state.poses[k];
    if (k >= to_index(index.free_poses)) continue;
    const double* xi = schur.pose_steps.data() + 6 * k;
    const double* H = linear.poses.data() + k * BundleLinearization::pose_doubles;
    const double t = lambda * damping_scale(H[0] + H[7] + H[14]), r = lambda * damping_scale(H[21] + H[28] + H[35]);
    for (std::size_t e = 0; e < 6; ++e) promised += xi[e] * ((e < 3 ? t : r) * xi[e] - H[36 + e]);
    using Rotation = Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>;
    Rotation rotation(next.poses[k].rotation);
    rotation = Matrix3<double>(rotation) * so3_exp(Vector3<double>(xi[3], xi[4], xi[5]));
    for (std::size_t e = 0; e < 3; ++e) next.poses[k].center[e] -= xi[e];
  }
  return promised;
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
