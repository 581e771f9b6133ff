#include "cfp_testing/ekf.hpp"

#include <cmath>
#include <limits>

#include <Eigen/LU>

#include "cfp/core/random.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"

namespace {

template <int rows, int cols>
Eigen::Matrix<double, rows, cols> random_matrix(cfp::Random& random) {
  Eigen::Matrix<double, rows, cols> m;
  for (double& value : m.reshaped()) value = random.normal();
  return m;
}

template <int n>
Eigen::Matrix<double, n, n> random_covariance(cfp::Random& random) {
  const Eigen::Matrix<double, n, n> A = random_matrix<n, n>(random);
  return A * A.transpose() + 0.1 * Eigen::Matrix<double, n, n>::Identity();
}

// Of two states, the first.
struct FirstState {
  Eigen::Matrix<float, 1, 1> operator()(const Eigen::Vector2f& mean, Eigen::Matrix<float, 1, 2>& H) const {
    H << 1, 0;
    return Eigen::Matrix<float, 1, 1>(mean[0]);
  }
};

}  // namespace

TEST_CASE("On a linear model the EKF is the textbook Kalman filter", "[detection]") {
  using Matrix24 = Eigen::Matrix<double, 2, 4>;
  cfp::Random random(1, "linear kalman");
  for (int repetition = 0; repetition < 100; ++repetition) {
    const Eigen::Matrix4d F = random_matrix<4, 4>(random), Q = random_covariance<4>(random);
    const Matrix24 H = random_matrix<2, 4>(random);
    const Eigen::Matrix2d R = random_covariance<2>(random);
    const Eigen::Vector2d z = random_matrix<2, 1>(random);
    cfp_testing::EkfState<double, 4> state;
    state.mean = random_matrix<4, 1>(random);
    state.covariance = random_covariance<4>(random);

    // The oracle, with explicit inverses: information form of the update.
    const Eigen::Matrix4d P = F * state.covariance * F.transpose() + Q, P_inverse = P.inverse();
    const Eigen::Matrix2d R_inverse = R.inverse(), S = H * P * H.transpose() + R;
    const Eigen::Vector4d predicted = F * state.mean;
    const Eigen::Vector2d r = z - H * predicted;
    const double mahalanobis_sq = r.dot(S.inverse() * r);
    const Eigen::Matrix<double, 4, 2> weighted = H.transpose() * R_inverse;
    const Eigen::Matrix4d information = P_inverse + weighted * H, posterior = information.inverse();
    const Eigen::Vector4d x = predicted + posterior * (weighted * r);

    const auto motion = [&](const Eigen::Vector4d& m, Eigen::Matrix4d& J) -> Eigen::Vector4d { return (J = F) * m; };
    const auto measure = [&](const Eigen::Vector4d& m, Matrix24& J) -> Eigen::Vector2d { return (J = H) * m; };
    REQUIRE(cfp_testing::ekf_predict(state, motion, Q));
    const cfp_testing::EkfUpdate update = cfp_testing::ekf_update(state, z, measure, R);
    REQUIRE(update.status == cfp::Status::ok);
    CHECK((state.mean - x).norm() <= 1e-10 * (1 + x.norm()));
    CHECK((state.covariance - posterior).norm() <= 1e-10 * (1 + posterior.norm()));
    CHECK_THAT(update.mahalanobis_sq, WithinAbs(mahalanobis_sq, 1e-10 * (1 + mahalanobis_sq)));
    CHECK(state.covariance == state.covariance.transpose());
  }
}

TEST_CASE("The covariance stays positive semi-definite over thousands of nearly exact measurements", "[detection]") {
  cfp_testing::EkfState<float, 2> state;
  state.covariance *= 1e6F;
  Eigen::Matrix2f F, Q = Eigen::Matrix2f::Zero();
  F << 1, 0.1F, 0, 1;
  Q(1, 1) = 1e-6F;
  const Eigen::Matrix<float, 1, 1> R(1e-6F), z(1.0F);
  const auto motion = [&](const Eigen::Vector2f& m, Eigen::Matrix2f& J) -> Eigen::Vector2f { return (J = F) * m; };
  for (int k = 0; k < 5000; ++k) {
    REQUIRE(cfp_testing::ekf_predict(state, motion, Q));
    REQUIRE(cfp_testing::ekf_update(state, z, FirstState{}, R).status == cfp::Status::ok);
    const auto& P = state.covariance;
    const double half_sum = 0.5 * (double{P(0, 0)} + double{P(1, 1)});
    const double smaller = half_sum - std::hypot(0.5 * (double{P(0, 0)} - double{P(1, 1)}), double{P(0, 1)});
    REQUIRE(smaller >= -1e-9);  // of the two eigenvalues
  }
}

TEST_CASE("The EKF leaves the state alone when it cannot use a measurement, and allocates nothing", "[detection]") {
  cfp_testing::EkfState<float, 2> state;
  const auto before = state;
  const auto update = [&](float z, float R) {
    using Measured = Eigen::Matrix<float, 1, 1>;
    return cfp_testing::ekf_update(state, Measured(z), FirstState{}, Measured(R)).status;
  };
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  CHECK(update(nan, 1) == cfp::Status::invalid_input);
  CHECK(update(1, nan) == cfp::Status::invalid_input);
  CHECK(update(1, -1) == cfp::Status::degenerate);
  CHECK(update(1, -2) == cfp::Status::degenerate);
  const auto explode = [&](const Eigen::Vector2f& m, Eigen::Matrix2f& J) -> Eigen::Vector2f {
    J.setConstant(1e30F);
    return m;
  };
  CHECK_FALSE(cfp_testing::ekf_predict(state, explode, Eigen::Matrix2f(Eigen::Matrix2f::Zero())));
  CHECK(state.mean == before.mean);
  CHECK(state.covariance == before.covariance);
  CHECK(cfp_test::allocations_in([&] { (void)update(1, 1); }) == 0);
  CHECK_THAT(state.mean[0], WithinAbs(0.5, 1e-6));  // prior 0 +- 1 and measurement 1 +- 1
  CHECK_THAT(state.covariance(0, 0), WithinAbs(0.5, 1e-6));
}
