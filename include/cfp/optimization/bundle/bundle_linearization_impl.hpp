/// @file bundle_linearization_impl.hpp
/// Inside bundle_adjustment.hpp: cost and normal equations of one pose's observations, in chunks of structure-of-arrays
/// loops that any compiler turns into vector instructions, or packets where there is a choice in the loop.
///
/// Tangent of a pose: xi = (d, w) along the world's axes, about the camera's centre c: R <- R exp(hat(w)), c <- c - d.
/// Then p = R (x - c) moves by R (d + w x (x - c)) and the Jacobians of a residual are J_x and J_x G^T with G^T = [I,
/// -hat(x - c)]. With the 3x3 matrix N = omega J_x^T J_x and n = omega J_x^T r, omega = w rho'(s) / sigma^2, every
/// block of the normal equations follows: N (point), G N G^T (pose), G N (both), and gradients n and G n.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "cfp/core/types.hpp"
#include "cfp/math/matrix3.hpp"
#include "cfp/optimization/bundle/bundle_chunk_impl.hpp"
#include "cfp/optimization/bundle/bundle_index_impl.hpp"
#include "cfp/optimization/robust_loss.hpp"
#include "cfp/simd/packet.hpp"

namespace cfp::detail {

struct BundleState {
  std::vector<BundlePose> poses;
  std::vector<Vector3<double>> points;
};

/// The normal equations at one state.
struct BundleLinearization {
  static constexpr std::size_t slot_doubles = 9;  // N (00 01 02 11 12 22), n
  std::vector<double> slots;
  std::vector<double> points, poses;  // H, g: BundleKind::system numbers each; free poses only
  std::vector<double> costs;          // per pose; NaN when an observation is behind its camera
};

/// Sums over the observations of one pose, one partial sum per lane: H's blocks N (6), hat(d) N (9), hat(d) N hat(d)^T
/// (6), and the gradient n (3), d x n (3).
using BundlePoseSums = double[27][BundleChunk::lanes];

inline namespace CFP_ISA {

/// Poses have 6 numbers, points 3; E of what is eliminated, 9 - E of what is kept.
template <int N>
struct BundleKind {
  static constexpr std::size_t size = static_cast<std::size_t>(N), block = size * size, system = block + size;
  using Matrix = Eigen::Matrix<double, N, N>;
  using Vector = Eigen::Matrix<double, N, 1>;

  static const std::vector<double>& systems(const BundleLinearization& linear) noexcept {
    return N == 6 ? linear.poses : linear.points;
  }
  static Eigen::Map<const Vector> gradient(const BundleLinearization& linear, std::size_t i) noexcept {
    return Eigen::Map<const Vector>(systems(linear).data() + system * i + block);
  }
  static std::size_t slot(const BundleIndex& index, std::size_t s) noexcept {
    return to_index(N == 6 ? index.slots[s].pose : index.slots[s].point);
  }
  /// lambda D
  static Vector damping(const BundleLinearization& linear, double lambda, std::size_t i) noexcept {
    const Eigen::Map<const Matrix> H(systems(linear).data() + system * i);
    Vector D;
    for (int b = 0; b < N; b += 3)
      D.template segment<3>(b).setConstant(lambda * (std::max)(H.diagonal().template segment<3>(b).sum() / 3, 1e-30));
    return D;
  }
  static Matrix damped(const BundleLinearization& linear, double lambda, std::size_t i) noexcept {
    Matrix A = Eigen::Map<const Matrix>(systems(linear).data() + system * i);
    A.diagonal() += damping(linear, lambda, i);
    return A;
  }
};

/// N, n and the cost of the chunk.
template <bool Stereo, typename Loss>
double weigh_chunk(int padded, double baseline_fx, double third_has_u, const Loss& loss,
                   const Matrix3<double>& rotation, BundleChunk& chunk) noexcept {
  using P = simd::Packet<double>;
  static_assert(to_index(BundleChunk::lanes) % P::lanes == 0);
  P cost = 0.0;
  for (int i = 0; i < padded; i += static_cast<int>(P::lanes)) {
    const auto at = [i](const double* from) { return P::load(from + i); };
    const P depth = at(chunk.depth), weight = at(chunk.weight), information = at(chunk.information);
    P r[3] = {at(chunk.projected[0]) - at(chunk.u), at(chunk.projected[1]) - at(chunk.v), P(0.0)}, J[3][3];
    for (int row = 0; row < 2; ++row)
      for (int c = 0; c < 3; ++c) J[row][c] = at(chunk.row[row][c]);
    if constexpr (Stereo) {
      const P disparity = P(baseline_fx) / depth;
      r[2] = P(third_has_u) * r[0] + at(chunk.disparity) - disparity;
      for (int c = 0; c < 3; ++c) J[2][c] = P(third_has_u) * J[0][c] + disparity / depth * rotation(2, c);
    }
    const P s = information * (r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
    const P omega = weight * information * loss.first(s);
    cost += select(depth > P(Tolerance<double>::min_depth), weight * loss.value(s),
                   P(std::numeric_limits<double>::quiet_NaN()));
    P N[6], n[3];
    std::fill_n(N, 6, P(0.0));
    std::fill_n(n, 3, P(0.0));
    for (int row = 0; row < (Stereo ? 3 : 2); ++row) {
      const P *x = J[row], a = omega * x[0], b = omega * x[1], c = omega * x[2];
      N[0] += a * x[0], N[1] += a * x[1], N[2] += a * x[2], N[3] += b * x[1], N[4] += b * x[2], N[5] += c * x[2];
      n[0] += a * r[row], n[1] += b * r[row], n[2] += c * r[row];
    }
    for (int e = 0; e < 6; ++e) N[e].store(chunk.N[e] + i);
    for (int e = 0; e < 3; ++e) n[e].store(chunk.n[e] + i);
  }
  return reduce_add(cost);
}

/// From N and n of a chunk to the pose's sums.
inline void add_to_pose(const BundleChunk& chunk, int padded, BundlePoseSums& s) noexcept {
  for (int begin = 0; begin < padded; begin += BundleChunk::lanes) {
    for (int l = 0; l < BundleChunk::lanes; ++l) {
      const int i = begin + l;
      const double x = chunk.d[0][i], y = chunk.d[1][i], z = chunk.d[2][i];
      const double n00 = chunk.N[0][i], n01 = chunk.N[1][i], n02 = chunk.N[2][i], n11 = chunk.N[3][i],
                   n12 = chunk.N[4][i], n22 = chunk.N[5][i];
      const double c00 = y * n02 - z * n01, c01 = y * n12 - z * n11, c02 = y * n22 - z * n12;
      const double c10 = z * n00 - x * n02, c11 = z * n01 - x * n12, c12 = z * n02 - x * n22;
      const double c20 = x * n01 - y * n00, c21 = x * n11 - y * n01, c22 = x * n12 - y * n02;
      s[0][l] += n00, s[1][l] += n01, s[2][l] += n02, s[3][l] += n11, s[4][l] += n12, s[5][l] += n22;
      s[6][l] += c00, s[7][l] += c01, s[8][l] += c02;
      s[9][l] += c10, s[10][l] += c11, s[11][l] += c12;
      s[12][l] += c20, s[13][l] += c21, s[14][l] += c22;
      s[15][l] += y * c02 - z * c01, s[16][l] += z * c00 - x * c02, s[17][l] += x * c01 - y * c00;
      s[18][l] += z * c10 - x * c12, s[19][l] += x * c11 - y * c10, s[20][l] += x * c21 - y * c20;
      const double g0 = chunk.n[0][i], g1 = chunk.n[1][i], g2 = chunk.n[2][i];
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
    for (const double lane : sums[e]) s[e] += lane;
  }
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      target[6 * c + r] = s[symmetric[r][c]];
      target[6 * c + 3 + r] = target[6 * (3 + r) + c] = s[6 + 3 * r + c];
      target[6 * (3 + c) + 3 + r] = s[15 + symmetric[r][c]];
    }
  }
  for (int r = 0; r < 6; ++r) target[36 + r] = s[21 + r];
}

/// All observations of pose k, the mono ones first: fills their slots, the pose's cost and, unless it is fixed, its
/// normal equations.
template <typename Camera, typename Scalar>
void linearize_pose(const BundleProblem<Camera, Scalar>& problem, const BundleIndex& index, std::size_t k,
                    const BundleOptions& options, const BundleState& state, BundleLinearization& out) noexcept {
  const Camera& camera = camera_of(problem.cameras, index.caller_pose[k]);
  const BundlePose& pose = state.poses[k];
  const bool is_free = k < index.free_poses;
  BundleChunk chunk;
  BundlePoseSums sums = {};
  double cost[2] = {};
  const double deltas[2] = {std::sqrt(options.chi2_mono), std::sqrt(options.chi2_stereo)};
  for (const std::size_t kind : {0U, 1U}) {  // pixels; pixels with a third row
    const std::size_t end = index.range_begin[2 * k + kind + 1];
    for (std::size_t first = index.range_begin[2 * k + kind]; first < end; first += BundleChunk::size) {
      const int count = static_cast<int>((std::min)(end - first, to_index(BundleChunk::size)));
      const int padded = (count + BundleChunk::lanes - 1) / BundleChunk::lanes * BundleChunk::lanes;
      for (int i = 0; i < padded; ++i) {
        const BundleMeasurement& m = index.observations[first + to_index((std::min)(i, count - 1))];
        for (int c = 0; c < 3; ++c) chunk.d[c][i] = state.points[to_index(m.point)][c] - pose.center[c];
        chunk.u[i] = m.u, chunk.v[i] = m.v, chunk.disparity[i] = m.disparity;
        chunk.weight[i] = i < count ? m.weight : 0, chunk.information[i] = m.information;
      }
      project_chunk(camera, pose, padded, chunk);
      cost[kind] += with_loss<simd::Packet<double>>(options.loss, deltas[kind], [&](const auto& loss) {
        return kind == 0
                   ? weigh_chunk<false>(padded, 0, 0, loss, pose.rotation, chunk)
                   : weigh_chunk<true>(padded, problem.baseline_fx, third_has_u(problem), loss, pose.rotation, chunk);
      });
      for (int i = 0; i < count; ++i) {
        double* const slot =
            out.slots.data() + BundleLinearization::slot_doubles * index.observations[first + to_index(i)].slot;
        for (int e = 0; e < 6; ++e) slot[e] = chunk.N[e][i];
        for (int e = 0; e < 3; ++e) slot[6 + e] = chunk.n[e][i];
      }
      if (is_free) add_to_pose(chunk, padded, sums);
    }
  }
  out.costs[k] = cost[0] + cost[1];
  if (is_free) store_pose(sums, out.poses.data() + k * BundleKind<6>::system);
}

/// The points' own blocks, from their slots.
inline void linearize_points(const BundleIndex& index, BundleLinearization& out) noexcept {
  std::fill(out.points.begin(), out.points.end(), 0.0);
  for (std::size_t s = 0; s < index.slots.size();) {
    const int j = index.slots[s].point;
    double sum[BundleLinearization::slot_doubles] = {};
    for (; s < index.slots.size() && index.slots[s].point == j; ++s) {
      for (std::size_t e = 0; e < BundleLinearization::slot_doubles; ++e)
        sum[e] += out.slots[BundleLinearization::slot_doubles * s + e];
    }
    double* const point = out.points.data() + BundleKind<3>::system * to_index(j);
    for (int e = 0; e < 9; ++e) point[e] += sum[symmetric[e / 3][e % 3]];
    for (int e = 0; e < 3; ++e) point[9 + e] += sum[6 + e];
  }
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
