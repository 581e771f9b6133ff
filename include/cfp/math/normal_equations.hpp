/// @file normal_equations.hpp
/// One damped Gauss-Newton step for a handful of unknowns. What Eigen's LDLT does at these sizes, but unrolled for the
/// size, aware of the scale of each unknown, and compiled in a tenth of the time. Plain loops: every expression of
/// Eigen's would be compiled once per size in every host's unit.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Core>

#include "cfp/core/numeric.hpp"

namespace cfp::detail {

/// H step = -g, H symmetric (its upper triangle counts). For local use: alignment depends on flags.
template <int N>
struct NormalEquations {
  Eigen::Matrix<double, N, N> H = Eigen::Matrix<double, N, N>::Zero();
  Eigen::Matrix<double, N, 1> g = Eigen::Matrix<double, N, 1>::Zero();
};

inline namespace CFP_ISA {

/// The inverse of L in A = L L^T (lower triangle of A is read) in its place, zeros above; false when A is not positive
/// definite. Row by row with L = M D^1/2, M of unit diagonal, and V = M^-1: with w = V a for what precedes the diagonal
/// in row a of A, the row of V is (-(D^-1 w)^T V, 1), and the roots are left to the end.
template <int N>
[[nodiscard]] bool invert_triangle(Eigen::Matrix<double, N, N>& A) noexcept {
  constexpr std::size_t n = static_cast<std::size_t>(N);
  double V[n][n], inverse[n];  // inverse: of D
  for (int i = 0; i < N; ++i) {
    double l[n] = {}, rest = A(i, i);
    for (int j = 0; j < i; ++j) {
      double w = 0;
      for (int k = 0; k <= j; ++k) w += V[j][k] * A(i, k);
      l[j] = w * inverse[j];
      rest -= w * l[j];
    }
    if (!(rest > 0 && rest <= (std::numeric_limits<double>::max)())) return false;
    inverse[i] = 1 / rest;
    V[i][i] = 1;
    for (int k = 0; k < i; ++k) {
      V[i][k] = 0;
      for (int j = k; j < i; ++j) V[i][k] -= l[j] * V[j][k];
      V[k][i] = 0;
    }
  }
  for (int r = 0; r < N; ++r) {
    const double root = std::sqrt(inverse[r]);
    for (int c = 0; c < N; ++c) A(r, c) = root * V[r][c];
  }
  return true;
}

// The inverse of the Cholesky factor of H + damping diag H, scaled to a unit diagonal: by `scale` on either side. False
// where solve_normal_equations is.
template <int N>
[[nodiscard]] bool invert_scaled(const Eigen::Matrix<double, N, N>& H, double damping, double tolerance,
                                 Eigen::Matrix<double, N, 1>& scale, Eigen::Matrix<double, N, N>& T) noexcept {
  for (int r = 0; r < N; ++r) {
    if (!(H(r, r) > 0) || !is_finite(H(r, r))) return false;
    scale[r] = 1 / std::sqrt(H(r, r));
    for (int c = 0; c < r; ++c) T(r, c) = scale[r] * H(c, r) * scale[c];
    T(r, r) = 1 + damping;
  }
  if (!invert_triangle(T)) return false;
  double spread = 0;  // a row of the inverse triangle is v over the root of its pivot
  for (int r = 0; r < N; ++r) {
    double sum = 0;
    for (int c = 0; c <= r; ++c) sum += std::abs(T(r, c));
    spread = (std::max)(spread, sum);
  }
  return tolerance * spread * spread < 1;
}

}  // namespace CFP_ISA
}  // namespace cfp::detail

namespace cfp {
inline namespace CFP_ISA {

/// Solves (H + damping diag H) step = -g by Cholesky of the matrix scaled to a unit diagonal; H symmetric, its upper
/// triangle is read. False, and step meaningless, for an H that is not positive definite, one of whose pivots, 1 -
/// (multiple correlation)^2 of an unknown with those before it, does not stand out of the rounding of H, or when the
/// step is not finite. A pivot is v' H v with v = (-regression on those before, 1): elements of H with a relative error
/// of `tolerance` move it by up to tolerance |v|_1^2. Allocates nothing.
template <int N>
[[nodiscard]] bool solve_normal_equations(const Eigen::Matrix<double, N, N>& H, const Eigen::Matrix<double, N, 1>& g,
                                          double damping, double tolerance,
                                          Eigen::Matrix<double, N, 1>& step) noexcept {
  Eigen::Matrix<double, N, 1> scale, reduced;
  Eigen::Matrix<double, N, N> T;
  if (!detail::invert_scaled(H, damping, tolerance, scale, T)) return false;
  for (int r = 0; r < N; ++r) {
    reduced[r] = 0;
    for (int c = 0; c <= r; ++c) reduced[r] += T(r, c) * scale[c] * g[c];
  }
  for (int r = 0; r < N; ++r) {
    double sum = 0;
    for (int k = r; k < N; ++k) sum += T(k, r) * reduced[k];
    step[r] = -scale[r] * sum;
  }
  return step.allFinite();
}

/// The inverse of H, which makes a covariance of an information; false, and the inverse meaningless, where
/// solve_normal_equations would be.
template <int N>
[[nodiscard]] bool invert_normal_equations(const Eigen::Matrix<double, N, N>& H, double tolerance,
                                           Eigen::Matrix<double, N, N>& inverse) noexcept {
  Eigen::Matrix<double, N, 1> scale;
  Eigen::Matrix<double, N, N> T;
  if (!detail::invert_scaled(H, 0, tolerance, scale, T)) return false;
  for (int r = 0; r < N; ++r) {
    for (int c = 0; c <= r; ++c) {
      double sum = 0;
      for (int k = r; k < N; ++k) sum += T(k, r) * T(k, c);
      inverse(r, c) = inverse(c, r) = scale[r] * sum * scale[c];
    }
  }
  return inverse.allFinite();
}

}  // namespace CFP_ISA
}  // namespace cfp
