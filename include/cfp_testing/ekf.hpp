/// @file ekf.hpp
/// A small extended Kalman filter with fixed sizes and any model: what cfp/detection/box_motion.hpp, which knows its
/// model, is held equal to. Nothing allocates.
#pragma once

#include <cmath>

#include <Eigen/Core>

#include "cfp/core/numeric.hpp"
#include "cfp/core/status.hpp"

namespace cfp_testing {

/// Mean and covariance of n states. Stored without alignment demands, so that the layout does not depend on vector
/// flags.
template <typename Scalar, int n>
struct EkfState {
  Eigen::Matrix<Scalar, n, 1, Eigen::DontAlign> mean = Eigen::Matrix<Scalar, n, 1>::Zero();
  Eigen::Matrix<Scalar, n, n, Eigen::DontAlign> covariance = Eigen::Matrix<Scalar, n, n>::Identity();
};

struct EkfUpdate {
  cfp::Status status =
      cfp::Status::ok;  ///< invalid_input: something was not finite; degenerate: S was not positive definite
  /// r' S^-1 r of the innovation r; chi-squared with m degrees of freedom when the model holds
  double mahalanobis_sq = 0;
};

namespace detail {

// S = L L' in place, L in the lower triangle. False unless every pivot stands out of the rounding of the diagonal.
template <typename Scalar, int m>
[[nodiscard]] bool factor_innovation(Eigen::Matrix<Scalar, m, m>& S) noexcept {
  using std::sqrt;
  const Scalar least = Scalar(cfp::Tolerance<Scalar>::degenerate) * S.diagonal().maxCoeff();
  for (int j = 0; j < m; ++j) {
    const Scalar pivot = S(j, j) - S.row(j).head(j).squaredNorm();
    if (!(pivot > least) || !(pivot > Scalar(0))) return false;
    S(j, j) = sqrt(pivot);
    for (int i = j + 1; i < m; ++i) S(i, j) = (S(i, j) - S.row(i).head(j).dot(S.row(j).head(j))) / S(j, j);
  }
  return true;
}

}  // namespace detail

/// Prediction: mean <- f(mean), P <- F P F' + Q, symmetrised. `motion(mean, F)` returns f(mean) and writes its Jacobian
/// F at the mean (n x n). Returns false, and leaves the state as it was, when the result is not finite.
template <typename Scalar, int n, typename Motion, typename Noise>
[[nodiscard]] bool ekf_predict(EkfState<Scalar, n>& state, Motion&& motion,
                               const Eigen::MatrixBase<Noise>& Q) noexcept {
  using Square = Eigen::Matrix<Scalar, n, n>;
  Square F;
  const Eigen::Matrix<Scalar, n, 1> before = state.mean;
  const Eigen::Matrix<Scalar, n, 1> mean = motion(before, F);
  const Square P = F * state.covariance * F.transpose() + Q;
  if (!mean.allFinite() || !P.allFinite()) return false;
  state.mean = mean;
  state.covariance = Scalar(0.5) * (P + P.transpose());
  return true;
}

/// Update with a measurement z of m numbers: r = z - h(mean), S = H P H' + R = L L', K = P H' S^-1 (by two triangular
/// solves, never an inverse), mean <- mean + K r, P <- (I - K H) P (I - K H)' + K R K' (Joseph's form, symmetrised: P
/// stays positive semi-definite). `measure(mean, H)` returns h(mean) and writes its Jacobian H (m x n). On any status
/// but ok the state is left as it was.
template <typename Scalar, int n, int m, typename Measure, typename Noise>
EkfUpdate ekf_update(EkfState<Scalar, n>& state, const Eigen::Matrix<Scalar, m, 1>& z, Measure&& measure,
                     const Eigen::MatrixBase<Noise>& R) noexcept {
  using Square = Eigen::Matrix<Scalar, n, n>;
  Eigen::Matrix<Scalar, m, n> H;
  const Eigen::Matrix<Scalar, n, 1> before = state.mean;
  const Square P = state.covariance;
  const Eigen::Matrix<Scalar, m, 1> r = z - measure(before, H);
  Eigen::Matrix<Scalar, m, n> K_transposed = H * P;
  Eigen::Matrix<Scalar, m, m> S = K_transposed * H.transpose() + R;
  if (!r.allFinite() || !S.allFinite()) return {cfp::Status::invalid_input, 0};
  if (!detail::factor_innovation(S)) return {cfp::Status::degenerate, 0};
  const auto L = S.template triangularView<Eigen::Lower>();
  L.solveInPlace(K_transposed);
  S.transpose().template triangularView<Eigen::Upper>().solveInPlace(K_transposed);
  const Eigen::Matrix<Scalar, n, m> K = K_transposed.transpose();
  const Eigen::Matrix<Scalar, n, 1> mean = before + K * r;
  const Square A = Square::Identity() - K * H;
  const Square joseph = A * P * A.transpose() + K * R * K.transpose();
  if (!mean.allFinite() || !joseph.allFinite()) return {cfp::Status::invalid_input, 0};
  state.mean = mean;
  state.covariance = Scalar(0.5) * (joseph + joseph.transpose());
  return {cfp::Status::ok, static_cast<double>(L.solve(r).squaredNorm())};
}

}  // namespace cfp_testing
