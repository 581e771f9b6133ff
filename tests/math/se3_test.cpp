#include "cfp/math/se3.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Geometry>

#include "cfp/core/random.hpp"
#include "support/catch.hpp"

using cfp::Matrix3;
using cfp::Vector3;
using cfp::Vector6;

namespace {

template <typename Scalar>
struct Limit;
template <>
struct Limit<double> {
  static constexpr double round_trip = 1e-12, derivative = 1e-8, step = 1e-6;
};
template <>
struct Limit<float> {
  static constexpr float round_trip = 4e-6F, derivative = 2e-3F, step = 1e-2F;
};

/// Axes times angles: zero, tiny, around the thresholds of the series, ordinary, near pi.
template <typename Scalar>
std::vector<Vector3<Scalar>> rotation_vectors() {
  std::vector<Vector3<Scalar>> vectors;
  for (const Vector3<Scalar>& axis :
       {Vector3<Scalar>(1, 0, 0), Vector3<Scalar>(0, -1, 0), Vector3<Scalar>(0, 0, 1),
        Vector3<Scalar>(Vector3<Scalar>(1, 2, -2) / 3), Vector3<Scalar>(Vector3<Scalar>(-2, 6, 3) / 7)}) {
    for (const double angle : {0.0, 1e-30, 1e-8, 1e-6, 0.99e-5, 1.01e-5, 1e-3, 0.0099, 0.0101, 0.099, 0.101, 0.5, 0.9,
                               1.1, 2.0, 3.0, 3.14, 3.1415926}) {
      vectors.push_back(axis * static_cast<Scalar>(angle));
    }
  }
  return vectors;
}

/// sum of hat(w)^n / (n + offset)! in long double: the exponential (offset 0) or the left Jacobian (offset 1).
template <typename Scalar>
Matrix3<Scalar> power_series(const Vector3<Scalar>& w, int offset) {
  using Wide = Eigen::Matrix<long double, 3, 3>;
  const Wide W = cfp::hat(w).template cast<long double>();
  Wide term = Wide::Identity(), sum = Wide::Identity();
  for (int n = 1; n < 60; ++n) {
    term = (term * W / static_cast<long double>(n + offset)).eval();
    sum += term;
  }
  return sum.template cast<Scalar>();
}

}  // namespace

TEMPLATE_TEST_CASE("hat is the cross product", "[math]", float, double) {
  const Vector3<TestType> a(1, -2, 3), b(-4, TestType(0.5), 6);
  CHECK((cfp::hat(a) * b - a.cross(b)).norm() == 0);
}

TEMPLATE_TEST_CASE("so3_exp and the left Jacobian equal their power series", "[math]", float, double) {
  for (const Vector3<TestType>& w : rotation_vectors<TestType>()) {
    CAPTURE(w.transpose());
    const TestType tolerance = 8 * std::numeric_limits<TestType>::epsilon();
    CHECK_THAT((cfp::so3_exp(w) - power_series(w, 0)).cwiseAbs().maxCoeff(), WithinAbs(0, tolerance));
    CHECK_THAT((cfp::so3_left_jacobian(w) - power_series(w, 1)).cwiseAbs().maxCoeff(), WithinAbs(0, tolerance));
    const Matrix3<TestType> product = cfp::so3_left_jacobian(w) * cfp::inverse(cfp::so3_left_jacobian(w));
    CHECK_THAT((product - Matrix3<TestType>::Identity()).cwiseAbs().maxCoeff(), WithinAbs(0, tolerance));
  }
}

TEMPLATE_TEST_CASE("so3_log inverts so3_exp from 0 to pi", "[math]", float, double) {
  for (const Vector3<TestType>& w : rotation_vectors<TestType>()) {
    const Vector3<TestType> back = cfp::so3_log(cfp::so3_exp(w));
    CAPTURE(w.transpose(), back.transpose());
    // Within rounding of pi the two opposite axes are one rotation; in float 3.1415926 is pi.
    const bool opposite = w.norm() > TestType(3.141592) && (back + w).norm() < (back - w).norm();
    CHECK_THAT((opposite ? Vector3<TestType>(back + w) : Vector3<TestType>(back - w)).norm(),
               WithinAbs(0, Limit<TestType>::round_trip));
    CHECK(back.norm() <= cfp::pi<TestType> * (1 + 2 * std::numeric_limits<TestType>::epsilon()));
  }
}

