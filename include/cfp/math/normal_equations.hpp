/// @file normal_equations.hpp
/// One damped Gauss-Newton step for a handful of unknowns. What Eigen's LDLT does at these sizes, but unrolled for the
/// size, aware of the scale of each unknown, and compiled in a tenth of the time.
#pragma once

#include <cmath>

#include <Eigen/Core>

#include "cfp/core/numeric.hpp"

namespace cfp::detail {

/// H step = -g, H symmetric (its upper triangle counts). For local use: alignment depends on flags.
template <int N>
struct NormalEquations {
  Eigen::Matrix<double, N, N> H = Eigen::Matrix<double, N, N>::Zero();
  Eigen::Matrix<double, N, 1> g = Eigen::Matrix<double, N, 1>::Zero();
};

}  // namespace cfp::detail

namespace cfp {
inline namespace CFP_ISA {

/// Solves (H + damping diag H) step = -g by Cholesky (L D L^T) of the matrix scaled to a unit diagonal; H symmetric,
/// its upper triangle is read. False, and step meaningless, for an H that is not positive definite, one of whose
/// pivots, 1 - (multiple correlation)^2 of an unknown with those before it, does not stand out of the rounding of H, or
/// when the step is not finite. A pivot is v' H v with v = (-regression on those before, 1): elements of H with a
/// relative error of `tolerance` move it by up to tolerance |v|_1^2. Allocates nothing.
template <int N>
[[nodiscard]] bool solve_normal_equations(const Eigen::Matrix<double, N, N>& H, const Eigen::Matrix<double, N, 1>& g,
                                          double damping, double tolerance,
                                          Eigen::Matrix<double, N, 1>& step) noexcept {
  constexpr std::size_t n = static_cast<std::size_t>(N);
  double scale[n], L[n][n], V[n][n], pivot[n], inverse[n];  // V = L^-1
  for (int i = 0; i < N; ++i) {
    if (!(H(i, i) > 0) || !is_finite(H(i, i))) return false;
    scale[i] = 1 / std::sqrt(H(i, i));
  }
  for (int j = 0; j < N; ++j) {
    double d = 1 + damping;
    for (int k = 0; k < j; ++k) d -= L[j][k] * L[j][k] * pivot[k];
    double spread = 1;
    for (int i = 0; i < j; ++i) {
      V[j][i] = -L[j][i];
      for (int k = i + 1; k < j; ++k) V[j][i] -= L[j][k] * V[k][i];
      spread += std::abs(V[j][i]);
    }
    if (!(d > tolerance * spread * spread)) return false;
    pivot[j] = d;
    inverse[j] = 1 / d;
    for (int i = j + 1; i < N; ++i) {
      double sum = H(j, i) * scale[j] * scale[i];
      for (int k = 0; k < j; ++k) sum -= L[i][k] * L[j][k] * pivot[k];
      L[i][j] = sum * inverse[j];
    }
  }
  for (int i = 0; i < N; ++i) {
    step[i] = -g[i] * scale[i];
    for (int k = 0; k < i; ++k) step[i] -= L[i][k] * step[k];
  }
  for (int i = N - 1; i >= 0; --i) {
    step[i] *= inverse[i];
    for (int k = i + 1; k < N; ++k) step[i] -= L[k][i] * step[k];
  }
  bool finite = true;
  for (int i = 0; i < N; ++i) {
    step[i] *= scale[i];
    finite = finite && is_finite(step[i]);
  }
  return finite;
}

/// By how much the quadratic model falls with that step: step^T (damping diag(H) step - g).
template <int N>
[[nodiscard]] double predicted_decrease(const Eigen::Matrix<double, N, N>& H, const Eigen::Matrix<double, N, 1>& g,
                                        double damping, const Eigen::Matrix<double, N, 1>& step) noexcept {
  return step.dot(damping * H.diagonal().cwiseProduct(step) - g);
}

}  // namespace CFP_ISA
}  // namespace cfp
