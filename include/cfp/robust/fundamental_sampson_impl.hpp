/// @file fundamental_sampson_impl.hpp
/// What fundamental_ransac.hpp computes of all its pairs at once under an F: score, Sampson distances, the robust
/// refinement on the seven parameters of F, and whether it stands out from chance. Not an interface.
#pragma once

#include <cmath>
#include <vector>

#include "cfp/core/types.hpp"
#include "cfp/math/matrix3.hpp"
#include "cfp/math/normal_equations.hpp"
#include "cfp/math/so3.hpp"
#include "cfp/robust/fundamental_pairs_impl.hpp"
#include "cfp/simd/packet.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

// The epipole of the current image, F^T e = 0, unnormalised: F's columns span the plane across it.
template <typename T>
[[nodiscard]] Vector3<T> epipole_of(const Matrix3<T>& F) noexcept {
  const Matrix3<T> candidates = cofactors(F);
  Eigen::Index best = 0;
  candidates.colwise().squaredNorm().maxCoeff(&best);
  return candidates.col(best);
}

// Of a packet of pairs: the directions l = F p and m = F^T q of the epipolar lines, e = q^T F p and n^2; the Sampson
// distance is e / n.
template <typename T>
struct SampsonPacket {
  using P = simd::Packet<T>;
  P p0, p1, q0, q1, l0, l1, m0, m1, e, n2;

  SampsonPacket(const PairColumns<T>& in, std::size_t i, const Matrix3<T>& F) noexcept
      : p0(P::load(in.row[prev_x] + i)),
        p1(P::load(in.row[prev_y] + i)),
        q0(P::load(in.row[cur_x] + i)),
        q1(P::load(in.row[cur_y] + i)) {
    const auto line = [](const P& x, const P& y, T a, T b, T c) {
      return multiply_add(P(a), x, multiply_add(P(b), y, P(c)));
    };
    l0 = line(p0, p1, F(0, 0), F(0, 1), F(0, 2));
    l1 = line(p0, p1, F(1, 0), F(1, 1), F(1, 2));
    m0 = line(q0, q1, F(0, 0), F(1, 0), F(2, 0));
    m1 = line(q0, q1, F(0, 1), F(1, 1), F(2, 1));
    e = multiply_add(q0, l0, multiply_add(q1, l1, line(p0, p1, F(2, 0), F(2, 1), F(2, 2))));
    n2 = multiply_add(l0, l0, l1 * l1) + multiply_add(m0, m0, m1 * m1);
  }
};

// Sum over the pairs of w d^2 / (d^2 + scale), d the Sampson distance of scaled pixels. Gives up with a value above
// `bound` as soon as the sum exceeds it.
template <typename T>
[[nodiscard]] double sampson_cost(const PairColumns<T>& in, const Matrix3<double>& F, double scale,
                                  double bound) noexcept {
  using P = simd::Packet<T>;
  const Matrix3<T> f = F.template cast<T>();
  const P spread(static_cast<T>(scale)), tiny(T(1e-30));
  return bounded_sum<T>(in.size, bound, [&](std::size_t i) {
    const SampsonPacket<T> pair(in, i, f);
    const P e2 = pair.e * pair.e;
    return P::load(in.row[score_weight] + i) * (e2 / multiply_add(spread, pair.n2, e2 + tiny));
  });
}

// Squared Sampson distances of all pairs, scaled pixels, into `out` of the arrays' capacity; NaN where there is none,
// so that no comparison takes such a pair for an inlier.
template <typename T>
void sampson_distances_sq(const PairColumns<T>& in, const Matrix3<T>& F, std::vector<T>& out) noexcept {
  using P = simd::Packet<T>;
  CFP_ASSERT(out.size() >= (in.size + PairArrays::block - 1) / PairArrays::block * PairArrays::block);
  for (std::size_t i = 0; i < in.size; i += P::lanes) {
    const SampsonPacket<T> pair(in, i, F);
    (pair.e * pair.e / pair.n2).store(out.data() + i);
  }
}

// Normal equations over the nine entries (row-major) of F of sum w rho(d^2 / scale), and that sum. The loss of Geman
// and McClure, rho(x) = x / (1 + x), is bounded but smooth: pairs near the threshold count by degrees. With d = e / n
// and k = e / n^2,
//   d(d)/dF_ij = (q_i p_j - k (l_i p_j [i < 2] + m_j q_i [j < 2])) / n.
// The gradient is exact. H leaves out the k terms, a thousandth of the others for pairs that count, and so is made of
// 36 moments.
template <typename T>
double sampson_system(const PairColumns<T>& in, const Matrix3<double>& F, double scale,
                      NormalEquations<9>& out) noexcept {
  using P = simd::Packet<T>;
  const Matrix3<T> f = F.template cast<T>();
  const P zero(T(0)), one(T(1)), tiny(T(1e-30)), inverse_scale(T(1 / scale));
  P moments[6][6], g[9], cost = zero;
  for (auto& row : moments) {
    for (P& m : row) m = zero;
  }
  for (P& h : g) h = zero;
  for (std::size_t i = 0; i < in.size; i += P::lanes) {
    const SampsonPacket<T> pair(in, i, f);
    const P inverse_n2 = one / (pair.n2 + tiny);
    const P k = pair.e * inverse_n2;
    const P x = pair.e * k * inverse_scale;
    const P s = one / (x + one);
    const P ws = P::load(in.row[score_weight] + i) * s;
    cost = multiply_add(ws, x, cost);
    const P weight = ws * s * inverse_n2, we = weight * pair.e;
    const P p[2] = {pair.p0, pair.p1}, wq[2] = {weight * pair.q0, weight * pair.q1}, m[2] = {k * pair.m0, k * pair.m1};
    const P qq[6] = {wq[0] * pair.q0, wq[0] * pair.q1, wq[0], wq[1] * pair.q1, wq[1], weight};
    const P pp[5] = {p[0] * p[0], p[0] * p[1], p[0], p[1] * p[1], p[1]};
    for (int r = 0; r < 6; ++r) {
      for (int c = 0; c < 5; ++c) moments[r][c] = multiply_add(qq[r], pp[c], moments[r][c]);
      moments[r][5] += qq[r];
    }
    const P a[3] = {we * (pair.q0 - k * pair.l0), we * (pair.q1 - k * pair.l1), we},
            b[3] = {we * pair.q0, we * pair.q1, we};
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 2; ++c) g[3 * r + c] += a[r] * p[c] - b[r] * m[c];
      g[3 * r + 2] += a[r];
    }
  }
  for (int r = 0; r < 9; ++r) {
    out.g[r] = static_cast<double>(reduce_add(g[r])) / scale;
    for (int c = 0; c < 9; ++c)
      out.H(r, c) = static_cast<double>(reduce_add(moments[symmetric[r / 3][c / 3]][symmetric[r % 3][c % 3]])) / scale;
  }
  return static_cast<double>(reduce_add(cost));
}

