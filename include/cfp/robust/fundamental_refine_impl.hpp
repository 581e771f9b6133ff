/// @file fundamental_refine_impl.hpp
/// The robust refinement of fundamental_ransac.hpp on the seven parameters of F. Not an interface.
#pragma once

#include <cmath>

#include "cfp/core/types.hpp"
#include "cfp/math/matrix3.hpp"
#include "cfp/math/normal_equations.hpp"
#include "cfp/math/so3.hpp"
#include "cfp/robust/fundamental_pairs_impl.hpp"
#include "cfp/robust/fundamental_sampson_impl.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

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
  [[nodiscard]] FactoredF moved(const Eigen::Matrix<T, 7, 1>& step) const noexcept {
    FactoredF out = *this;
    out.U = U * so3_exp<T>(step.template head<3>());
    out.V = V * so3_exp<T>(step.template segment<3>(3));
    const T ct = std::cos(step[6]), st = std::sin(step[6]);
    out.c = c * ct - s * st;
    out.s = s * ct + c * st;
    return out;
  }
};

// Sum w rho(d^2 / scale) as a model of least_squares.hpp.
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
  [[nodiscard]] FactoredF<double> moved(const FactoredF<double>& F, const Eigen::Matrix<double, 7, 1>& step) const {
    return F.moved(step);
  }
};

// Refines F (scaled pixels) until a step promises or brings less than `tolerance` of the cost, or for `max_steps`.
// Returns the cost of F, which never rises.
template <typename T>
double refine_fundamental(const PairColumns<T>& pairs, double scale, int max_steps, double tolerance,
                          FactoredF<double>& F) noexcept {
  SampsonModel<T> model{pairs, scale};
  return refine<7>(model, max_steps, tolerance, F);
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
