#include "cfp/math/matrix3.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include <Eigen/LU>
#include <Eigen/SVD>

#include "cfp/core/random.hpp"
#include "support/catch.hpp"

using cfp::Matrix3;
using cfp::Vector3;

namespace {

/// Random, nearly singular, badly scaled, of rank one, zero, identity.
Matrix3<double> example(int kind, cfp::Random& random) {
  Matrix3<double> M;
  for (double& x : M.reshaped()) x = random.normal();
  if (kind == 1) M.col(2) = M.col(0) + 1e-9 * M.col(1);
  if (kind == 2) M.row(0) *= 1e-12;
  if (kind == 3) M.col(1) = 2 * M.col(0), M.col(2) = -M.col(0);
  if (kind == 4) M.setZero();
  if (kind == 5) M.setIdentity();
  if (kind == 6) M *= 1e-200;
  if (kind == 7) M *= 1e200;
  return M;
}

}  // namespace

TEST_CASE("Determinant, inverse and cofactors are Eigen's", "[math]") {
  cfp::Random random(61, "matrix3");
  for (int trial = 0; trial < 200; ++trial) {
    const Matrix3<double> M = example(0, random);
    CHECK_THAT(cfp::determinant(M), WithinAbs(M.determinant(), 1e-13));
    CHECK((cfp::inverse(M) - M.inverse()).norm() < 1e-12 * M.inverse().squaredNorm());
    CHECK((cfp::cofactors(M).transpose() * M - M.determinant() * Matrix3<double>::Identity()).norm() < 1e-12);
  }
  CHECK_FALSE(cfp::inverse(Matrix3<double>(Matrix3<double>::Zero())).allFinite());
}

TEST_CASE("The singular value decomposition has rotations and Eigen's singular values", "[math]") {
  cfp::Random random(62, "matrix3");
  for (int trial = 0; trial < 800; ++trial) {
    const Matrix3<double> M = example(trial % 8, random);
    const cfp::SVD3<double> found = cfp::svd(M);
    const double size = M.cwiseAbs().maxCoeff();
    CHECK((found.U * found.sigma.asDiagonal() * found.V.transpose() - M).cwiseAbs().maxCoeff() <= 1e-14 * size);
    for (const Matrix3<double>& R : {found.U, found.V}) {
      CHECK((R.transpose() * R - Matrix3<double>::Identity()).norm() < 1e-14);
      CHECK_THAT(R.determinant(), WithinAbs(1, 1e-14));
    }
    const Eigen::JacobiSVD<Matrix3<double>> expected(M);
    CHECK((found.sigma.cwiseAbs() - expected.singularValues()).cwiseAbs().maxCoeff() <= 1e-14 * size);
  }
}

TEST_CASE("Orthogonalised columns of a symmetric matrix are its eigenvectors, largest first", "[math]") {
  using Matrix9 = Eigen::Matrix<double, 9, 9>;
  cfp::Random random(63, "matrix3");
  for (int rank : {9, 8, 4}) {
    Matrix9 M = Matrix9::Zero();
    for (int k = 0; k < rank; ++k) {
      Eigen::Matrix<double, 9, 1> x;
      for (double& value : x) value = random.normal();
      M += x * x.transpose();
    }
    Matrix9 A = M, V = Matrix9::Identity();
    cfp::detail::orthogonalize_columns(A, V);
    const Eigen::Matrix<double, 9, 1> values = A.colwise().norm();
    CHECK(std::is_sorted(values.begin(), values.end(), std::greater<>()));
    CHECK((A - V * values.asDiagonal()).norm() < 1e-12);
    CHECK((M * V - A).norm() < 1e-12);
    CHECK((V.transpose() * V - Matrix9::Identity()).norm() < 1e-13);
  }
}

TEST_CASE("The decomposition holds for each of the matrices of -1, 0 and 1, most of which have orthogonal columns",
          "[math]") {
  double worst = 0;
  for (int code = 0; code < 19683; ++code) {
    Matrix3<double> M;
    for (int i = 0, rest = code; i < 9; ++i, rest /= 3) M.data()[i] = rest % 3 - 1;
    const cfp::SVD3<double> found = cfp::svd(M);
    worst = std::max({worst, (found.U * found.sigma.asDiagonal() * found.V.transpose() - M).norm(),
                      (found.U.transpose() * found.U - Matrix3<double>::Identity()).norm(),
                      found.sigma[1] - found.sigma[0], std::abs(found.sigma[2]) - found.sigma[1]});
  }
  CHECK(worst < 1e-14);
}

TEMPLATE_TEST_CASE("U is a rotation however small the second singular value", "[math]", float, double) {
  for (int exponent = 0; exponent > std::numeric_limits<TestType>::min_exponent - 20; --exponent) {
    Matrix3<TestType> M = Matrix3<TestType>::Zero();
    M(0, 0) = 1;
    M(1, 1) = std::ldexp(TestType(1.37), exponent);
    const Matrix3<TestType> U = cfp::svd(M).U;
    CAPTURE(exponent);
    CHECK((U.transpose() * U - Matrix3<TestType>::Identity()).norm() < 4 * std::numeric_limits<TestType>::epsilon());
  }
}
