/// @file p3p_impl.hpp
/// The depths behind p3p.hpp. Not an interface.
#pragma once

#include <algorithm>
#include <cmath>

#include "cfp/core/types.hpp"
#include "cfp/math/cubic.hpp"
#include "cfp/math/matrix3.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

// p^T C p for p = (u, v, w), C symmetric.
template <typename Real>
struct Conic {
  Real uu, uv, vv, uw, vw, ww;

  [[nodiscard]] CFP_INLINE Conic adjugate() const noexcept {
    return {vv * ww - vw * vw, uw * vw - uv * ww, uu * ww - uw * uw,
            uv * vw - vv * uw, uv * uw - uu * vw, uu * vv - uv * uv};
  }
  // The trace of the product, the sum over all elements.
  [[nodiscard]] CFP_INLINE Real dot(const Conic& o) const noexcept {
    return uu * o.uu + vv * o.vv + ww * o.ww + Real(2) * (uv * o.uv + uw * o.uw + vw * o.vw);
  }
  [[nodiscard]] CFP_INLINE Conic combine(Real f, const Conic& o, Real g) const noexcept {
    return {f * uu + g * o.uu, f * uv + g * o.uv, f * vv + g * o.vv,
            f * uw + g * o.uw, f * vw + g * o.vw, f * ww + g * o.ww};
  }
};

// Three unit rays y_i meet a triangle at the depths d_i: |d_i y_i - d_j y_j|^2 = (d_i - d_j)^2 + d_i d_j |y_i - y_j|^2.
// The unit of length is the triangle's longest edge, which joins points 1 and 2. The unknowns p = (u, v, w) with
// d0 = w / chord, d1 = d0 + u, d2 = d0 + v stay near one however far away and small the triangle is; nothing cancels.
template <typename Real>
struct P3PEquations {
  Real a, b;           // squared edges 01 and 02
  Real chord;          // of the order of the largest |y_i - y_j|
  Real h01, h02, h12;  // |y_i - y_j|^2 / chord^2

  // The squared edges 01, 02 and 12 minus what they should be.
  [[nodiscard]] CFP_INLINE Vector3<Real> residual(const Vector3<Real>& p) const noexcept {
    const Real w0 = p[2], w1 = w0 + chord * p[0], w2 = w0 + chord * p[1], difference = p[0] - p[1];
    return {p[0] * p[0] + h01 * w0 * w1 - a, p[1] * p[1] + h02 * w0 * w2 - b,
            difference * difference + h12 * w1 * w2 - Real(1)};
  }

  // Newton steps for as long as they help. Returns the squared error left.
  [[nodiscard]] CFP_INLINE Real polish(Vector3<Real>& p) const noexcept {
    Vector3<Real> r = residual(p);
    Real error = r.squaredNorm();
    for (int step = 0; step < 6 && error > Real(1e-29); ++step) {
      // The Jacobian [A 0 B; 0 C D; E F G] by its cofactors.
      const Real w0 = p[2], w1 = w0 + chord * p[0], w2 = w0 + chord * p[1], twice = Real(2) * (p[0] - p[1]);
      const Real A = Real(2) * p[0] + h01 * chord * w0, B = h01 * (w0 + w1);
      const Real C = Real(2) * p[1] + h02 * chord * w0, D = h02 * (w0 + w2);
      const Real E = h12 * chord * w2 + twice, F = h12 * chord * w1 - twice, G = h12 * (w1 + w2);
      const Real minor = C * G - D * F;
      const Real inverse = Real(1) / (A * minor - B * C * E);
      const Vector3<Real> next(p[0] - inverse * (minor * r[0] + B * (F * r[1] - C * r[2])),
                               p[1] - inverse * (D * (E * r[0] - A * r[2]) + (A * G - B * E) * r[1]),
                               p[2] - inverse * (A * (C * r[2] - F * r[1]) - C * E * r[0]));
      r = residual(next);
      const Real next_error = r.squaredNorm();
      if (!(next_error < error)) break;
      error = next_error;
      p = next;
    }
    return error;
  }
};

// The lines l, m of the degenerate conic C = l m^T + m l^T, up to scale: its adjugate is -(l x m)(l x m)^T, and
// C + hat(l x m) has rank one. False when they are not real.
template <typename Real>
[[nodiscard]] CFP_INLINE bool line_pair(const Conic<Real>& C, Vector3<Real> (&lines)[2]) noexcept {
  const Conic<Real> A = C.adjugate();
  Vector3<Real> v(A.uw, A.vw, A.ww);
  Real square = A.ww;
  if (A.uu < square) v = Vector3<Real>(A.uu, A.uv, A.uw), square = A.uu;
  if (A.vv < square) v = Vector3<Real>(A.uv, A.vv, A.vw), square = A.vv;
  if (!(square < Real(0))) return false;
  const Real scale = std::sqrt(-square);
  const Real uu = scale * C.uu, vv = scale * C.vv, uw = scale * C.uw, vw = scale * C.vw;
  const Real uv = scale * C.uv - v[2], vu = scale * C.uv + v[2];
  // The column and the row of the largest elements; a line whose u and v vanish is at infinity and holds no solution.
  const Real diagonal = uu * uu - vv * vv, other = uv * uv - vu * vu;
  lines[0] = diagonal > other ? Vector3<Real>(uu, vu, uw - v[1]) : Vector3<Real>(uv, vv, vw + v[0]);
  lines[1] = diagonal + other > Real(0) ? Vector3<Real>(uu, uv, uw + v[1]) : Vector3<Real>(vu, vv, vw - v[0]);
  return true;
}

