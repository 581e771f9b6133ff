/// @file homography_impl.hpp
/// Homographies as far as the degeneracy check of fundamental_ransac.hpp needs them. Scaled pixels throughout. Not an
/// interface.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include <Eigen/Core>
#include <Eigen/LU>

#include "cfp/math/normal_equations.hpp"
#include "cfp/robust/fundamental_pairs_impl.hpp"
#include "cfp/simd/packet.hpp"

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
  using P = Packet<float>;
  const Matrix3<float> h = H.cast<float>();
  const PairColumns<float> in = pairs.fast_columns();
  const P most(static_cast<float>(limit)), tiny(1e-30F);
  const auto row = [&h](int r, const P& x, const P& y) {
    return multiply_add(P(h(r, 0)), x, multiply_add(P(h(r, 1)), y, P(h(r, 2))));
  };
  double sum = 0;
  for (std::size_t block = 0; block < in.size; block += PairArrays::padding) {
    P cost(0.0F);
    for (std::size_t i = block; i < block + PairArrays::padding; i += static_cast<std::size_t>(lanes_of<P>)) {
      const P x = cfp::load<P>(in.px + i), y = cfp::load<P>(in.py + i);
      // Multiplied out by z, so that a point mapped to infinity is an outlier and not a NaN.
      const P z = row(2, x, y), dx = row(0, x, y) - cfp::load<P>(in.qx + i) * z,
              dy = row(1, x, y) - cfp::load<P>(in.qy + i) * z;
      const P d2 = multiply_add(dx, dx, dy * dy) / multiply_add(z, z, tiny);
      cost = multiply_add(cfp::load<P>(in.weight + i), select(d2 < most, d2, most), cost);
    }
    sum += static_cast<double>(reduce_add(cost));
  }
  return sum / limit;
}

// The homography compatible with F that maps three pairs: H = [e']x F - e' v^T. Hartley and Zisserman, result 13.6.
// False for collinear points or a degenerate F.
[[nodiscard]] inline bool homography_from_fundamental(const PairArrays& pairs, const Matrix3<double>& F,
                                                      const std::uint32_t (&sample)[3], Matrix3<double>& H) noexcept {
  const Vector3<double> e = epipole_of(F).normalized();
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

// Normal equations of the transfer distance at h, h22 = 1, weighted by the Geman-McClure loss of scale `limit`. With W
// = w / z^2 and the point mapped to (u, v), every entry is a sum of W, W u, W v or W (u^2 + v^2) times 1, x, y or their
// products.
inline void homography_system(const PairColumns<double>& in, const Matrix3<double>& h, double limit,
                              Eigen::Matrix<double, 8, 8>& A, Eigen::Matrix<double, 8, 1>& g) noexcept {
  using P = Packet<double>;
  const P one(1.0), inverse_limit(1 / limit), most(9.0), zero(0.0);
  const auto row = [&h](int r, const P& x, const P& y) {
    return multiply_add(P(h(r, 0)), x, multiply_add(P(h(r, 1)), y, P(h(r, 2))));
  };
  enum { w, wu, wv, wuv, g0 = 4 * 6, count = g0 + 8 };
  P sum[count];
  for (P& value : sum) value = zero;
  for (std::size_t i = 0; i < in.size; i += static_cast<std::size_t>(lanes_of<P>)) {
    const P x = cfp::load<P>(in.px + i), y = cfp::load<P>(in.py + i), inverse = reciprocal(row(2, x, y));
    const P u = row(0, x, y) * inverse, v = row(1, x, y) * inverse;
    const P du = u - cfp::load<P>(in.qx + i), dv = v - cfp::load<P>(in.qy + i);
    const P distance = multiply_add(du, du, dv * dv) * inverse_limit, share = reciprocal(distance + one);
    // Beyond 9 the weight is below a hundredth; a point at infinity has NaN there and is left out, too.
    const auto counts = distance < most;
    const auto counted = [&](const P& value) { return select(counts, value, zero); };
    const P weight = counted(cfp::load<P>(in.weight + i) * share * share * inverse);
    const P W = counted(weight * inverse), U = counted(u), V = counted(v);
    const P products[6] = {x * x, x * y, x, y * y, y, one},
            factors[4] = {W, W * U, W * V, W * multiply_add(U, U, V * V)};
    for (int f = 0; f < 4; ++f) {
      for (int k = 0; k < 6; ++k) sum[6 * f + k] = multiply_add(factors[f], products[k], sum[6 * f + k]);
    }
    const P eu = counted(weight * du), ev = counted(weight * dv);
    const P across = multiply_add(U, eu, V * ev);
    const P gradient[8] = {eu * x, eu * y, eu, ev * x, ev * y, ev, -across * x, -across * y};
    for (int k = 0; k < 8; ++k) sum[g0 + k] += gradient[k];
  }
  constexpr int product[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
  const auto total = [&sum](int index) { return reduce_add(sum[index]); };
  A.setZero();
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) A(r, c) = A(3 + r, 3 + c) = total(6 * w + product[r][c]);
    for (int c = 0; c < 2; ++c) {
      A(r, 6 + c) = A(6 + c, r) = -total(6 * wu + product[r][c]);
      A(3 + r, 6 + c) = A(6 + c, 3 + r) = -total(6 * wv + product[r][c]);
      if (r < 2) A(6 + r, 6 + c) = total(6 * wuv + product[r][c]);
    }
  }
  for (int k = 0; k < 8; ++k) g[k] = total(g0 + k);
}

// Gauss-Newton on the robust transfer distance (h22 fixed: points are centred, so it is not near zero). H stays as it
// was when its cost does not fall.
inline void refine_homography(const PairArrays& pairs, double limit, int iterations, Matrix3<double>& H) noexcept {
  double cost = transfer_cost(pairs, H, limit);
  for (int iteration = 0; iteration < iterations; ++iteration) {
    Matrix3<double> h = H / H(2, 2);
    if (!h.allFinite()) return;
    Eigen::Matrix<double, 8, 8> A;
    Eigen::Matrix<double, 8, 1> g, step;
    homography_system(pairs.exact_columns(), h, limit, A, g);
    if (!solve_normal_equations<8>(A, g, 1e-9, 1e-12, step)) return;
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
