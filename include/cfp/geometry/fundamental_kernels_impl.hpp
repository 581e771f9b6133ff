/// @file fundamental_kernels_impl.hpp
/// Array kernels of fundamental_ransac.hpp: pairs as structure of arrays, MSAC score, normal equations of the Sampson distance,
/// Gauss-Newton on the seven parameters of F. Not an interface.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/SVD>

#include "cfp/geometry/fundamental_impl.hpp"
#include "cfp/math/so3.hpp"

namespace cfp::detail {

// The pairs present, centred per image and scaled by one common factor, so that distances are pixels times `factor`. Arrays are
// padded with weight 0 to whole lanes.
struct PairArrays {
  static constexpr std::size_t padding = 64;
  static constexpr std::size_t coordinates = 5;  // previous x, y, current x, y, weight

  std::size_t size = 0, capacity = 0;
  double total_weight = 0, factor = 0;
  PixelScaling scale_prev, scale_cur;
  std::vector<std::uint32_t> index;  // position in the caller's arrays
  std::vector<double> exact;         // `coordinates` arrays of `capacity`
  std::vector<float> fast;           // the same rounded, for scoring

  [[nodiscard]] const double* array(std::size_t c) const noexcept { return exact.data() + c * capacity; }
  [[nodiscard]] const float* fast_array(std::size_t c) const noexcept { return fast.data() + c * capacity; }
  [[nodiscard]] span<const double> weights() const noexcept { return {array(4), size}; }

  // When the points of an image coincide, only `size` is set and `factor` is 0.
  template <typename Scalar>
  void load(const PointSpan<Scalar, 2>& prev, const PointSpan<Scalar, 2>& cur, const span<const Scalar>& weight) {
    size = scale_pixels(prev, cur, weight, scale_prev, scale_cur);
    total_weight = 0;
    capacity = (prev.size() + padding - 1) / padding * padding;
    index.resize(prev.size());
    exact.resize(coordinates * capacity);
    fast.resize(coordinates * capacity);
    factor = 0;
    if (size == 0 || !scale_prev.valid() || !scale_cur.valid()) return;
    size = 0;
    factor = std::sqrt(scale_prev.factor * scale_cur.factor);
    scale_prev.factor = scale_cur.factor = factor;
    double* out[coordinates];
    for (std::size_t c = 0; c < coordinates; ++c) out[c] = exact.data() + c * capacity;
    for (std::size_t i = 0; i < prev.size(); ++i) {
      const double w = pair_weight(prev, cur, weight, i) / scale_prev.largest_weight;
      if (!(w > 0)) continue;
      const Vector3<double> p = scale_prev(prev(i, 0), prev(i, 1)), q = scale_cur(cur(i, 0), cur(i, 1));
      out[0][size] = p.x(), out[1][size] = p.y(), out[2][size] = q.x(), out[3][size] = q.y(), out[4][size] = w;
      index[size++] = static_cast<std::uint32_t>(i);
      total_weight += w;
    }
    for (std::size_t c = 0; c < coordinates; ++c) std::fill(out[c] + size, out[c] + capacity, 0.0);
    std::transform(exact.begin(), exact.end(), fast.begin(), [](double x) { return static_cast<float>(x); });
  }