// All solutions p with positive depths; returns their number.
template <typename Real>
[[nodiscard]] CFP_INLINE int p3p_depths(const P3PEquations<Real>& q, Vector3<Real> (&solutions)[4]) noexcept {
  // edge01 = a edge12 and edge02 = b edge12: two conics.
  const Real half = q.chord / Real(2), ah = q.a * q.h12, bh = q.b * q.h12, cosine = Real(1) - half * q.chord * q.h12;
  const Conic<Real> C1{Real(1) - q.a, q.a * cosine, -q.a, half * (q.h01 - ah), -half * ah, q.h01 - ah};
  const Conic<Real> C2{-q.b, q.b * cosine, Real(1) - q.b, -half * bh, half * (q.h02 - bh), q.h02 - bh};
  // det(C1 + s C2) = c0 + c1 s + c2 s^2 + c3 s^3. A c3 that is nearly zero means a root near infinity, C2 itself.
  const Conic<Real> A1 = C1.adjugate(), A2 = C2.adjugate();
  const Real c0 = A1.uu * C1.uu + A1.uv * C1.uv + A1.uw * C1.uw, c1 = A1.dot(C2);
  const Real c3 = A2.uu * C2.uu + A2.uv * C2.uv + A2.uw * C2.uw, c2 = A2.dot(C1);
  const Real inverse = Real(1) / (c3 + std::copysign(Real(1e-18) * (std::abs(c1) + std::abs(c2)), c3));
  const Real s = isolated_cubic_root(c2 * inverse, c1 * inverse, c0 * inverse);
  const Real scale = Real(1) / (Real(1) + std::abs(s));
  Vector3<Real> lines[2];
  if (!line_pair(C1.combine(scale, C2, s * scale), lines)) return 0;

  const Conic<Real>& C = std::abs(s) < Real(1) ? C2 : C1;
  int count = 0;
  for (const Vector3<Real>& l : lines) {
    // Points of the line: the one nearest to the origin of the plane w = 1, (u, v, w), plus t (-l1, l0, 0).
    const Real u = -l[2] * l[0], v = -l[2] * l[1], w = l[0] * l[0] + l[1] * l[1];
    const Real Cu = C.uu * u + C.uv * v + C.uw * w, Cv = C.uv * u + C.vv * v + C.vw * w;
    const Real qa = C.uu * l[1] * l[1] - Real(2) * C.uv * l[0] * l[1] + C.vv * l[0] * l[0];
    const Real qb = l[0] * Cv - l[1] * Cu, qc = u * Cu + v * Cv + w * (C.uw * u + C.vw * v + C.ww * w);
    const Real discriminant = qb * qb - qa * qc;
    // A slightly negative discriminant is a double root after rounding; the polish tells.
    if (!(discriminant > Real(-1e-8) * (qb * qb + std::abs(qa * qc)))) continue;
    const Real sum = -(qb + std::copysign(std::sqrt(discriminant > Real(0) ? discriminant : Real(0)), qb));
    const Real roots[2][2] = {{sum, qa}, {qc, sum}};  // t = sum / qa and qc / sum
    for (const auto& root : roots) {
      const Real t = root[0], one = root[1];
      Vector3<Real> p(one * u - t * l[1], one * v + t * l[0], one * w);
      const Real w1 = p[2] + q.chord * p[0], w2 = p[2] + q.chord * p[1];
      if (!((std::min)(w1 * p[2], w2 * p[2]) > Real(0))) continue;
      p *= std::copysign(Real(1), p[2]) / std::sqrt((p[0] - p[1]) * (p[0] - p[1]) + q.h12 * w1 * w2);
      if (!(q.polish(p) < Real(1e-20))) continue;
      solutions[count++] = p;
    }
  }
  return count;
}

// Orthonormal frame of a triangle: along one edge, whose inverse length is nearly known, towards another, normal. The
// second axis is made orthogonal twice, which makes it exact for the thinnest of triangles.
template <typename Real>
[[nodiscard]] CFP_INLINE Matrix3<Real> triangle_frame(const Vector3<Real>& edge, Real inverse_length,
                                                      const Vector3<Real>& other) noexcept {
  Vector3<Real> x = inverse_length * edge;
  x *= Real(1.5) - Real(0.5) * x.squaredNorm();
  Vector3<Real> y = other - x.dot(other) * x;
  y -= x.dot(y) * x;
  y *= Real(1) / std::sqrt(y.squaredNorm());
  Matrix3<Real> frame;
  frame << x, y, cross(x, y);
  return frame;
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