TEMPLATE_TEST_CASE("so3_log of half a turn is one of its two vectors", "[math]", float, double) {
  for (const Vector3<TestType>& axis :
       {Vector3<TestType>(1, 0, 0), Vector3<TestType>(0, 1, 0), Vector3<TestType>(0, 0, 1),
        Vector3<TestType>(Vector3<TestType>(2, -1, 2) / 3)}) {
    const Matrix3<TestType> half_turn = 2 * axis * axis.transpose() - Matrix3<TestType>::Identity();
    const Vector3<TestType> w = cfp::so3_log(half_turn);
    CHECK_THAT(w.norm(), WithinAbs(cfp::pi<TestType>, 4 * Limit<TestType>::round_trip));
    CHECK_THAT(w.cross(axis).norm(), WithinAbs(0, Limit<TestType>::round_trip));
  }
}

TEMPLATE_TEST_CASE("the left Jacobian moves the rotation as stated", "[math]", float, double) {
  for (const Vector3<TestType>& w : rotation_vectors<TestType>()) {
    if (w.norm() > 3) continue;
    const Matrix3<TestType> J = cfp::so3_left_jacobian(w);
    const TestType h = Limit<TestType>::step;
    for (int c = 0; c < 3; ++c) {
      const Vector3<TestType> d = Vector3<TestType>::Unit(c) * h;
      // exp(w + d) exp(w - d)^-1 = exp(2 J d) to third order.
      const Vector3<TestType> moved = cfp::so3_log(Matrix3<TestType>(
          cfp::so3_exp(Vector3<TestType>(w + d)) * cfp::so3_exp(Vector3<TestType>(w - d)).transpose()));
      CHECK_THAT((moved / (2 * h) - J.col(c)).norm(), WithinAbs(0, Limit<TestType>::derivative));
    }
  }
}

TEMPLATE_TEST_CASE("se3_log inverts se3_exp", "[math]", float, double) {
  for (const Vector3<TestType>& w : rotation_vectors<TestType>()) {
    if (w.norm() > TestType(3.1415)) continue;
    Vector6<TestType> xi;
    xi << TestType(0.3), TestType(-1.2), TestType(2), w;
    const Vector6<TestType> back = cfp::se3_log(cfp::se3_exp(xi));
    CAPTURE(xi.transpose(), back.transpose());
    CHECK_THAT((back - xi).norm(), WithinAbs(0, 4 * Limit<TestType>::round_trip));
  }
}

TEMPLATE_TEST_CASE("motions form a group, and the adjoint carries tangents across", "[math]", float, double) {
  cfp::Random random(11, "motions");
  const TestType tolerance = 50 * std::numeric_limits<TestType>::epsilon();
  for (int i = 0; i < 100; ++i) {
    Vector6<TestType> a, b, xi;
    for (int c = 0; c < 6; ++c) {
      a[c] = static_cast<TestType>(random.uniform(-1.5, 1.5));
      b[c] = static_cast<TestType>(random.uniform(-1.5, 1.5));
      xi[c] = static_cast<TestType>(random.uniform(-1.0, 1.0));
    }
    const cfp::SE3<TestType> A = cfp::se3_exp(a), B = cfp::se3_exp(b);
    const Vector3<TestType> p(1, 2, 3);
    CHECK_THAT(((A * B) * p - A * (B * p)).norm(), WithinAbs(0, tolerance));
    CHECK_THAT((A.inverse() * (A * p) - p).norm(), WithinAbs(0, tolerance));
    const cfp::SE3<TestType> left = cfp::se3_exp(Vector6<TestType>(cfp::adjoint(A) * xi));
    const cfp::SE3<TestType> right = A * cfp::se3_exp(xi) * A.inverse();
    CHECK_THAT((left.rotation - right.rotation).norm(), WithinAbs(0, tolerance));
    CHECK_THAT((left.translation - right.translation).norm(), WithinAbs(0, 2 * tolerance));
  }
}

