/// @file homography_impl.hpp
/// Homographies as far as the degeneracy check of fundamental_ransac.hpp needs them. Scaled pixels throughout. Not an interface.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>

#include "cfp/geometry/fundamental_kernels_impl.hpp"

namespace cfp::detail {

// Squared distance of the current point to the mapped previous one; infinite when that lies at infinity.
[[nodiscard]] inline double transfer_sq(const PairArrays& pairs, const Matrix3<double>& H, std::size_t i) noexcept {
  const Vector3<double> mapped = H * Vector3<double>(pairs.array(0)[i], pairs.array(1)[i], 1);
  const double dx = mapped.x() / mapped.z() - pairs.array(2)[i], dy = mapped.y() / mapped.z() - pairs.array(3)[i];
  const double d2 = dx * dx + dy * dy;
  return d2 >= 0 ? d2 : std::numeric_limits<double>::infinity();
}

// Sum of w min(d^2 / limit, 1), d the transfer distance.
[[nodiscard]] inline double transfer_cost(const PairArrays& pairs, const Matrix3<double>& H, double limit) noexcept {
  const Matrix3<float> h = H.cast<float>();
  const float *px = pairs.fast_array(0), *py = pairs.fast_array(1), *qx = pairs.fast_array(2), *qy = pairs.fast_array(3),
              *w = pairs.fast_array(4);
  const float limit_f = static_cast<float>(limit);
  double sum = 0;
  for (std::size_t block = 0; block < pairs.padded_size(); block += PairArrays::padding) {
    Lane<float> cost = Lane<float>::Zero();
    for (std::size_t i = block; i < block + PairArrays::padding; i += Lane<float>::SizeAtCompileTime) {
      const Lane<float> p0 = load_lane(px + i), p1 = load_lane(py + i), q0 = load_lane(qx + i), q1 = load_lane(qy + i);
      // Multiplied out by z, so that a point mapped to infinity is an outlier and not a NaN.
      const Lane<float> z = h(2, 0) * p0 + h(2, 1) * p1 + h(2, 2);
      const Lane<float> dx = h(0, 0) * p0 + h(0, 1) * p1 + h(0, 2) - q0 * z;
      const Lane<float> dy = h(1, 0) * p0 + h(1, 1) * p1 + h(1, 2) - q1 * z;
      cost += load_lane(w + i) * ((dx * dx + dy * dy) / (z * z + 1e-30F)).min(limit_f);
    }
    sum += static_cast<double>(cost.sum());
  }
  return sum / limit;
}

// The homography compatible with F that maps three pairs: H = [e']x F - e' v^T. Hartley and Zisserman, result 13.6. False for
// collinear points or a degenerate F.
[[nodiscard]] inline bool homography_from_fundamental(const PairArrays& pairs, const Matrix3<double>& F, const std::uint32_t (&sample)[3],
                                                      Matrix3<double>& H) noexcept {
  const FactoredF factors(F);
  const Vector3<double> e = factors.U.col(2);
  const Matrix3<double> A = hat(e) * F;
  Matrix3<double> M;
  Vector3<double> b;
  for (int k = 0; k < 3; ++k) {
    const Vector3<double> p(pairs.array(0)[sample[k]], pairs.array(1)[sample[k]], 1),
        q(pairs.array(2)[sample[k]], pairs.array(3)[sample[k]], 1);
    const Vector3<double> across = q.cross(e);
    M.row(k) = p.transpose();
    b[k] = q.cross(A * p).dot(across) / across.squaredNorm();
  }
  if (!(std::abs(M.determinant()) > 1e-6)) return false;
  H = A - e * (M.inverse() * b).transpose();
  return H.allFinite() && std::abs(H.determinant()) > 1e-9 * H.norm() * H.norm() * H.norm();
}

// Least squares on the transfer distance (Gauss-Newton with h22 fixed: points are centred, so it is not near zero) with the
// weights of the Geman-McClure loss of scale `limit`. H stays as it was when its cost does not fall.
inline void refine_homography(const PairArrays& pairs, double limit, int iterations, Matrix3<double>& H) noexcept {
  double cost = transfer_cost(pairs, H, limit);
  for (int iteration = 0; iteration < iterations; ++iteration) {
    Matrix3<double> h = H / H(2, 2);
    if (!h.allFinite()) return;
    Eigen::Matrix<double, 8, 8> A = Eigen::Matrix<double, 8, 8>::Zero();
    Eigen::Matrix<double, 8, 1> g = Eigen::Matrix<double, 8, 1>::Zero();
    for (std::size_t i = 0; i < pairs.size; ++i) {
      const Vector3<double> p(pairs.array(0)[i], pairs.array(1)[i], 1);
      const Vector3<double> mapped = h * p;
      const double inverse = 1 / mapped.z();
      const double u = mapped.x() * inverse, v = mapped.y() * inverse;
      const double dx = u - pairs.array(2)[i], dy = v - pairs.array(3)[i];
      const double x = (dx * dx + dy * dy) / limit;
      if (!(x < 9)) continue;  // weight below a hundredth
      const double w = pairs.weights()[i] / ((1 + x) * (1 + x));
      Eigen::Matrix<double, 8, 1> ju = Eigen::Matrix<double, 8, 1>::Zero(), jv = Eigen::Matrix<double, 8, 1>::Zero();
      ju.head<3>() = p * inverse;
      ju.tail<2>() = -u * inverse * p.head<2>();
      jv.segment<3>(3) = p * inverse;
      jv.tail<2>() = -v * inverse * p.head<2>();
      A += ju.lazyProduct((w * ju).transpose()) + jv.lazyProduct((w * jv).transpose());
      g += w * (dx * ju + dy * jv);
    }
    A.diagonal() *= 1 + 1e-9;
    const Eigen::Matrix<double, 8, 1> step = -A.ldlt().solve(g);
    if (!step.allFinite()) return;
    h.row(0) += step.segment<3>(0).transpose();
    h.row(1) += step.segment<3>(3).transpose();
    h.row(2).head<2>() += step.segment<2>(6).transpose();
    const double next = transfer_cost(pairs, h, limit);
    if (!(next < cost)) return;
    H = h;
    if (cost - next < 1e-3 * cost) return;
    cost = next;
  }
}

}  // namespace cfp::detail
