/// @file symmetric3_impl.hpp
/// Symmetric 3x3 matrices as six numbers, 00 01 02 11 12 22 (internal to bundle_adjustment.hpp).
#pragma once

#include "cfp/version.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

/// Inverse of the symmetric V (00 01 02 11 12 22) through V = L D L^T; false when it is not positive definite.
[[nodiscard]] inline bool invert_symmetric(const double (&V)[6], double* inverse) noexcept {
  const double i0 = 1 / V[0];
  const double l1 = V[1] * i0, l2 = V[2] * i0;
  const double d1 = V[3] - l1 * V[1];
  const double i1 = 1 / d1;
  const double t = V[4] - l2 * V[1];
  const double l3 = t * i1;
  const double d2 = V[5] - l2 * V[2] - l3 * t;
  if (!(V[0] > 0 && d1 > 0 && d2 > 0)) return false;
  const double i2 = 1 / d2;
  const double m2 = l1 * l3 - l2;  // L^-1 = [1, -l1 1, m2 -l3 1]
  inverse[5] = i2;
  inverse[4] = -l3 * i2;
  inverse[3] = i1 + l3 * l3 * i2;
  inverse[2] = m2 * i2;
  inverse[1] = -l1 * i1 - l3 * m2 * i2;
  inverse[0] = i0 + l1 * l1 * i1 + m2 * m2 * i2;
  return true;
}

inline void multiply_symmetric(const double* S, const double (&x)[3], double (&y)[3]) noexcept {
  y[0] = S[0] * x[0] + S[1] * x[1] + S[2] * x[2];
  y[1] = S[1] * x[0] + S[3] * x[1] + S[4] * x[2];
  y[2] = S[2] * x[0] + S[4] * x[1] + S[5] * x[2];
}

inline void add_cross(const double (&a)[3], const double (&b)[3], double* sum) noexcept {
  sum[0] += a[1] * b[2] - a[2] * b[1], sum[1] += a[2] * b[0] - a[0] * b[2], sum[2] += a[0] * b[1] - a[1] * b[0];
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
