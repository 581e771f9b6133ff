/// @file p3p_impl.hpp
/// The depths behind p3p.hpp. Not an interface.
#pragma once

#include <algorithm>
#include <cmath>

#include "cfp/core/numeric.hpp"
#include "cfp/math/cubic.hpp"

namespace cfp::detail {

// The point or line (u, v, w).
template <typename Real>
struct Triple {
  Real u, v, w;
};

// p^T C p for p = (u, v, w), C symmetric.
template <typename Real>
struct Conic {
  Real uu, uv, vv, uw, vw, ww;
};

inline namespace CFP_ISA {

template <typename Real>
[[nodiscard]] CFP_INLINE Real squared_norm(const Triple<Real>& x) noexcept {
  return x.u * x.u + x.v * x.v + x.w * x.w;
}

// Three unit rays y_i meet a triangle at the depths d_i: |d_i y_i - d_j y_j|^2 = (d_i - d_j)^2 + d_i d_j e_ij with
// e_ij = |y_i - y_j|^2. The unit of length is the triangle's longest edge, which joins points 1 and 2. In the unknowns
// (u, v, w) = (d1 - d0, d2 - d0, d0) nothing cancels, however far away and small the triangle is.
template <typename Real>
struct P3PEquations {
  Real a, b;           // squared edges 01 and 02
  Real e01, e02, e12;  // squared distances of the rays' ends

  // The squared edges 01, 02 and 12 minus what they should be.
  [[nodiscard]] CFP_INLINE Triple<Real> residual(const Triple<Real>& p) const noexcept {
    const Real w1 = p.w + p.u, w2 = p.w + p.v, difference = p.u - p.v;
    return {p.u * p.u + e01 * p.w * w1 - a, p.v * p.v + e02 * p.w * w2 - b,
            difference * difference + e12 * w1 * w2 - Real(1)};
  }

  // The Newton step from p with residual r, to be subtracted: the Jacobian is [A 0 B; 0 C D; E F G].
  [[nodiscard]] CFP_INLINE Triple<Real> step(const Triple<Real>& p, const Triple<Real>& r) const noexcept {
    const Real w1 = p.w + p.u, w2 = p.w + p.v, twice = Real(2) * (p.u - p.v);
    const Real A = Real(2) * p.u + e01 * p.w, B = e01 * (p.w + w1);
    const Real C = Real(2) * p.v + e02 * p.w, D = e02 * (p.w + w2);
    const Real E = e12 * w2 + twice, F = e12 * w1 - twice, G = e12 * (w1 + w2);
    const Real minor = C * G - D * F, inverse = Real(1) / (A * minor - B * C * E);
    return {inverse * (minor * r.u + B * (F * r.v - C * r.w)),
            inverse * (D * (E * r.u - A * r.w) + (A * G - B * E) * r.v),
            inverse * (A * (C * r.w - F * r.v) - C * E * r.u)};
  }

  // Newton steps for as long as they help; false when they lead to no solution.
  [[nodiscard]] bool polish(Triple<Real>& p) const noexcept {
    Triple<Real> r = residual(p);
    for (int i = 0; i < 8; ++i) {
      const Triple<Real> change = step(p, r), next{p.u - change.u, p.v - change.v, p.w - change.w};
      const Triple<Real> next_r = residual(next);
      if (!(squared_norm(next_r) < squared_norm(r))) break;
      p = next, r = next_r;
    }
    return squared_norm(r) < Real(1e-20);
  }

  // The conics C1: edge01 = a edge12 and C2: edge02 = b edge12; s such that det(C1 + s C2) vanishes, the best separated
  // root of c0 + c1 s + c2 s^2 + c3 s^3.
  [[nodiscard]] CFP_INLINE Real degenerate_conic() const noexcept {
    const Real k1 = e01 - a * e12, k2 = e02 - b * e12, half = Real(0.5) * e12, quarter = half * half;
    const Real D1 = k1 * (Real(1) - a * half - Real(0.25) * k1) + quarter * a * (Real(1) - a);
    const Real D2 = k2 * (Real(1) - b * half - Real(0.25) * k2) + quarter * b * (Real(1) - b);
    const Real mixed = (Real(1) - half) * (Real(0.5) * e01 * e02 - k1 - k2) + quarter * (a + b - Real(1));
    const Real c0 = -a * D1, c1 = a * mixed + (Real(1) - b) * D1;
    const Real c3 = -b * D2, c2 = b * mixed + (Real(1) - a) * D2;
    // A c3 that is nearly or exactly zero means a root near infinity, C2 itself.
    const Real inverse = Real(1) / (c3 + std::copysign(Real(1e-18) * (std::abs(c1) + std::abs(c2)), c3));
    const Real root = isolated_cubic_root(c2 * inverse, c1 * inverse, c0 * inverse);
    return is_finite(root) ? root : Real(1e30);
  }

  // f C1 + g C2.
  [[nodiscard]] CFP_INLINE Conic<Real> pencil(Real f, Real g) const noexcept {
    const Real m = f * a + g * b, me = Real(0.5) * m * e12, f1 = Real(0.5) * f * e01, g2 = Real(0.5) * g * e02;
    return {f - m, m - me, g - m, f1 - me, g2 - me, Real(2) * (f1 + g2 - me)};
  }
};

// The lines l, m of the degenerate conic C = l m^T + m l^T, up to scale: its adjugate is -(l x m)(l x m)^T, and
// C + hat(l x m) has rank one. False when they are not real.
template <typename Real>
[[nodiscard]] CFP_INLINE bool line_pair(const Conic<Real>& C, Triple<Real> (&lines)[2]) noexcept {
  const Real a01 = C.uw * C.vw - C.uv * C.ww, a02 = C.uv * C.vw - C.vv * C.uw, a12 = C.uv * C.uw - C.uu * C.vw;
  const Real a00 = C.vv * C.ww - C.vw * C.vw, a11 = C.uu * C.ww - C.uw * C.uw, a22 = C.uu * C.vv - C.uv * C.uv;
  Triple<Real> v{a02, a12, a22};
  Real square = a22;
  if (a00 < square) v = {a00, a01, a02}, square = a00;
  if (a11 < square) v = {a01, a11, a12}, square = a11;
  if (!(square < Real(0))) return false;
  const Real scale = std::sqrt(-square);
  // l m^T
  const Real uu = scale * C.uu, uv = scale * C.uv - v.w, uw = scale * C.uw + v.v;
  const Real vu = scale * C.uv + v.w, vv = scale * C.vv, vw = scale * C.vw - v.u;
  const Real wu = scale * C.uw - v.v, wv = scale * C.vw + v.u, ww = scale * C.ww;
  // Of the first two columns and rows those of the largest elements, as a line whose u and v vanish is at infinity and
  // holds no solution. Where it leaves nearly nothing of them the other line stands in the last one.
  const Real most =
      Real(1e7) * (std::max)((std::max)(std::abs(uu), std::abs(vv)), (std::max)(std::abs(uv), std::abs(vu)));
  const bool last_column = (std::max)(std::abs(uw), std::abs(vw)) > most;
  const bool last_row = (std::max)(std::abs(wu), std::abs(wv)) > most;
  const Real diagonal = uu * uu - vv * vv, other = uv * uv - vu * vu;
  const bool column = diagonal > other, row = diagonal + other > Real(0);
  lines[0] = last_column ? Triple<Real>{uw, vw, ww} : column ? Triple<Real>{uu, vu, wu} : Triple<Real>{uv, vv, wv};
  lines[1] = last_row ? Triple<Real>{wu, wv, ww} : row ? Triple<Real>{uu, uv, uw} : Triple<Real>{vu, vv, vw};
  return true;
}

// All solutions with positive depths; returns their number.
template <typename Real>
[[nodiscard]] CFP_INLINE int p3p_depths(const P3PEquations<Real>& q, Triple<Real> (&solutions)[4]) noexcept {
  const Real s = q.degenerate_conic(), scale = Real(1) / (Real(1) + std::abs(s));
  Triple<Real> lines[2];
  if (!line_pair(q.pencil(scale, s * scale), lines)) return 0;

  // Where both lines meet C1 or C2: points (-lw lu, -lw lv, n), the nearest to the origin of the plane w = 1, plus
  // t (-lv, lu, 0); qa t^2 + 2 qb t + qc = 0.
  const bool second = std::abs(s) < Real(1);
  const Conic<Real> C = q.pencil(second ? Real(0) : Real(1), second ? Real(1) : Real(0));
  int count = 0;
  for (const Triple<Real>& l : lines) {
    const Real n = l.u * l.u + l.v * l.v;
    const Real gu = C.uu * l.u + C.uv * l.v, gv = C.uv * l.u + C.vv * l.v, g = l.u * gu + l.v * gv;
    const Real qa = (C.uu + C.vv) * n - g;
    const Real qb = n * (C.vw * l.u - C.uw * l.v) - l.w * (l.u * gv - l.v * gu);
    const Real qc = l.w * (l.w * g - Real(2) * n * (C.uw * l.u + C.vw * l.v)) + C.ww * n * n;
    const Real square = qb * qb, product = qa * qc, discriminant = square - product;
    // A slightly negative discriminant is a double root after rounding; the polish tells.
    if (!(discriminant > Real(-1e-8) * (square + std::abs(product)))) continue;
    const Real root = std::sqrt((std::max)(discriminant, Real(0))), sum = -(qb + std::copysign(root, qb));
    for (const Real t : {sum / qa, qc / sum}) {
      Triple<Real>& x = solutions[count];
      x = {-l.v * t - l.w * l.u, l.u * t - l.w * l.v, n};
      const Real difference = x.u - x.v;
      const Real unit = Real(1) / std::sqrt(difference * difference + q.e12 * (x.w + x.u) * (x.w + x.v));
      x = {x.u * unit, x.v * unit, x.w * unit};
      const Triple<Real> change = q.step(x, q.residual(x));
      // The equations are quadratic: what a step leaves is of the order of its square.
      if (squared_norm(change) < Real(1e-20)) {
        x = {x.u - change.u, x.v - change.v, x.w - change.w};
      } else if (!q.polish(x)) {
        continue;
      }
      // A point in the camera's centre is on no ray.
      if (x.w + (std::min)(x.u, x.v) > Real(1e-12) && x.w > Real(1e-12)) ++count;
    }
  }
  return count;
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
