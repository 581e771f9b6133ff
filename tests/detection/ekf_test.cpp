#include "cfp_testing/ekf.hpp"

#include <cmath>
#include <type_traits>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "cfp/core/random.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"
#include "support/numbers.hpp"

using cfp_test::nan_value;

namespace {

template <typename Scalar, int rows, int cols>
Eigen::Matrix<Scalar, rows, cols> random_matrix(cfp::Random& random) {
  Eigen::Matrix<Scalar, rows, cols> m;
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < cols; ++j) m(i, j) = Scalar(random.normal());
  }
  return m;
}

template <typename Scalar, int n>
Eigen::Matrix<Scalar, n, n> random_covariance(cfp::Random& random) {
  const Eigen::Matrix<Scalar, n, n> A = random_matrix<Scalar, n, n>(random);
  return A * A.transpose() + Scalar(0.1) * Eigen::Matrix<Scalar, n, n>::Identity();
}

}  // namespace

TEMPLATE_TEST_CASE("On a linear model the EKF is the textbook Kalman filter", "[detection]", float, double) {
  using Matrix4 = Eigen::Matrix<TestType, 4, 4>;
  using Matrix24 = Eigen::Matrix<TestType, 2, 4>;
  cfp::Random random(1, "linear kalman");
  const double tolerance = std::is_same_v<TestType, float> ? 2e-3 : 1e-10;
  for (int repetition = 0; repetition < 100; ++repetition) {
    const Matrix4 F = random_matrix<TestType, 4, 4>(random), Q = random_covariance<TestType, 4>(random);
    const Matrix24 H = random_matrix<TestType, 2, 4>(random);
    const Eigen::Matrix<TestType, 2, 2> R = random_covariance<TestType, 2>(random);
    const Eigen::Matrix<TestType, 2, 1> z = random_matrix<TestType, 2, 1>(random);
    cfp_testing::EkfState<TestType, 4> state;
    state.mean = random_matrix<TestType, 4, 1>(random);
    state.covariance = random_covariance<TestType, 4>(random);

    // The oracle, in double, with explicit inverses: information form of the update.
    Eigen::Vector4d x = F.template cast<double>() * state.mean.template cast<double>();
    Eigen::Matrix4d P =
        F.template cast<double>() * state.covariance.template cast<double>() * F.template cast<double>().transpose() +
        Q.template cast<double>();
    const Eigen::Matrix<double, 2, 4> Hd = H.template cast<double>();
    const Eigen::Matrix2d Rd = R.template cast<double>();
    const Eigen::Vector2d r = z.template cast<double>() - Hd * x;
    const double mahalanobis_sq = r.dot((Hd * P * Hd.transpose() + Rd).inverse() * r);
    const Eigen::Matrix4d posterior = (P.inverse() + Hd.transpose() * Rd.inverse() * Hd).inverse();
    x += posterior * Hd.transpose() * Rd.inverse() * r;

    const auto motion = [&](const Eigen::Matrix<TestType, 4, 1>& m, Matrix4& J) -> Eigen::Matrix<TestType, 4, 1> {
      J = F;
      return F * m;
    };
    const auto measure = [&](const Eigen::Matrix<TestType, 4, 1>& m, Matrix24& J) -> Eigen::Matrix<TestType, 2, 1> {
      J = H;
      return H * m;
    };
    REQUIRE(cfp_testing::ekf_predict(state, motion, Q));
    const cfp_testing::EkfUpdate update = cfp_testing::ekf_update(state, z, measure, R);
    REQUIRE(update.status == cfp::Status::ok);
    CHECK((state.mean.template cast<double>() - x).norm() <= tolerance * (1 + x.norm()));
    CHECK((state.covariance.template cast<double>() - posterior).norm() <= tolerance * (1 + posterior.norm()));
    CHECK_THAT(update.mahalanobis_sq, WithinAbs(mahalanobis_sq, tolerance * (1 + mahalanobis_sq)));
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
  for (int k = 0; k < 5000; ++k) {
    REQUIRE(cfp_testing::ekf_predict(
        state, [&](const Eigen::Vector2f& m, Eigen::Matrix2f& J) -> Eigen::Vector2f { return (J = F) * m; }, Q));
    const auto measure = [](const Eigen::Vector2f& m, Eigen::Matrix<float, 1, 2>& H) {
      H << 1, 0;
      return Eigen::Matrix<float, 1, 1>(m[0]);
    };
    REQUIRE(cfp_testing::ekf_update(state, z, measure, R).status == cfp::Status::ok);
    REQUIRE(
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix2f>(Eigen::Matrix2f(state.covariance)).eigenvalues().minCoeff() >=
        -1e-9F);
  }
}

TEST_CASE("The EKF leaves the state alone when it cannot use a measurement, and allocates nothing", "[detection]") {
  using Measured = Eigen::Matrix<double, 1, 1>;
  cfp_testing::EkfState<double, 2> state;
  const auto measure = [](const Eigen::Vector2d& m, Eigen::Matrix<double, 1, 2>& H) {
    H << 1, 0;
    return Measured(m[0]);
  };
  const auto before = state;
  CHECK(cfp_testing::ekf_update(state, Measured(nan_value), measure, Measured(1.0)).status ==
        cfp::Status::invalid_input);
  CHECK(cfp_testing::ekf_update(state, Measured(1.0), measure, Measured(nan_value)).status ==
        cfp::Status::invalid_input);
  CHECK(cfp_testing::ekf_update(state, Measured(1.0), measure, Measured(-1.0)).status == cfp::Status::degenerate);
  CHECK(cfp_testing::ekf_update(state, Measured(1.0), measure, Measured(-2.0)).status == cfp::Status::degenerate);
  const auto explode = [&](const Eigen::Vector2d& m, Eigen::Matrix2d& J) -> Eigen::Vector2d {
    J.setConstant(1e200);
    return m;
  };
  CHECK_FALSE(cfp_testing::ekf_predict(state, explode, Eigen::Matrix2d(Eigen::Matrix2d::Zero())));
  CHECK(state.mean == before.mean);
  CHECK(state.covariance == before.covariance);
  CHECK(cfp_test::allocations_in(
            [&] { (void)cfp_testing::ekf_update(state, Measured(1.0), measure, Measured(1.0)); }) == 0);
  CHECK_THAT(state.mean[0], WithinAbs(0.5, 1e-15));  // prior 0 +- 1 and measurement 1 +- 1
  CHECK_THAT(state.covariance(0, 0), WithinAbs(0.5, 1e-15));
}