TEST_CASE("a left update moves a point by [I, -hat(p)]", "[math]") {
  Vector6<double> a;
  a << 0.1, 0.2, -0.3, 0.7, -0.4, 0.2;
  const cfp::SE3<double> T = cfp::se3_exp(a);
  const Vector3<double> p = T * Vector3<double>(1, 2, 3);
  Eigen::Matrix<double, 3, 6> J;
  J << Matrix3<double>::Identity(), -cfp::hat(p);
  for (int c = 0; c < 6; ++c) {
    const Vector6<double> d = Vector6<double>::Unit(c) * 1e-6;
    const Vector3<double> slope = ((cfp::se3_exp(d) * T) * Vector3<double>(1, 2, 3) -
                                   (cfp::se3_exp(Vector6<double>(-d)) * T) * Vector3<double>(1, 2, 3)) /
                                  2e-6;
    CHECK_THAT((slope - J.col(c)).norm(), WithinAbs(0, 1e-8));
  }
}

TEST_CASE("normalized_rotation removes drift", "[math]") {
  const Matrix3<double> R = cfp::so3_exp(Vector3<double>(0.3, -0.8, 1.1));
  const Matrix3<double> drifted = R * 1.0001 + Matrix3<double>::Constant(1e-5);
  const Matrix3<double> back = cfp::normalized_rotation(drifted);
  CHECK_THAT((back * back.transpose() - Matrix3<double>::Identity()).norm(), WithinAbs(0, 1e-14));
  CHECK_THAT((back - R).norm(), WithinAbs(0, 1e-4));
}

TEMPLATE_TEST_CASE("SE3 from a homogeneous matrix, from a quaternion of any length, and cast", "[math]", float,
                   double) {
  using T = TestType;
  const T tolerance = 16 * std::numeric_limits<T>::epsilon();
  cfp::Random random(21, "SE3 from");
  for (int round = 0; round < 200; ++round) {
    cfp::Vector3<T> axis, t;
    for (int c = 0; c < 3; ++c) {
      axis[c] = static_cast<T>(random.uniform(-1, 1));
      t[c] = static_cast<T>(random.uniform(-9, 9));
    }
    axis.normalize();
    const T angle = static_cast<T>(random.uniform(-3.1, 3.1)), length = static_cast<T>(random.uniform(0.1, 10));
    cfp::Vector4<T> q;
    q.template head<3>() = length * std::sin(angle / 2) * axis;
    q[3] = length * std::cos(angle / 2);
    const cfp::SE3<T> pose{cfp::so3_from_quaternion(q), t};
    CHECK((pose.rotation - cfp::so3_exp(cfp::Vector3<T>(angle * axis))).norm() < tolerance);
    CHECK(pose.translation == t);
    CHECK((cfp::so3_from_quaternion(cfp::Vector4<T>(-q)) - pose.rotation).norm() < tolerance);

    const cfp::SE3<T> again = cfp::SE3<T>::from_matrix(pose.matrix());
    CHECK(again.rotation == pose.rotation);
    CHECK(again.translation == pose.translation);
    CHECK(pose.matrix().row(3) == cfp::Vector4<T>::Unit(3).transpose());

    const cfp::SE3<double> wide = pose.template cast<double>();
    CHECK(wide.rotation(0, 1) == static_cast<double>(pose.rotation(0, 1)));
    CHECK(wide.translation[2] == static_cast<double>(pose.translation[2]));
    const cfp::SE3<T> back = wide.template cast<T>();
    CHECK(back.rotation == pose.rotation);
    CHECK(back.translation == pose.translation);
  }
  CHECK(!(cfp::so3_from_quaternion(cfp::Vector4<T>(cfp::Vector4<T>::Zero())).norm() >= 0));
}
