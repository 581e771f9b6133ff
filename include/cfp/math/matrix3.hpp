/// @file matrix3.hpp
/// Cross product, determinant, inverse and singular values of 3x3 matrices: a few lines each in place of Eigen's
/// Geometry, LU and SVD modules, which every including unit would have to compile.
#pragma once

#include <cmath>
#include <limits>

#include "cfp/core/types.hpp"

namespace cfp {

/// A = U diag(sigma) V^T with rotations U and V, sigma descending by size; sigma[2] has the sign of det A.
template <typename Scalar>
struct SVD3 {
  Matrix3<Scalar> U, V;
  Vector3<Scalar> sigma;
};

namespace detail {

// Where the element of a symmetric 3x3 matrix stands among the six numbers 00 01 02 11 12 22.
inline constexpr int symmetric[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};

inline namespace CFP_ISA {

// Rotates the columns of A, and those of V with them, until they are orthogonal, longest first: A V is kept, so that
// with V = I at first A = U diag(lengths) V^T. One-sided Jacobi (Hestenes 1958): exact relative to each singular value.
template <typename Scalar, int N>
void orthogonalize_columns(Eigen::Matrix<Scalar, N, N>& A, Eigen::Matrix<Scalar, N, N>& V) noexcept {
  constexpr int max_sweeps = 16;
  bool rotated = true;
  for (int sweep = 0; rotated && sweep < max_sweeps; ++sweep) {
    rotated = false;
    for (int p = 0; p + 1 < N; ++p) {
      for (int q = p + 1; q < N; ++q) {
        const Scalar a = A.col(p).squaredNorm(), b = A.col(q).squaredNorm(), c = A.col(p).dot(A.col(q));
        const bool orthogonal = !(std::abs(c) > std::numeric_limits<Scalar>::epsilon() * std::sqrt(a) * std::sqrt(b));
        if (orthogonal && a >= b) continue;
        rotated = true;  // a change of places brings pairs together that were not compared
        // Tangent of the angle that makes them orthogonal; columns in the wrong order change places.
        const Scalar zeta = orthogonal ? Scalar(0) : (b - a) / (2 * c);
        Scalar t = orthogonal ? Scalar(0) : 1 / (std::abs(zeta) + std::sqrt(1 + zeta * zeta));
        if (zeta < 0) t = -t;
        const Scalar cosine = 1 / std::sqrt(1 + t * t), sine = cosine * t;
        const bool swap = b + t * c > a - t * c;
        for (Eigen::Matrix<Scalar, N, N>* M : {&A, &V}) {
          for (int i = 0; i < N; ++i) {
            const Scalar x = (*M)(i, p), y = (*M)(i, q);
            const Scalar first = cosine * x - sine * y, second = sine * x + cosine * y;
            (*M)(i, p) = swap ? second : first;
            (*M)(i, q) = swap ? -first : second;
          }
        }
      }
    }
  }
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

template <typename A, typename B>
[[nodiscard]] Vector3<typename A::Scalar> cross(const Eigen::MatrixBase<A>& a, const Eigen::MatrixBase<B>& b) noexcept {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

template <typename Scalar>
[[nodiscard]] Scalar determinant(const Matrix3<Scalar>& M) noexcept {
  return M.col(0).dot(cross(M.col(1), M.col(2)));
}

/// det(M) M^-T: its columns are the cross products of M's columns. Exists for every M.
template <typename Scalar>
[[nodiscard]] Matrix3<Scalar> cofactors(const Matrix3<Scalar>& M) noexcept {
  Matrix3<Scalar> C;
  for (int i = 0; i < 3; ++i) C.col(i) = cross(M.col((i + 1) % 3), M.col((i + 2) % 3));
  return C;
}

/// Of no meaning for an M that is singular to rounding.
template <typename Scalar>
[[nodiscard]] Matrix3<Scalar> inverse(const Matrix3<Scalar>& M) noexcept {
  const Matrix3<Scalar> C = cofactors(M);
  return C.transpose() / M.col(0).dot(C.col(0));
}

/// The singular value decomposition of any finite M, rank-deficient ones included.
template <typename Scalar>
[[nodiscard]] SVD3<Scalar> svd(const Matrix3<Scalar>& M) noexcept {
  SVD3<Scalar> out;
  const Scalar largest = M.cwiseAbs().maxCoeff();
  Matrix3<Scalar> A = largest > Scalar(0) ? Matrix3<Scalar>(M / largest) : M;
  out.V.setIdentity();
  detail::orthogonalize_columns(A, out.V);
  const Vector3<Scalar> u = A.col(0).norm() > Scalar(0) ? A.col(0).normalized() : Vector3<Scalar>::UnitX();
  // Across u even where the second singular value vanishes.
  Vector3<Scalar> v = A.col(1) - u.dot(A.col(1)) * u;
  if (!(v.squaredNorm() > (std::numeric_limits<Scalar>::min)())) {
    Eigen::Index least = 0;
    u.cwiseAbs().minCoeff(&least);
    v = cross(u, Vector3<Scalar>::Unit(least));
  }
  v.normalize();
  out.U.col(0) = u;
  out.U.col(1) = v;
  out.U.col(2) = cross(u, v);
  out.sigma = largest * Vector3<Scalar>(A.col(0).norm(), A.col(1).norm(), out.U.col(2).dot(A.col(2)));
  return out;
}

}  // namespace CFP_ISA
}  // namespace cfp
