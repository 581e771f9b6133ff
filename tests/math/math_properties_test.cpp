// Properties of math/, for whatever the generators make.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "cfp/math/cubic.hpp"
#include "cfp/math/matrix3.hpp"
#include "cfp/math/normal_equations.hpp"
#include "cfp/math/order_statistic.hpp"
#include "cfp/math/se3.hpp"
#include "cfp_testing/generators.hpp"
#include "support/properties.hpp"

using cfp::Matrix3;
using cfp::Random;
using cfp::SE3;
using cfp::Vector3;

namespace {

Matrix3<double> matrix(Random& random) {
  Matrix3<double> M;
  for (int k = 0; k < 9; ++k) M.data()[k] = random.normal();
  return M;
}

Eigen::Matrix<double, 6, 6> positive_definite(Random& random) {
  Eigen::Matrix<double, 6, 6> A;
  for (int k = 0; k < 36; ++k) A.data()[k] = random.normal();
  return A * A.transpose() + 0.1 * Eigen::Matrix<double, 6, 6>::Identity();
}

cfp::Vector6<double> vector6(Random& random) {
  cfp::Vector6<double> v;
  for (int k = 0; k < 6; ++k) v[k] = random.normal();
  return v;
}

}  // namespace

CFP_PROPERTIES("Properties of rotations and motions", "[math]",
               {"exp(-w) is the inverse of exp(w)", 200,
                [](Random& random) {
                  const Vector3<double> w = cfp_testing::vector_in_cube(random, 4), back = -w;
                  return (cfp::so3_exp(w) * cfp::so3_exp(back) - Matrix3<double>::Identity()).norm() < 1e-14;
                }},
               {"log is odd in its rotation and exp gives the rotation back", 200,
                [](Random& random) {
                  const Matrix3<double> R = cfp_testing::pose(random, 1, 3.1).rotation, S = R.transpose();
                  const Vector3<double> w = cfp::so3_log(R), minus = cfp::so3_log(S);
                  return (w + minus).norm() < 1e-12 && (cfp::so3_exp(w) - R).norm() < 1e-13;
                }},
               {"the angle is the same from both sides and in every frame", 200,
                [](Random& random) {
                  const Matrix3<double> R = cfp_testing::pose(random, 1, 3).rotation,
                                        Q = cfp_testing::pose(random, 1, 3).rotation;
                  const Matrix3<double> turned = Q * R * Q.transpose();
                  return std::abs(cfp::so3_log(R).norm() - cfp::so3_log(turned).norm()) < 1e-12;
                }},
               {"the left Jacobian and its inverse cancel", 200,
                [](Random& random) {
                  const Vector3<double> w = cfp_testing::vector_in_cube(random, random.index(2) == 0 ? 1.7 : 1e-3);
                  return (cfp::so3_left_jacobian(w) * cfp::inverse(cfp::so3_left_jacobian(w)) -
                          Matrix3<double>::Identity())
                             .norm() < 1e-12;
                }},
               {"the left Jacobian is the derivative of exp", 200,
                [](Random& random) {
                  const Vector3<double> w = cfp_testing::vector_in_cube(random, 1.5),
                                        d = cfp_testing::vector_in_cube(random, 1e-6);
                  const Matrix3<double> step = cfp::so3_exp(Vector3<double>(w + d)) * cfp::so3_exp(w).transpose();
                  return (cfp::so3_log(step) - cfp::so3_left_jacobian(w) * d).norm() < 1e-11;
                }},
               {"a quaternion and its negative are the same rotation, of any length", 200,
                [](Random& random) {
                  const Matrix3<double> R = cfp_testing::pose(random, 1, 3.14).rotation;
                  const cfp::Vector4<double> q = cfp::quaternion(R), other = -random.uniform(0.1, 10) * q;
                  return (cfp::so3_from_quaternion(other) - R).norm() < 1e-14 && q[3] >= 0 &&
                         std::abs(q.norm() - 1) < 1e-14;
                }},
               {"normalising a rotation twice changes nothing more", 200,
                [](Random& random) {
                  Matrix3<double> R = cfp_testing::pose(random, 1, 3).rotation;
                  R += 0.01 * matrix(random);
                  const Matrix3<double> once = cfp::normalized_rotation(R), twice = cfp::normalized_rotation(once);
                  return (once - twice).norm() < 1e-14 && std::abs(cfp::determinant(once) - 1) < 1e-13;
                }},
               {"motions are a group: associative, with inverses, moving points one after the other", 200,
                [](Random& random) {
                  const auto any = [&] { return cfp_testing::pose(random, 3, 3); };
                  const SE3<double> A = any(), B = any(), C = any();
                  const Vector3<double> x = cfp_testing::vector_in_cube(random, 5), left = ((A * B) * C) * x,
                                        right = A * Vector3<double>(B * Vector3<double>(C * x));
                  return (left - right).norm() < 1e-12 && (A.inverse() * Vector3<double>(A * x) - x).norm() < 1e-12;
                }},
               {"float follows double", 200, [](Random& random) {
                  const SE3<double> T = cfp_testing::pose(random, 2, 3);
                  const cfp::Vector6<double> exact = cfp::se3_log(T);
                  const SE3<float> single = T.cast<float>();
                  return (cfp::se3_log(single).cast<double>() - exact).norm() < 2e-5;
                }})

