// The 8-state EKF of box_motion.hpp, written with general matrices: the reference of the split filter, and what it
// would cost.
#pragma once

#include <array>
#include <cmath>

#include "cfp/detection/box_motion.hpp"
#include "cfp_testing/ekf.hpp"

namespace cfp_test {

/// The measurement of the 8-state form (u, v, log width, log height, then their rates): edges (x1, x2, y1, y2) and
/// Jacobian.
inline Eigen::Vector4d box_edges(const Eigen::Matrix<double, 8, 1>& state, Eigen::Matrix<double, 4, 8>& H) {
  const double w = 0.5 * std::exp(state[2]), h = 0.5 * std::exp(state[3]);
  H.setZero();
  H(0, 0) = H(1, 0) = H(2, 1) = H(3, 1) = 1;
  H(0, 2) = -w;
  H(1, 2) = w;
  H(2, 3) = -h;
  H(3, 3) = h;
  return {state[0] - w, state[0] + w, state[1] - h, state[1] + h};
}

struct DenseBoxFilter {
  using Vector8 = Eigen::Matrix<double, 8, 1>;
  using Matrix8 = Eigen::Matrix<double, 8, 8>;
  cfp_testing::EkfState<double, 8> state;
  double distance_sq = 0;  // Mahalanobis, of the last measurement

  template <typename Scalar>
  explicit DenseBoxFilter(const cfp::BoxFilter<Scalar>& f) {
    state.covariance.setZero();
    const std::array<cfp::RateFilter<Scalar>, 4> parts{f.u, f.v, f.log_width, f.log_height};
    for (int i = 0; i < 4; ++i) {
      const auto& p = parts[static_cast<std::size_t>(i)];
      state.mean[i] = static_cast<double>(p.value);
      state.mean[i + 4] = static_cast<double>(p.rate);
      state.covariance(i, i) = static_cast<double>(p.var_value);
      state.covariance(i, i + 4) = state.covariance(i + 4, i) = static_cast<double>(p.covariance);
      state.covariance(i + 4, i + 4) = static_cast<double>(p.var_rate);
    }
  }
  [[nodiscard]] bool predict(double dt, const cfp::BoxMotionOptions& o) {
    Matrix8 Q = Matrix8::Zero();
    const double centre = o.centre_acceleration * std::exp(state.mean[2]);
    const std::array<double, 4> q{centre, centre, o.size_acceleration, o.size_acceleration};
    for (int i = 0; i < 4; ++i) {
      const double d = q[static_cast<std::size_t>(i)] * q[static_cast<std::size_t>(i)];
      Q(i, i) = d * dt * dt * dt / 3;
      Q(i, i + 4) = Q(i + 4, i) = d * dt * dt / 2;
      Q(i + 4, i + 4) = d * dt;
    }
    const auto motion = [&](const Vector8& m, Matrix8& F) -> Vector8 {
      F.setIdentity();
      F.topRightCorner<4, 4>() = dt * Eigen::Matrix4d::Identity();
      return F * m;
    };
    return cfp_testing::ekf_predict(state, motion, Q);
  }
  [[nodiscard]] bool correct(const cfp::Box<double>& b, const cfp::BoxMotionOptions& o) {
    const double sx = o.edge_noise * std::exp(state.mean[2]), sy = o.edge_noise * std::exp(state.mean[3]);
    const Eigen::Matrix4d R = Eigen::Vector4d(sx * sx, sx * sx, sy * sy, sy * sy).asDiagonal();
    const Eigen::Vector4d z(b.x1, b.x2, b.y1, b.y2);
    const auto measure = [](const Vector8& m, Eigen::Matrix<double, 4, 8>& H) { return box_edges(m, H); };
    const cfp_testing::EkfUpdate update = cfp_testing::ekf_update(state, z, measure, R);
    distance_sq = update.mahalanobis_sq;
    return update.status == cfp::Status::ok;
  }
};

}  // namespace cfp_test