// F = U diag(cos t, sin t, 0) V^T with U <- U exp(a), V <- V exp(b): seven parameters (a, b, t), rank 2 and unit norm
// by construction. Source: Bartoli and Sturm, "Nonlinear estimation of the fundamental matrix with minimal parameters",
// PAMI 2004.
template <typename T>
struct FactoredF {
  Matrix3<T> U, V;
  T c = 1, s = 0;

  explicit FactoredF(const Matrix3<T>& F) {
    const SVD3<T> f = svd(F);
    U = f.U;
    V = f.V;
    const T norm = std::hypot(f.sigma[0], f.sigma[1]);
    if (norm > 0) c = f.sigma[0] / norm, s = f.sigma[1] / norm;
  }
  [[nodiscard]] Matrix3<T> matrix() const noexcept {
    return c * U.col(0) * V.col(0).transpose() + s * U.col(1) * V.col(1).transpose();
  }
  // d vec(F) (row-major) / d (a, b, t).
  [[nodiscard]] Eigen::Matrix<T, 9, 7> tangents() const noexcept {
    Eigen::Matrix<T, 9, 7> B;
    const auto set = [&](int column, T x, int i, int j, T y, int k, int l) {
      for (int r = 0; r < 9; ++r)
        B(r, column) = x * U(r / 3, i) * V(r % 3, j) + (y == 0 ? T(0) : y * U(r / 3, k) * V(r % 3, l));
    };
    set(0, s, 2, 1, 0, 0, 0);
    set(1, -c, 2, 0, 0, 0, 0);
    set(2, c, 1, 0, -s, 0, 1);
    set(3, s, 1, 2, 0, 0, 0);
    set(4, -c, 0, 2, 0, 0, 0);
    set(5, c, 0, 1, -s, 1, 0);
    set(6, c, 1, 1, -s, 0, 0);
    return B;
  }
};

// Sum w rho(d^2 / scale), scaled pixels, as a model of least_squares.hpp.
template <typename T>
struct SampsonModel {
  PairColumns<T> pairs;
  double scale;

  double linearize(const FactoredF<double>& F, NormalEquations<7>& out) const noexcept {
    NormalEquations<9> entries;
    const double cost = sampson_system(pairs, F.matrix(), scale, entries);
    const Eigen::Matrix<double, 9, 7> B = F.tangents(), HB = entries.H.lazyProduct(B);
    out.H = B.transpose().lazyProduct(HB);
    out.g = B.transpose().lazyProduct(entries.g);
    return cost;
  }
  [[nodiscard]] FactoredF<double> moved(FactoredF<double> F, const Eigen::Matrix<double, 7, 1>& step) const noexcept {
    F.U *= so3_exp<double>(step.head<3>());
    F.V *= so3_exp<double>(step.segment<3>(3));
    const double c = F.c, ct = std::cos(step[6]), st = std::sin(step[6]);
    F.c = c * ct - F.s * st;
    F.s = F.s * ct + c * st;
    return F;
  }
};

// Whether more pairs lie near their lines than the pairs up to three times as far let chance put there: the binomial
// tail of that has to outdo the number of seven-point samples, C(n, 7), as the best of all their F fits some
// mismatches, too. Weights count as Kish's number of equal ones, of which at least `least` must lie near, and as many
// distinct pairs. Source: Moisan and Stival, "A probabilistic criterion to detect rigid point matches between two
// images and estimate the fundamental matrix", IJCV 2004.
template <typename T>
[[nodiscard]] bool stands_out(const PairArrays& pairs, const std::vector<T>& distances_sq, T limit, T least) noexcept {
  T near = 0, distinct = 0, all = 0, n = 0, squares = 0;
  for (std::size_t i = 0; i < pairs.size; ++i) {
    const T weight = pairs.row(evidence_weight)[i];
    n += weight, squares += weight * weight;
    if (distances_sq[i] <= limit) near += weight, distinct += distinct_share(pairs, i);
    if (distances_sq[i] <= 9 * limit) all += weight;
  }
  const T per_weight = n / squares;
  near *= per_weight, all *= per_weight, n *= per_weight;
  return near >= least && distinct >= least && 3 * near > all &&
         binomial_nats(near, all, T(1) / 3) > 7 * std::log((n - 3) / T(3.38));
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