CFP_PROPERTIES("Properties of 3x3 matrices", "[math]",
               {"the singular values do not follow rotations and make the matrix again", 200,
                [](Random& random) {
                  const Matrix3<double> M = matrix(random), R = cfp_testing::pose(random, 1, 3).rotation, RM = R * M;
                  const auto a = cfp::svd(M), b = cfp::svd(RM);
                  const Matrix3<double> again = a.U * a.sigma.asDiagonal() * a.V.transpose();
                  return (again - M).norm() < 1e-13 && (a.sigma - b.sigma).norm() < 1e-13 && a.sigma[0] >= a.sigma[1] &&
                         a.sigma[1] >= std::abs(a.sigma[2]);
                }},
               {"scaling a matrix scales its singular values", 200,
                [](Random& random) {
                  const Matrix3<double> M = matrix(random);
                  const double scale = std::exp2(static_cast<double>(random.index(600)) - 300);
                  const Matrix3<double> scaled = scale * M;
                  return (cfp::svd(scaled).sigma / scale - cfp::svd(M).sigma).norm() < 1e-13;
                }},
               {"inverse, cofactors and determinant agree", 200, [](Random& random) {
                  const Matrix3<double> M = matrix(random);
                  const double d = cfp::determinant(M);
                  if (std::abs(d) < 1e-3) return true;
                  return (cfp::inverse(M) * M - Matrix3<double>::Identity()).norm() < 1e-9 &&
                         (cfp::cofactors(M).transpose() / d - cfp::inverse(M)).norm() < 1e-9;
                }})

CFP_PROPERTIES(
    "Properties of solvers and order statistics", "[math]",
    {"the roots of a cubic made of three roots are those", 500,
     [](Random& random) {
       std::array<double, 3> x;
       for (double& r : x) r = random.uniform(-10, 10);
       std::sort(x.begin(), x.end());
       if (x[1] - x[0] < 0.01 || x[2] - x[1] < 0.01) return true;
       double roots[3];
       if (cfp::real_cubic_roots(-(x[0] + x[1] + x[2]), x[0] * x[1] + x[1] * x[2] + x[2] * x[0], -x[0] * x[1] * x[2],
                                 roots) != 3)
         return false;
       std::sort(roots, roots + 3);
       for (std::size_t k = 0; k < 3; ++k) {
         if (std::abs(roots[k] - x[k]) > 1e-8) return false;
       }
       return true;
     }},
    {"the roots of a cubic hold to a few roundings of its terms", 2000,
     [](Random& random) {
       std::array<double, 3> x;
       for (double& r : x) r = random.uniform(-10, 10);
       const double a = -(x[0] + x[1] + x[2]), b = x[0] * x[1] + x[1] * x[2] + x[2] * x[0], c = -x[0] * x[1] * x[2];
       double roots[3];
       const int n = cfp::real_cubic_roots(a, b, c, roots);
       for (int k = 0; k < n; ++k) {
         const double r = roots[k], terms = std::abs(r * r * r) + std::abs(a * r * r) + std::abs(b * r) + std::abs(c);
         if (std::abs(((r + a) * r + b) * r + c) > 8 * std::numeric_limits<double>::epsilon() * terms) return false;
       }
       return n > 0;
     }},
    {"a cubic of one real root has that one", 500,
     [](Random& random) {  // (x - r) ((x - u)^2 + v^2)
       const double r = random.uniform(-5, 5), u = random.uniform(-5, 5), v = random.uniform(0.3, 5);
       double roots[3];
       const int n = cfp::real_cubic_roots(-r - 2 * u, u * u + v * v + 2 * r * u, -r * (u * u + v * v), roots);
       return n == 1 && std::abs(roots[0] - r) < 1e-9;
     }},
    {"the step solves its equations, whatever the scale of each unknown", 200,
     [](Random& random) {
       const Eigen::Matrix<double, 6, 6> H = positive_definite(random);
       const cfp::Vector6<double> g = vector6(random);
       cfp::Vector6<double> step, scaled_step, scale;
       for (int k = 0; k < 6; ++k) scale[k] = std::exp2(static_cast<double>(random.index(41)) - 20);
       const Eigen::Matrix<double, 6, 6> scaled_H = scale.asDiagonal() * H * scale.asDiagonal();
       const cfp::Vector6<double> scaled_g = scale.asDiagonal() * g;
       if (!cfp::solve_normal_equations(H, g, 0, 1e-14, step)) return false;
       if (!cfp::solve_normal_equations(scaled_H, scaled_g, 0, 1e-14, scaled_step)) return false;
       return (H * step + g).norm() < 1e-9 && (scale.asDiagonal() * scaled_step - step).norm() < 1e-9;
     }},
    {"more damping never lengthens the step, and the step goes down", 200,
     [](Random& random) {
       const Eigen::Matrix<double, 6, 6> H = positive_definite(random);
       const cfp::Vector6<double> g = vector6(random);
       const double damping = random.uniform(0, 2), more = damping + random.uniform(0, 2);
       cfp::Vector6<double> a, b;
       if (!cfp::solve_normal_equations(H, g, damping, 1e-14, a) || !cfp::solve_normal_equations(H, g, more, 1e-14, b))
         return false;
       const cfp::Vector6<double> d = H.diagonal();  // the norm that damping bounds
       return (d.asDiagonal() * b).dot(b) <= (d.asDiagonal() * a).dot(a) * (1 + 1e-12) &&
              a.dot(damping * (d.asDiagonal() * a) - g) > 0;
     }},
    {"an order statistic does not depend on the order, and grows with its rank", 200, [](Random& random) {
       std::vector<double> values =
           cfp_testing::many(cfp_testing::count(random, 1, 300), [&] { return random.normal(); });
       const auto n = static_cast<std::uint32_t>(values.size());
       const std::size_t rank = random.index(n);
       const double before = cfp::order_statistic(cfp::span(values), rank);
       std::shuffle(values.begin(), values.end(), random);
       const bool same = cfp::order_statistic(cfp::span(values), rank) == before;
       return same && (rank + 1 == n || cfp::order_statistic(cfp::span(values), rank + 1) >= before);
     }})
