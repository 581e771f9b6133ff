/// @file pose_kernel_impl.hpp
/// One pass over the observations of one pose: normal equations, cost and squared errors (internal to
/// pose_refinement.hpp).
///
/// With p = T X = (x z, y z, z), q = 1/z and xi = (rho, w), T <- exp(xi) T, a pinhole camera has the rows (divided by
/// fx or fy)
///   d x   = [ q  0  -x q  -x y       1 + x^2   -y ]       d y = [ 0  q  -y q  -(1 + y^2)  x y  x ]
///   d k   = [ c q  0  -k q  -k y   c + k x   -c y ]       with k = c x - b q, b the stereo baseline in m,
/// c = 1 for u_right, c = 0 for a depth, so the rows of u and of k differ in two factors only and their products sum up
/// in n = sum c, m1 = sum c k, m2 = sum k^2 (c = 1 and k = x for u): a depth costs few operations more than a pixel.
/// The row of v has kappa = fy^2 / fx^2 times their weight, so that its products join theirs before the multiplication
/// with the weight. H(0,1) = 0, H(1,1) = kappa H(0,0) / n, H(2,5) = -H(0,3) - H(1,4).
#pragma once

#include <algorithm>
#include <cmath>

#include "cfp/geometry/camera.hpp"
#include "cfp/math/normal_equations.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/optimization/pose/pose_columns_impl.hpp"
#include "cfp/optimization/robust_loss.hpp"
#include "cfp/simd/packet.hpp"