  [[nodiscard]] Matrix3<double> to_pixels(const Matrix3<double>& F) const noexcept { return unscaled(F, scale_prev, scale_cur); }
  [[nodiscard]] std::size_t padded_size() const noexcept { return (size + padding - 1) / padding * padding; }
};

template <typename T>
using Lane = Eigen::Array<T, 32 / static_cast<int>(sizeof(T)), 1>;

template <typename T>
[[nodiscard]] Lane<T> load_lane(const T* at) noexcept {
  return Eigen::Map<const Lane<T>>(at);
}

// Sum over the pairs of w min(d^2 / limit, 1), d the Sampson distance of scaled pixels and limit its squared threshold. Gives up
// with a value above `bound` as soon as the sum exceeds it.
[[nodiscard]] inline double msac_cost(const PairArrays& pairs, const Matrix3<double>& F, double limit, double bound) noexcept {
  const Matrix3<float> f = F.cast<float>();
  const float limit_f = static_cast<float>(limit);
  const float *px = pairs.fast_array(0), *py = pairs.fast_array(1), *qx = pairs.fast_array(2), *qy = pairs.fast_array(3),
              *w = pairs.fast_array(4);
  constexpr std::size_t width = Lane<float>::SizeAtCompileTime;
  const double stop = bound * limit;
  double sum = 0;
  for (std::size_t block = 0; block < pairs.padded_size(); block += PairArrays::padding) {
    Lane<float> cost = Lane<float>::Zero();
    for (std::size_t i = block; i < block + PairArrays::padding; i += width) {
      const Lane<float> p0 = load_lane(px + i), p1 = load_lane(py + i), q0 = load_lane(qx + i), q1 = load_lane(qy + i);
      const Lane<float> l0 = f(0, 0) * p0 + f(0, 1) * p1 + f(0, 2);
      const Lane<float> l1 = f(1, 0) * p0 + f(1, 1) * p1 + f(1, 2);
      const Lane<float> l2 = f(2, 0) * p0 + f(2, 1) * p1 + f(2, 2);
      const Lane<float> m0 = f(0, 0) * q0 + f(1, 0) * q1 + f(2, 0);
      const Lane<float> m1 = f(0, 1) * q0 + f(1, 1) * q1 + f(2, 1);
      const Lane<float> e = q0 * l0 + q1 * l1 + l2;
      const Lane<float> n2 = l0 * l0 + l1 * l1 + m0 * m0 + m1 * m1;
      cost += load_lane(w + i) * (e * e / (n2 + 1e-30F)).min(limit_f);
    }
    sum += static_cast<double>(cost.sum());
    if (!(sum < stop)) return sum / limit;
  }
  return sum / limit;
}

// Both points of every pair of a sample must lie on the same side of the cameras: Chum, Werner, Matas: "Epipolar geometry
// estimation via RANSAC benefits from the oriented epipolar constraint", ICPR 2004.
[[nodiscard]] inline bool is_oriented(const Matrix3<double>& F, const double (&p)[7][2], const double (&q)[7][2]) noexcept {
  Vector3<double> epipole = F.col(0).cross(F.col(1));
  for (int c = 0; c < 2; ++c) {
    const Vector3<double> other = F.col(c).cross(F.col(2));
    if (other.squaredNorm() > epipole.squaredNorm()) epipole = other;
  }
  int positive = 0;
  for (int i = 0; i < 7; ++i) {
    const Vector3<double> line = F * Vector3<double>(p[i][0], p[i][1], 1);
    positive += epipole.cross(Vector3<double>(q[i][0], q[i][1], 1)).dot(line) > 0 ? 1 : 0;
  }
  return positive == 0 || positive == 7;
}

// Exact squared Sampson distance of pair i, scaled pixels; infinite where it is not defined.
[[nodiscard]] inline double scaled_sampson_sq(const PairArrays& pairs, const Matrix3<double>& F, std::size_t i) noexcept {
  const Vector3<double> p(pairs.array(0)[i], pairs.array(1)[i], 1), q(pairs.array(2)[i], pairs.array(3)[i], 1);
  const Vector3<double> l = F * p, m = F.transpose() * q;
  const double e = q.dot(l);
  const double d2 = e * e / (l.x() * l.x() + l.y() * l.y() + m.x() * m.x() + m.y() * m.y());
  return d2 >= 0 ? d2 : std::numeric_limits<double>::infinity();
}

// Normal equations over the nine entries (row-major) of F of sum w rho(d^2 / scale), and that sum; rho(x) = x / (1 + x), the loss
// of Geman and McClure: bounded like MSAC's, but smooth, so that pairs near the threshold count by degrees.
struct SampsonSystem {
  Eigen::Matrix<double, 9, 9> H;
  Eigen::Matrix<double, 9, 1> g;
  double cost = 0;
};

template <typename T>
void sampson_system(const PairArrays& pairs, const T* const (&in)[5], const Matrix3<double>& F, double scale, SampsonSystem& out) noexcept {
  using L = Lane<T>;
  constexpr std::size_t width = L::SizeAtCompileTime;
  const Matrix3<T> f = F.cast<T>();
  L H[45], g[9], cost = L::Zero();
  for (L& h : H) h.setZero();
  for (L& h : g) h.setZero();
  const T inverse_scale = T(1 / scale);
  for (std::size_t i = 0; i < pairs.size; i += width) {
    const L p[2] = {load_lane(in[0] + i), load_lane(in[1] + i)}, q[2] = {load_lane(in[2] + i), load_lane(in[3] + i)};
    const L l0 = f(0, 0) * p[0] + f(0, 1) * p[1] + f(0, 2);
    const L l1 = f(1, 0) * p[0] + f(1, 1) * p[1] + f(1, 2);
    const L l2 = f(2, 0) * p[0] + f(2, 1) * p[1] + f(2, 2);
    const L m0 = f(0, 0) * q[0] + f(1, 0) * q[1] + f(2, 0);
    const L m1 = f(0, 1) * q[0] + f(1, 1) * q[1] + f(2, 1);
    const L e = q[0] * l0 + q[1] * l1 + l2;
    const L n2 = l0 * l0 + l1 * l1 + m0 * m0 + m1 * m1;
    const L inverse_n2 = (n2 + T(1e-30)).inverse();
    const L x = e * e * inverse_n2 * inverse_scale;
    const L s = (x + T(1)).inverse();
    L weight = load_lane(in[4] + i) * s;
    cost += weight * x;
    weight *= s * inverse_n2;
    // d(e/n)/dF_ij = (q_i p_j - k (l_i p_j [i < 2] + m_j q_i [j < 2])) / n with k = e / n^2; rows below are without the 1/n.
    const L k = e * inverse_n2;
    const L a0 = q[0] - k * l0, a1 = q[1] - k * l1, b0 = k * m0, b1 = k * m1;
    const L J[9] = {a0 * p[0] - b0 * q[0],
                    a0 * p[1] - b1 * q[0],
                    a0,
                    a1 * p[0] - b0 * q[1],
                    a1 * p[1] - b1 * q[1],
                    a1,
                    p[0] - b0,
                    p[1] - b1,
                    L::Ones()};
    int entry = 0;
    for (int r = 0; r < 9; ++r) {
      const L wj = weight * J[r];
      g[r] += wj * e;
      for (int c = r; c < 9; ++c) H[entry++] += wj * J[c];
    }
  }
  int entry = 0;
  for (int r = 0; r < 9; ++r) {
    out.g[r] = static_cast<double>(g[r].sum()) / scale;
    for (int c = r; c < 9; ++c) out.H(r, c) = out.H(c, r) = static_cast<double>(H[entry++].sum()) / scale;
  }
  out.cost = static_cast<double>(cost.sum());
}

// F = U diag(cos t, sin t, 0) V^T with U <- U exp(a), V <- V exp(b): seven parameters (a, b, t), rank 2 and unit norm by
// construction. Source: Bartoli and Sturm, "Nonlinear estimation of the fundamental matrix with minimal parameters", PAMI 2004.
struct FactoredF {
  Matrix3<double> U, V;
  double c = 1, s = 0;

