/// @file pose_step.hpp
/// The step of a pose from its normal equations, and what the Hessian learns from a step (internal to weighted_pnp.hpp).
#pragma once

#include <cmath>

#include <Eigen/Core>

#include "cfp/core/numeric.hpp"
#include "cfp/math/se3.hpp"

namespace cfp::detail {

/// Solves (H + damping diag H) step = -g by Cholesky (L D L^T) of the matrix scaled to a unit diagonal; H: upper triangle.
/// False for an H that is not positive definite, or whose smallest pivot, 1 - (multiple correlation)^2, is below `tolerance`.
inline bool solve_pose_step(const Matrix6<double>& H, const Vector6<double>& g, double damping, double tolerance, Vector6<double>& step) noexcept {
  double scale[6], L[6][6], pivot[6], inverse[6];
  for (int i = 0; i < 6; ++i) {
    if (!(H(i, i) > 0) || !is_finite(H(i, i))) return false;
    scale[i] = 1 / std::sqrt(H(i, i));
  }
  for (int j = 0; j < 6; ++j) {
    double d = 1 + damping;
    for (int k = 0; k < j; ++k) d -= L[j][k] * L[j][k] * pivot[k];
    if (!(d > tolerance)) return false;
    pivot[j] = d;
    inverse[j] = 1 / d;
    for (int i = j + 1; i < 6; ++i) {
      double sum = H(j, i) * scale[j] * scale[i];
      for (int k = 0; k < j; ++k) sum -= L[i][k] * L[j][k] * pivot[k];
      L[i][j] = sum * inverse[j];
    }
  }
  for (int i = 0; i < 6; ++i) {
    step[i] = -g[i] * scale[i];
    for (int k = 0; k < i; ++k) step[i] -= L[i][k] * step[k];
  }
  for (int i = 5; i >= 0; --i) {
    step[i] *= inverse[i];
    for (int k = i + 1; k < 6; ++k) step[i] -= L[k][i] * step[k];
  }
  bool finite = true;
  for (int i = 0; i < 6; ++i) {
    step[i] *= scale[i];
    finite = finite && is_finite(step[i]);
  }
  return finite;
}

/// Lets H + correction map the last step to the change of the gradient that it brought; both stay symmetric and positive.
inline void learn_curvature(const Matrix6<double>& H, const Vector6<double>& change, const Vector6<double>& step, Matrix6<double>& correction) noexcept {
  const Matrix6<double> model = H + correction;
  Vector6<double> expected;
  expected.noalias() = model.selfadjointView<Eigen::Upper>() * step;
  const double curvature = step.dot(expected), seen = step.dot(change);
  if (!(seen > 0.1 * curvature)) return;
  for (int i = 0; i < 6; ++i) {
    for (int j = i; j < 6; ++j) correction(i, j) += change[i] * change[j] / seen - expected[i] * expected[j] / curvature;
  }
}

}  // namespace cfp::detail
