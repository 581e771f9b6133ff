/// @file bundle_elimination_impl.hpp
/// Inside bundle_adjustment.hpp: eliminates the points from the damped normal equations, or the poses where there are
/// many of them and few points (a calibration target, a handful of tracks through a long film), solves what is left and
/// recovers the steps of what was eliminated.
///
/// The damped block of what is eliminated is A = L L^T; with its coupling C = W L^-T to each that is kept and y = L^-1
/// g the reduced system has blocks - C_b C_a^T and right side + C y, and the step is -L^-T (y + sum of C^T step). W = G
/// N (6 x 3, pose by point). D of A + lambda D is isotropic per point, and per pose for translation and rotation (mean
/// of the diagonal), so that the iterates do not depend on the direction of the world's axes.
#pragma once

#include <algorithm>
#include <vector>

#include "cfp/core/types.hpp"
#include "cfp/optimization/bundle/bundle_linearization_impl.hpp"

namespace cfp::detail {

/// The reduced system, and what is needed to recover the steps of what was eliminated.
struct BundleSchur {
  BlockEnvelope envelope;
  std::vector<double> blocks[bundle_parts], right_side[bundle_parts];
  std::vector<double> triangles;  // per eliminated: L^-1, y
  // C, 18 numbers per slot. All slots of one pair share one C; those of each that is eliminated stand in front.
  std::vector<double> couplings;
  std::vector<std::size_t> coupled, coupled_end;  // per C: what it couples to; per eliminated: where its C end
  std::vector<double> pose_steps, point_steps;
};

inline namespace CFP_ISA {

/// d = x - c
[[nodiscard]] inline Vector3<double> offset(const BundleState& state, std::size_t pose, std::size_t point) noexcept {
  return state.points[point] - state.poses[pose].center;
}

/// out = G M = [M; hat(d) M], 3 numbers of M and 6 of G M per column. Number by number: a vector read back at once from
/// single numbers waits for them.
inline void lift(const Vector3<double>& d, const double* M, int columns, double* out) noexcept {
  for (int c = 0; c < columns; ++c, M += 3, out += 6) {
    out[0] = M[0], out[1] = M[1], out[2] = M[2];
    out[3] = d[1] * M[2] - d[2] * M[1], out[4] = d[2] * M[0] - d[0] * M[2], out[5] = d[0] * M[1] - d[1] * M[0];
  }
}

/// C = W L^-T and C y of a pose and a point at offset d, from N, of what is eliminated: L^-1 and y.
template <int K, typename Triangle, typename Y>
CFP_INLINE void couple(const double (&N)[9], const Vector3<double>& d, const Triangle& triangle, const Y& y,
                       Eigen::Map<Eigen::Matrix<double, K, 9 - K>> C, Eigen::Map<Eigen::Matrix<double, K, 1>> sum) {
  if constexpr (K == 6) {
    double M[9], v[3] = {}, lifted[6];
    for (int e = 0; e < 9; ++e) {
      M[e] = 0;
      for (int c = 0; c <= e / 3; ++c) M[e] += N[3 * (e % 3) + c] * triangle(e / 3, c);
      v[e % 3] += M[e] * y[e / 3];
    }
    lift(d, M, 3, C.data());
    lift(d, v, 1, lifted);
    for (int e = 0; e < 6; ++e) sum[e] += lifted[e];
  } else {
    Eigen::Matrix<double, 6, 3> W;
    lift(d, N, 3, W.data());
    C = W.transpose().lazyProduct(triangle.transpose());
    sum += C.lazyProduct(y);
  }
}

/// target -= C_b C_a^T, d the offset of C_a.
template <int K>
CFP_INLINE void subtract_product(const Eigen::Map<Eigen::Matrix<double, K, 9 - K>>& C_b,
                                 const Eigen::Matrix<double, K, 9 - K>& C_a, const Vector3<double>& d,
                                 Eigen::Map<Eigen::Matrix<double, K, K>> target) {
  if constexpr (K == 6) {  // C = [M; hat(d) M]: half of the block follows from the other
    const Eigen::Matrix<double, 6, 3> T = C_b.lazyProduct(C_a.template topRows<3>().transpose());
    target.template leftCols<3>() -= T;
    target.col(3) -= T.col(2) * d.y() - T.col(1) * d.z();
    target.col(4) -= T.col(0) * d.z() - T.col(2) * d.x();
    target.col(5) -= T.col(1) * d.x() - T.col(0) * d.y();
  } else {
    target.noalias() -= C_b.lazyProduct(C_a.transpose());
  }
}

/// The share of one part of what is eliminated in the reduced system; part 0 starts from the blocks of what is kept.
/// False when a damped block is not positive definite, which only rounding or overflow can cause.
template <int E, int K = 9 - E>
[[nodiscard]] bool eliminate(const BundleIndex& index, const BundleState& state, const BundleLinearization& linear,
                             double lambda, std::size_t part, BundleSchur& schur) noexcept {
  using Kept = BundleKind<K>;
  using Eliminated = BundleKind<E>;
  using Coupling = Eigen::Matrix<double, K, E>;
  const std::size_t kept = schur.envelope.first.size();
  const auto block = [&](std::size_t row, std::size_t column) {
    return Eigen::Map<typename Kept::Matrix>(schur.blocks[part].data() + Kept::block * schur.envelope.at(row, column));
  };
  const auto right_side = [&](std::size_t k) {
    return Eigen::Map<typename Kept::Vector>(schur.right_side[part].data() + Kept::size * k);
  };
  const auto coupling = [&](std::size_t s) { return Eigen::Map<Coupling>(schur.couplings.data() + 18 * s); };
  std::fill(schur.blocks[part].begin(), schur.blocks[part].end(), 0.0);
  std::fill(schur.right_side[part].begin(), schur.right_side[part].end(), 0.0);
  for (std::size_t k = 0; part == 0 && k < kept; ++k) {
    block(k, k) = Kept::damped(linear, lambda, k);
    right_side(k) = -Kept::gradient(linear, k);
  }
  for (std::size_t i = index.eliminated_part[part]; i < index.eliminated_part[part + 1]; ++i) {
    typename Eliminated::Matrix inverse = Eliminated::damped(linear, lambda, i);
    if (!invert_triangle(inverse)) return false;
    Eigen::Map<typename Eliminated::Matrix> triangle(schur.triangles.data() + Eliminated::system * i);
    triangle = inverse;
    Eigen::Map<typename Eliminated::Vector>(triangle.data() + Eliminated::block) =
        inverse.lazyProduct(Eliminated::gradient(linear, i));
  }
  for (std::size_t i = index.eliminated_part[part]; i < index.eliminated_part[part + 1]; ++i) {
    const double* const solved = schur.triangles.data() + Eliminated::system * i;
    const typename Eliminated::Matrix triangle = Eigen::Map<const typename Eliminated::Matrix>(solved);
    const typename Eliminated::Vector y = Eigen::Map<const typename Eliminated::Vector>(solved + Eliminated::block);
    const std::size_t begin = index.slot_begin[i];
    std::size_t end = begin;
    for (std::size_t s = begin; s < index.slot_begin[i + 1] && Kept::slot(index, s) < kept; ++s, ++end) {
      const std::size_t k = schur.coupled[end] = Kept::slot(index, s);
      const Vector3<double> d = offset(state, BundleKind<6>::slot(index, s), BundleKind<3>::slot(index, s));
      double N[9] = {};
      for (const double* slot = linear.slots.data() + BundleLinearization::slot_doubles * s;; slot += 9, ++s) {
        for (int e = 0; e < 9; ++e) N[e] += slot[symmetric[e / 3][e % 3]];
        if (s + 1 == index.slot_begin[i + 1] || Kept::slot(index, s + 1) != k) break;
      }
      couple<K>(N, d, triangle, y, coupling(end), right_side(k));
    }
    schur.coupled_end[i] = end;
    for (std::size_t a = begin; a < end; ++a) {
      const Coupling right = coupling(a);
      const Vector3<double> d = K == 6 ? offset(state, schur.coupled[a], i) : offset(state, i, schur.coupled[a]);
      for (std::size_t b = a; b < end; ++b)
        subtract_product<K>(coupling(b), right, d, block(schur.coupled[b], schur.coupled[a]));
    }
  }
  return true;
}

/// The steps of all, the reduced system being the sum of the parts; false when it is not positive definite.
template <int E, int K = 9 - E>
[[nodiscard]] bool solve_reduced(const BundleIndex& index, BundleSchur& schur) noexcept {
  for (std::size_t part = 1; part < bundle_parts; ++part) {
    for (std::size_t i = 0; i < schur.blocks[0].size(); ++i) schur.blocks[0][i] += schur.blocks[part][i];
    for (std::size_t i = 0; i < schur.right_side[0].size(); ++i) schur.right_side[0][i] += schur.right_side[part][i];
  }
  if (!factorize_blocks<K>(schur.envelope, schur.blocks[0])) return false;
  std::vector<double>&kept = K == 6 ? schur.pose_steps : schur.point_steps,
  &eliminated = K == 6 ? schur.point_steps : schur.pose_steps;
  std::copy(schur.right_side[0].begin(), schur.right_side[0].end(), kept.begin());
  solve_blocks<K>(schur.envelope, schur.blocks[0], kept);
  using Eliminated = BundleKind<E>;
  for (std::size_t i = 0; i < index.eliminated_part.back(); ++i) {
    const double* const in = schur.triangles.data() + Eliminated::system * i;
    typename Eliminated::Vector sum = Eigen::Map<const typename Eliminated::Vector>(in + Eliminated::block);
    for (std::size_t s = index.slot_begin[i]; s < schur.coupled_end[i]; ++s) {
      const Eigen::Map<const Eigen::Matrix<double, K, E>> C(schur.couplings.data() + 18 * s);
      sum += C.transpose().lazyProduct(
          Eigen::Map<const typename BundleKind<K>::Vector>(kept.data() + BundleKind<K>::size * schur.coupled[s]));
    }
    Eigen::Map<typename Eliminated::Vector>(eliminated.data() + Eliminated::size * i) =
        -Eigen::Map<const typename Eliminated::Matrix>(in).transpose().lazyProduct(sum);
  }
  return true;
}

/// The steps' share of h^T (lambda D h - g).
template <int N>
[[nodiscard]] double promised_by(const BundleLinearization& linear, const std::vector<double>& steps,
                                 double lambda) noexcept {
  using Kind = BundleKind<N>;
  double promised = 0;
  for (std::size_t i = 0; i < steps.size() / Kind::size; ++i) {
    const Eigen::Map<const typename Kind::Vector> h(steps.data() + Kind::size * i);
    promised += h.dot(Kind::damping(linear, lambda, i).cwiseProduct(h) - Kind::gradient(linear, i));
  }
  return promised;
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