  explicit FactoredF(const Matrix3<double>& F) {
    const Eigen::JacobiSVD<Matrix3<double>> svd(F, Eigen::ComputeFullU | Eigen::ComputeFullV);
    U = svd.matrixU();
    V = svd.matrixV();
    const double norm = std::hypot(svd.singularValues()[0], svd.singularValues()[1]);
    c = norm > 0 ? svd.singularValues()[0] / norm : 1;
    s = norm > 0 ? svd.singularValues()[1] / norm : 0;
  }
  [[nodiscard]] Matrix3<double> matrix() const noexcept {
    return c * U.col(0) * V.col(0).transpose() + s * U.col(1) * V.col(1).transpose();
  }
  // d vec(F) (row-major) / d (a, b, t).
  [[nodiscard]] Eigen::Matrix<double, 9, 7> tangents() const noexcept {
    Eigen::Matrix<double, 9, 7> B;
    const auto set = [&](int column, const Matrix3<double>& M) {
      Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(B.col(column).data()) = M;
    };
    const auto uv = [&](int i, int j) -> Matrix3<double> { return U.col(i) * V.col(j).transpose(); };
    set(0, s * uv(2, 1));
    set(1, -c * uv(2, 0));
    set(2, c * uv(1, 0) - s * uv(0, 1));
    set(3, s * uv(1, 2));
    set(4, -c * uv(0, 2));
    set(5, c * uv(0, 1) - s * uv(1, 0));
    set(6, c * uv(1, 1) - s * uv(0, 0));
    return B;
  }
  void update(const Eigen::Matrix<double, 7, 1>& step) noexcept {
    U = U * so3_exp<double>(step.head<3>());
    V = V * so3_exp<double>(step.segment<3>(3));
    const double c0 = c, s0 = s, ct = std::cos(step[6]), st = std::sin(step[6]);
    c = c0 * ct - s0 * st;
    s = s0 * ct + c0 * st;
  }
};

// Levenberg-Marquardt on sum w rho(d^2 / scale) from F (scaled pixels, rank 2). Ends after max_evaluations, or when a step promises
// less than `tolerance` of the cost. Returns the number of evaluations; F is replaced only by one of lower cost.
template <typename T>
int refine_scaled(const PairArrays& pairs, const T* const (&in)[5], double scale, int max_evaluations, double tolerance,
                  Matrix3<double>& F) noexcept {
  FactoredF current(F);
  SampsonSystem system, trial_system;
  sampson_system<T>(pairs, in, current.matrix(), scale, system);
  int evaluations = 1;
  double damping = 1e-6;
  while (evaluations < max_evaluations) {
    const Eigen::Matrix<double, 9, 7> B = current.tangents();
    const Eigen::Matrix<double, 9, 7> HB = system.H.lazyProduct(B);
    Eigen::Matrix<double, 7, 7> H = B.transpose().lazyProduct(HB);
    const Eigen::Matrix<double, 7, 1> g = B.transpose() * system.g;
    H.diagonal() += damping * H.diagonal() + Eigen::Matrix<double, 7, 1>::Constant(1e-12 * H.diagonal().maxCoeff());
    const Eigen::Matrix<double, 7, 1> step = -H.ldlt().solve(g);
    const double promised = -g.dot(step);
    if (!step.allFinite() || !(promised > tolerance * system.cost)) break;
    FactoredF trial = current;
    trial.update(step);
    sampson_system<T>(pairs, in, trial.matrix(), scale, trial_system);
    ++evaluations;
    if (trial_system.cost < system.cost) {
      current = trial;
      std::swap(system, trial_system);
      damping = (std::max)(damping * 0.1, 1e-9);
    } else {
      damping = (std::max)(damping * 100, 1e-4);
      if (damping > 1e6) break;
    }
  }
  F = current.matrix();
  return evaluations;
}

}  // namespace cfp::detail