namespace cfp::detail {

/// Sums of one pass: H (upper triangle) = sum of W J^T J, g = sum of W J^T r with W = w rho'(s) / sigma^2.
struct PoseSystem {
  NormalEquations<6> equations;
  double cost = 0;       // sum of w rho(s)
  double influence = 0;  // sum of w rho'(s) in front of the camera
};

inline namespace CFP_ISA {

/// Pinhole pass over the packets [begin, end); sums in lanes, handed to double every 64 packets.
template <bool stereo, typename Scalar, typename Loss, typename C>
void add_observations(const PoseColumns<Scalar>& columns, std::size_t begin, std::size_t end,
                      const PinholeCamera<C>& camera, const SE3<double>& T, const Loss& given_loss,
                      PoseSystem& system) noexcept {
  using P = simd::Packet<Scalar>;
  // clang-format off
  enum {
    cost, influence, g0, g1, g2, g3, g4, g5, h00, h02, h03, h04, h05, h12, h13, h14, h15, h22, h23, h24, h33, h34, h35,
    h44, h45, h55, count
  };
  // clang-format on
  const auto constant = [](double value) { return P(static_cast<Scalar>(value)); };
  const P r00 = constant(T.rotation(0, 0)), r01 = constant(T.rotation(0, 1)), r02 = constant(T.rotation(0, 2)),
          t0 = constant(T.translation.x());
  const P r10 = constant(T.rotation(1, 0)), r11 = constant(T.rotation(1, 1)), r12 = constant(T.rotation(1, 2)),
          t1 = constant(T.translation.y());
  const P r20 = constant(T.rotation(2, 0)), r21 = constant(T.rotation(2, 1)), r22 = constant(T.rotation(2, 2)),
          t2 = constant(T.translation.z());
  const double aspect = static_cast<double>(camera.fy) / static_cast<double>(camera.fx), aspect_sq = aspect * aspect;
  const P kappa = constant(aspect_sq), base = constant(columns.baseline_fx / static_cast<double>(camera.fx));
  const P near = constant(static_cast<double>(Tolerance<Scalar>::min_depth)), wide = constant(100), one = constant(1),
          zero = constant(0), tiny = (std::numeric_limits<Scalar>::min)();
  const double third_rows = stereo ? columns.third_has_u : 0;
  const P third_has_u = constant(third_rows), n = constant(1 + third_rows);
  const Loss loss = given_loss;  // a copy, which the stores below cannot change

  while (begin < end) {
    const std::size_t block_end = (std::min)(end, begin + 64 * P::lanes);
    P sum[count];
    for (P& x : sum) x = zero;
    for (; begin < block_end; begin += P::lanes) {
      const P X = P::load(columns.x + begin), Y = P::load(columns.y + begin), Z = P::load(columns.z + begin);
      const P px = multiply_add(r00, X, multiply_add(r01, Y, multiply_add(r02, Z, t0)));
      const P py = multiply_add(r10, X, multiply_add(r11, Y, multiply_add(r12, Z, t1)));
      const P pz = multiply_add(r20, X, multiply_add(r21, Y, multiply_add(r22, Z, t2)));
      const auto front = both(pz > near, both(abs(px) <= wide * pz, abs(py) <= wide * pz));
      const P q = select(front, one / pz, zero);
      const P x = px * q, y = py * q;
      const P ru = x - P::load(columns.u + begin), rv = y - P::load(columns.v + begin);

      // The rows of u and of k: the sums of c k and k^2, of c r and k r.
      P m1 = x, m2 = x * x, sr = ru, skr = x * ru, uu = ru * ru;
      if constexpr (stereo) {
        const P k = third_has_u * x - base * q;
        const P r = multiply_add(third_has_u, ru, P::load(columns.disparity + begin) - base * q);
        m1 = multiply_add(third_has_u, k, m1), m2 = multiply_add(k, k, m2), sr = multiply_add(third_has_u, r, sr),
        skr = multiply_add(k, r, skr), uu = multiply_add(r, r, uu);
      }
      const P kv = kappa * rv;
      const P information = P::load(columns.information + begin), active = P::load(columns.active + begin);
      // A point that goes behind the camera keeps the error it last had in front: otherwise a step that hides points
      // would pay. It is stored below zero even where it is 0.
      const P s = select(front, information * multiply_add(kv, rv, uu), abs(P::load(columns.error + begin)));
      select(front, s, zero - (s + tiny)).store(columns.error + begin);
      sum[cost] = multiply_add(active, loss.value(s), sum[cost]);
      const P pull = select(front, active * loss.first(s), zero), W = information * pull;
      sum[influence] += pull;

      const P br = W * kv, ar = W * sr, e = multiply_add(y, br, W * skr);
      sum[g0] = multiply_add(q, ar, sum[g0]);
      sum[g1] = multiply_add(q, br, sum[g1]);
      sum[g2] = multiply_add(q, e, sum[g2]);
      sum[g3] = multiply_add(y, e, sum[g3] + br);
      sum[g4] = multiply_add(x, e, sum[g4] + ar);
      sum[g5] = multiply_add(y, ar, sum[g5] - x * br);
      const P Wq = W * q, Wqq = Wq * q, Wy = W * y, Wqy = Wq * y;
      const P x2 = x * x, y2 = y * y, f1 = y2 + one, e1 = multiply_add(x, m1, n);
      const P c = multiply_add(kappa, y2, m2), d = c + kappa, xc = multiply_add(x, c, m1);
      sum[h00] += Wqq;
      sum[h02] = multiply_add(Wqq, m1, sum[h02]);
      sum[h03] = multiply_add(Wqy, m1, sum[h03]);
      sum[h04] = multiply_add(Wq, e1, sum[h04]);
      sum[h05] += Wqy;
      sum[h12] = multiply_add(Wqq, y, sum[h12]);
      sum[h13] = multiply_add(Wq, f1, sum[h13]);
      sum[h14] = multiply_add(Wqy, x, sum[h14]);
      sum[h15] = multiply_add(Wq, x, sum[h15]);
      sum[h22] = multiply_add(Wqq, c, sum[h22]);
      sum[h23] = multiply_add(Wqy, d, sum[h23]);
      sum[h24] = multiply_add(Wq, xc, sum[h24]);
      sum[h33] = multiply_add(W, multiply_add(y2, d, kappa * f1), sum[h33]);
      sum[h34] = multiply_add(Wy, multiply_add(x, d, m1), sum[h34]);
      sum[h35] = multiply_add(W, y2 * m1 - kappa * (f1 * x), sum[h35]);
      sum[h44] = multiply_add(W, multiply_add(x, xc, e1), sum[h44]);
      sum[h45] = multiply_add(Wy, e1 - kappa * x2, sum[h45]);
      sum[h55] = multiply_add(W, multiply_add(kappa, x2, n * y2), sum[h55]);
    }
    double total[count];
    for (int i = 0; i < count; ++i) total[i] = static_cast<double>(reduce_add(sum[i]));
    system.cost += total[cost];
    system.influence += total[influence];
    Vector6<double>& g = system.equations.g;
    g[0] += total[g0], g[1] += total[g1], g[2] -= total[g2], g[3] -= total[g3], g[4] += total[g4], g[5] -= total[g5];
    const double rows = 1 + third_rows;
    Matrix6<double>& H = system.equations.H;
    H(0, 0) += rows * total[h00], H(0, 2) -= total[h02], H(0, 3) -= total[h03], H(0, 4) += total[h04],
        H(0, 5) -= rows * total[h05];
    H(1, 1) += aspect_sq * total[h00], H(1, 2) -= aspect_sq * total[h12], H(1, 3) -= aspect_sq * total[h13],
        H(1, 4) += aspect_sq * total[h14];
    H(1, 5) += aspect_sq * total[h15], H(2, 2) += total[h22], H(2, 3) += total[h23], H(2, 4) -= total[h24];
    H(2, 5) += total[h03] - aspect_sq * total[h14], H(3, 3) += total[h33], H(3, 4) -= total[h34], H(3, 5) += total[h35];
    H(4, 4) += total[h44], H(4, 5) -= total[h45], H(5, 5) += total[h55];
  }
}

/// Any camera of geometry/camera.hpp, point by point in double.
template <bool stereo, typename Scalar, typename Camera>
void add_observations(const PoseColumns<Scalar>& columns, std::size_t begin, std::size_t end, const Camera& camera,
                      const SE3<double>& T, const NamedLoss<double>& loss, PoseSystem& system) noexcept {
  using C = typename Camera::ScalarType;
  constexpr int rows = stereo ? 3 : 2;
  for (std::size_t i = begin; i < end; ++i) {
    const Vector3<double> p = T * Vector3<Scalar>(columns.x[i], columns.y[i], columns.z[i]).template cast<double>();
    Vector2<C> pixel = Vector2<C>::Zero();
    Matrix23<C> pixel_by_point = Matrix23<C>::Zero();
    const bool front = camera.project(p.template cast<C>(), pixel, &pixel_by_point) &&
                       p.z() > static_cast<double>(Tolerance<Scalar>::min_depth);
    const double active = static_cast<double>(columns.active[i]),
                 information = static_cast<double>(columns.information[i]);
    if (!front) {
      const Scalar s = std::abs(columns.error[i]);
      columns.error[i] = -(s + (std::numeric_limits<Scalar>::min)());
      system.cost += active * loss.value(static_cast<double>(s));
      continue;
    }
    Eigen::Matrix<double, rows, 1> r;
    Eigen::Matrix<double, rows, 3> D;
    r[0] = static_cast<double>(pixel.x()) - static_cast<double>(columns.u[i]);
    r[1] = static_cast<double>(pixel.y()) - static_cast<double>(columns.v[i]);
    D.template topRows<2>() = pixel_by_point.template cast<double>();
    if constexpr (stereo) {
      r[2] = columns.third_has_u * r[0] + static_cast<double>(columns.disparity[i]) - columns.baseline_fx / p.z();
      D.row(2) = columns.third_has_u * D.row(0);
      D(2, 2) += columns.baseline_fx / (p.z() * p.z());
    }
    const double s = information * r.squaredNorm();
    columns.error[i] = static_cast<Scalar>(s);
    Eigen::Matrix<double, rows, 6> J;
    J.template leftCols<3>() = D;
    J.template rightCols<3>() = -D.lazyProduct(hat(p));
    const double pull = active * loss.first(s);
    system.cost += active * loss.value(s);
    system.influence += pull;
    system.equations.H += information * pull * J.transpose().lazyProduct(J);
    system.equations.g += information * pull * J.transpose().lazyProduct(r);
  }
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
