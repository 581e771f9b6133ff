#include "cfp/math/normal_equations.hpp"

#include <cmath>
#include <limits>

#include <Eigen/Cholesky>

#include "cfp/core/random.hpp"
#include "support/catch.hpp"

using cfp::solve_normal_equations;

namespace {

Eigen::MatrixXd random_hessian(cfp::Random& random, int n) {
  Eigen::MatrixXd J(n, n);
  for (double& value : J.reshaped()) value = random.normal();
  return J.transpose() * J;
}

// The truth is of dynamic size: Eigen's factorization of each fixed one takes seconds to compile.
template <int N>
void agrees_with_eigen() {
  cfp::Random random(5, "normal equations");
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::MatrixXd H = random_hessian(random, N);
    Eigen::VectorXd g(N);
    for (double& value : g) value = random.normal();
    const double damping = trial % 2 == 0 ? 0 : random.uniform(0, 1);
    Eigen::MatrixXd damped = H;
    damped.diagonal() *= 1 + damping;
    Eigen::Matrix<double, N, 1> found;
    REQUIRE(
        solve_normal_equations<N>(Eigen::Matrix<double, N, N>(H), Eigen::Matrix<double, N, 1>(g), damping, 0, found));
    const Eigen::VectorXd step = found;
    CHECK((damped * step + g).norm() <= 1e-9 * (damped.norm() * step.norm() + g.norm()));
    CHECK((step + damped.ldlt().solve(g)).norm() <= 1e-6 * step.norm());
  }
}

}  // namespace

TEST_CASE("The step solves the damped normal equations", "[math]") {
  agrees_with_eigen<1>();
  agrees_with_eigen<3>();
  agrees_with_eigen<6>();
  agrees_with_eigen<8>();
}

TEST_CASE("The inverse of an information is its covariance, and a singular one has none", "[math]") {
  cfp::Random random(8, "normal equations");
  Eigen::Matrix<double, 6, 6> inverse;
  for (int trial = 0; trial < 100; ++trial) {
    const Eigen::MatrixXd H = random_hessian(random, 6);
    REQUIRE(cfp::invert_normal_equations<6>(H, 0, inverse));
    const Eigen::MatrixXd expected = H.ldlt().solve(Eigen::MatrixXd::Identity(6, 6)), found = inverse;
    CHECK((found - expected).norm() <= 1e-6 * expected.norm());
    CHECK((found - found.transpose()).norm() <= 1e-12 * found.norm());
    Eigen::Matrix<double, 6, 6> singular = H;
    singular.col(5) = singular.col(4);
    singular.row(5) = singular.row(4);
    CHECK_FALSE(cfp::invert_normal_equations<6>(singular, 1e-12, inverse));
  }
}

TEST_CASE("Units of the unknowns do not matter to the step", "[math]") {
  cfp::Random random(6, "normal equations");
  for (int trial = 0; trial < 100; ++trial) {
    const Eigen::Matrix<double, 6, 6> H = random_hessian(random, 6);
    Eigen::Matrix<double, 6, 1> g, unit, step, scaled;
    for (int i = 0; i < 6; ++i)
      g[i] = random.normal(), unit[i] = std::ldexp(1.0, static_cast<int>(random.index(80)) - 40);
    REQUIRE(solve_normal_equations<6>(H, g, 0.1, 0, step));
    const Eigen::Matrix<double, 6, 6> other = unit.asDiagonal() * H * unit.asDiagonal();
    REQUIRE(solve_normal_equations<6>(other, unit.cwiseProduct(g), 0.1, 0, scaled));
    CHECK((unit.cwiseProduct(scaled) - step).norm() <= 1e-9 * step.norm());
  }
}

TEST_CASE("Only the upper triangle is read", "[math]") {
  cfp::Random random(7, "normal equations");
  const Eigen::Matrix<double, 6, 6> H = random_hessian(random, 6);
  Eigen::Matrix<double, 6, 6> upper = H;
  upper.triangularView<Eigen::StrictlyLower>().setConstant(std::numeric_limits<double>::quiet_NaN());
  const Eigen::Matrix<double, 6, 1> g = Eigen::Matrix<double, 6, 1>::Ones();
  Eigen::Matrix<double, 6, 1> a, b;
  REQUIRE(solve_normal_equations<6>(H, g, 0, 0, a));
  REQUIRE(solve_normal_equations<6>(upper, g, 0, 0, b));
  CHECK(a == b);
}

TEST_CASE("An undetermined, indefinite or non-finite system has no step", "[math]") {
  Eigen::Matrix3d H = Eigen::Matrix3d::Identity();
  const Eigen::Vector3d g(1, 2, 3);
  Eigen::Vector3d step;
  CHECK(solve_normal_equations<3>(H, g, 0, 0.5, step));
  H(1, 1) = 0;
  CHECK_FALSE(solve_normal_equations<3>(H, g, 0, 0, step));
  H(1, 1) = -1;
  CHECK_FALSE(solve_normal_equations<3>(H, g, 0, 0, step));
  H = Eigen::Matrix3d::Ones();
  CHECK_FALSE(solve_normal_equations<3>(H, g, 0, 1e-12, step));
  CHECK(solve_normal_equations<3>(H, g, 1e-3, 1e-12, step));
  H = Eigen::Matrix3d::Identity();
  H(0, 1) = H(1, 0) = 0.99;  // pivot 1 - 0.99^2 = 0.0199 of v = (-0.99, 1): 0.0199 / 1.99^2 = 0.005025
  CHECK(solve_normal_equations<3>(H, g, 0, 0.00502, step));
  CHECK_FALSE(solve_normal_equations<3>(H, g, 0, 0.00503, step));
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    H = Eigen::Matrix3d::Identity();
    H(2, 2) = bad;
    CHECK_FALSE(solve_normal_equations<3>(H, g, 0, 0, step));
    CHECK_FALSE(solve_normal_equations<3>(Eigen::Matrix3d::Identity(), Eigen::Vector3d(0, bad, 0), 0, 0, step));
  }
}
