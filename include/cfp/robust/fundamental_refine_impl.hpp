/// @file fundamental_refine_impl.hpp
/// Robust refinement of F for fundamental_ransac.hpp: normal equations of the Sampson distance, Levenberg-Marquardt on
/// the seven parameters of F. Not an interface.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include <Eigen/Core>
#include <Eigen/SVD>

#include "cfp/math/normal_equations.hpp"
#include "cfp/math/so3.hpp"
#include "cfp/robust/fundamental_pairs_impl.hpp"

namespace cfp::detail {

// Normal equations over the nine entries (row-major) of F of sum w rho(d^2 / scale), and that sum; rho(x) = x / (1 +
// x), the loss of Geman and McClure: bounded like MSAC's, but smooth, so that pairs near the threshold count by
// degrees. With d = e / n and k = e / n^2, d(d)/dF_ij = (q_i p_j - k (l_i p_j [i < 2] + m_j q_i [j < 2])) / n. The
// gradient is exact; H leaves out the k terms, a thousandth of the others for pairs that count, and so is made of 36
// moments.
struct SampsonSystem {
  Eigen::Matrix<double, 9, 9> H;
  Eigen::Matrix<double, 9, 1> g;
  double cost = 0;
};

template <typename T>
void sampson_system(const PairColumns<T>& in, const Matrix3<double>& F, double scale, SampsonSystem& out) noexcept {
  using P = Packet<T>;
  const Matrix3<T> f = F.cast<T>();
  const P zero(T(0)), one(T(1)), tiny(T(1e-30)), inverse_scale(T(1 / scale));
  P moments[6][6], g[9], cost = zero;
  for (auto& row : moments) {
    for (P& m : row) m = zero;
  }
  for (P& h : g) h = zero;
  for (std::size_t i = 0; i < in.size; i += static_cast<std::size_t>(lanes_of<P>)) {
    const SampsonPacket<T> pair(in, i, f);
    const P inverse_n2 = reciprocal(pair.n2 + tiny);
    const P k = pair.e * inverse_n2;
    const P x = pair.e * k * inverse_scale;
    const P s = reciprocal(x + one);
    const P ws = cfp::load<P>(in.weight + i) * s;
    cost = multiply_add(ws, x, cost);
    const P weight = ws * s * inverse_n2, we = weight * pair.e;
    const P p[2] = {pair.p0, pair.p1}, wq[2] = {weight * pair.q0, weight * pair.q1}, m[2] = {k * pair.m0, k * pair.m1};
    const P qq[6] = {wq[0] * pair.q0, wq[0] * pair.q1, wq[0], wq[1] * pair.q1, wq[1], weight};
    const P pp[5] = {p[0] * p[0], p[0] * p[1], p[0], p[1] * p[1], p[1]};
    for (int r = 0; r < 6; ++r) {
      for (int c = 0; c < 5; ++c) moments[r][c] = multiply_add(qq[r], pp[c], moments[r][c]);
      moments[r][5] += qq[r];
    }
    const P a[3] = {we * (pair.q0 - k * pair.l0), we * (pair.q1 - k * pair.l1), we},
            b[3] = {we * pair.q0, we * pair.q1, we};
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 2; ++c) g[3 * r + c] += a[r] * p[c] - b[r] * m[c];
      g[3 * r + 2] += a[r];
    }
  }
  constexpr int symmetric[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
  double moment[6][6];
  for (int r = 0; r < 6; ++r) {
    for (int c = 0; c < 6; ++c) moment[r][c] = static_cast<double>(reduce_add(moments[r][c])) / scale;
  }
  for (int r = 0; r < 9; ++r) {
    out.g[r] = static_cast<double>(reduce_add(g[r])) / scale;
    for (int c = 0; c < 9; ++c) out.H(r, c) = moment[symmetric[r / 3][c / 3]][symmetric[r % 3][c % 3]];
  }
  out.cost = static_cast<double>(reduce_add(cost));
}

// F = U diag(cos t, sin t, 0) V^T with U <- U exp(a), V <- V exp(b): seven parameters (a, b, t), rank 2 and unit norm
// by construction. Source: Bartoli and Sturm, "Nonlinear estimation of the fundamental matrix with minimal parameters",
// PAMI 2004.
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

// Levenberg-Marquardt on sum w rho(d^2 / scale) from F (scaled pixels). Ends after max_evaluations, when a step
// promises less than `tolerance` of the cost, or when even twice the promise would leave the cost above `bound`.
// Returns the cost of F, which is replaced only by one of lower cost.
template <typename T>
double refine_fundamental(const PairColumns<T>& in, double scale, int max_evaluations, double tolerance, FactoredF& F,
                          double bound = std::numeric_limits<double>::infinity()) noexcept {
  SampsonSystem system, trial_system;
  sampson_system(in, F.matrix(), scale, system);
  double damping = 1e-6;
  for (int evaluations = 1; evaluations < max_evaluations; ++evaluations) {
    const Eigen::Matrix<double, 9, 7> B = F.tangents();
    const Eigen::Matrix<double, 9, 7> HB = system.H.lazyProduct(B);
    const Eigen::Matrix<double, 7, 7> H = B.transpose().lazyProduct(HB);
    const Eigen::Matrix<double, 7, 1> g = B.transpose().lazyProduct(system.g);
    Eigen::Matrix<double, 7, 1> step;
    if (!solve_normal_equations<7>(H, g, damping, 1e-12, step)) break;
    const double promised = -g.dot(step);
    if (!(promised > tolerance * system.cost) || system.cost - 2 * promised > bound) break;
    FactoredF trial = F;
    trial.update(step);
    sampson_system(in, trial.matrix(), scale, trial_system);
    if (trial_system.cost < system.cost) {
      F = trial;
      std::swap(system, trial_system);
      damping = (std::max)(damping * 0.1, 1e-9);
    } else {
      damping = (std::max)(damping * 100, 1e-4);
      if (damping > 1e6) break;
    }
  }
  return system.cost;
}

}  // namespace cfp::detail
