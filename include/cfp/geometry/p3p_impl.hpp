/// @file p3p_impl.hpp
/// The depths behind p3p.hpp. Not an interface.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Core>
#include <Eigen/LU>

#include "cfp/math/cubic.hpp"
#include "cfp/math/so3.hpp"

namespace cfp::detail {

// Two edges of a triangle and their normal.
[[nodiscard]] inline Matrix3<double> triangle_frame(const Vector3<double>& a, const Vector3<double>& b) noexcept {
  Matrix3<double> frame;
  frame.col(0) = a;
  frame.col(1) = b;
  frame.col(2) = a.cross(b);
  return frame;
}

// The planes of the degenerate quadric D = v v'^T + v' v^T: with eigenvectors e of the eigenvalues s1 > 0 > s2 and 0,
// e1 +- sqrt(-s2 / s1) e2 are their normals. False when D is no pair of real planes.
[[nodiscard]] inline bool plane_pair(const Matrix3<double>& D, Vector3<double> (&normals)[2]) noexcept {
  // Eigenvalues 0 and the roots of s^2 - tr s + m, m the sum of the principal minors.
  const double trace = D.trace();
  const double minors = D(0, 0) * D(1, 1) - D(0, 1) * D(0, 1) + D(0, 0) * D(2, 2) - D(0, 2) * D(0, 2) +
                        D(1, 1) * D(2, 2) - D(1, 2) * D(1, 2);
  if (!(minors <= 0)) return false;
  const double root = std::sqrt(0.25 * trace * trace - minors);
  const double large = trace > 0 ? 0.5 * trace + root : 0.5 * trace - root;
  if (!(std::abs(large) > 0)) return false;
  const double sigma[2] = {large, minors / large};
  // The null vector is across the rows; the eigenvector of the larger eigenvalue is in the plane of the rows.
  Vector3<double> e0 = D.col(0).cross(D.col(1));
  for (int c = 0; c < 2; ++c) {
    const Vector3<double> other = D.col(c).cross(D.col(2));
    if (other.squaredNorm() > e0.squaredNorm()) e0 = other;
  }
  const double norm = e0.norm();
  if (!(norm > 0)) return false;
  e0 /= norm;
  Matrix3<double> shifted = D;
  shifted.diagonal().array() -= sigma[1];
  shifted += sigma[1] * e0 * e0.transpose();  // (s1 - s2) e1 e1^T is left
  int column = 0;
  if (shifted(1, 1) * shifted(1, 1) > shifted(0, 0) * shifted(0, 0)) column = 1;
  if (std::abs(shifted(2, 2)) > std::abs(shifted(column, column))) column = 2;
  const Vector3<double> e1 = shifted.col(column).normalized();
  const Vector3<double> e2 = e0.cross(e1);
  const double ratio = std::sqrt((std::max)(-sigma[1] / sigma[0], 0.0));
  normals[0] = e1 + ratio * e2;
  normals[1] = e1 - ratio * e2;
  return normals[0].allFinite() && normals[1].allFinite();
}

// Gauss-Newton on the three squared edge lengths |d_i y_i - d_j y_j|^2. Returns the final error, relative to the
// longest edge.
[[nodiscard]] inline double polish_depths(const double (&cosine)[3], const double (&length_sq)[3],
                                          double (&d)[3]) noexcept {
  double error = std::numeric_limits<double>::infinity();
  for (int step = 0; step < 10; ++step) {
    Vector3<double> r;
    Matrix3<double> J = Matrix3<double>::Zero();
    for (int k = 0; k < 3; ++k) {
      const int i = k == 2 ? 1 : 0, j = k == 0 ? 1 : 2;
      r[k] = d[i] * d[i] + d[j] * d[j] - 2 * d[i] * d[j] * cosine[k] - length_sq[k];
      J(k, i) = 2 * (d[i] - d[j] * cosine[k]);
      J(k, j) = 2 * (d[j] - d[i] * cosine[k]);
    }
    const double now = r.cwiseAbs().maxCoeff();
    if (!(now < error)) return error;
    error = now;
    if (error < 1e-16 * d[0] * d[0]) return error;
    const Vector3<double> change = J.inverse() * r;
    const double next[3] = {d[0] - change[0], d[1] - change[1], d[2] - change[2]};
    if (!change.allFinite() || !(next[0] > 0 && next[1] > 0 && next[2] > 0)) return error;
    for (int i = 0; i < 3; ++i) d[i] = next[i];
  }
  return error;
}

// All positive depths of three points x on unit rays y; x within a unit cube of size one. Edges: 0 = (0,1), 1 = (0,2),
// 2 = (1,2).
[[nodiscard]] inline int p3p_depths(const Vector3<double> (&y)[3], const Vector3<double> (&x)[3],
                                    double (&depths)[4][3]) noexcept {
  const double cosine[3] = {y[0].dot(y[1]), y[0].dot(y[2]), y[1].dot(y[2])};
  const double length_sq[3] = {(x[0] - x[1]).squaredNorm(), (x[0] - x[2]).squaredNorm(), (x[1] - x[2]).squaredNorm()};
  const auto edge = [&](int k) {
    const int i = k == 2 ? 1 : 0, j = k == 0 ? 1 : 2;
    Matrix3<double> M = Matrix3<double>::Zero();
    M(i, i) = M(j, j) = 1;
    M(i, j) = M(j, i) = -cosine[k];
    return M;
  };
  const Matrix3<double> D1 = edge(0) * length_sq[2] - edge(2) * length_sq[0];
  const Matrix3<double> D2 = edge(1) * length_sq[2] - edge(2) * length_sq[1];
  // det(D1 + g D2): coefficients through the cofactors, both matrices symmetric.
  Matrix3<double> cofactor1, cofactor2;
  for (int i = 0; i < 3; ++i) {
    cofactor1.col(i) = D1.col((i + 1) % 3).cross(D1.col((i + 2) % 3));
    cofactor2.col(i) = D2.col((i + 1) % 3).cross(D2.col((i + 2) % 3));
  }
  const double c3 = D2.determinant(), c2 = cofactor2.cwiseProduct(D1).sum(), c1 = cofactor1.cwiseProduct(D2).sum(),
               c0 = D1.determinant();
  // The leading coefficient must be safe; the pencil may as well be taken from its other end.
  const bool swap = std::abs(c0) > std::abs(c3);
  double roots[3];
  const int root_count =
      swap ? real_cubic_roots(c1 / c0, c2 / c0, c3 / c0, roots) : real_cubic_roots(c2 / c3, c1 / c3, c0 / c3, roots);

  // Any root whose quadric is a pair of real planes gives every solution; the one with the most pronounced pair gives
  // them best.
  Vector3<double> normals[2];
  double best = 0;
  for (int k = 0; k < root_count; ++k) {
    const Matrix3<double> D = swap ? Matrix3<double>(D2 + roots[k] * D1) : Matrix3<double>(D1 + roots[k] * D2);
    const double minors = D(0, 0) * D(1, 1) - D(0, 1) * D(0, 1) + D(0, 0) * D(2, 2) - D(0, 2) * D(0, 2) +
                          D(1, 1) * D(2, 2) - D(1, 2) * D(1, 2);
    const double quality = -minors / D.squaredNorm();
    Vector3<double> candidate[2];
    if (!(quality > best) || !plane_pair(D, candidate)) continue;
    best = quality;
    normals[0] = candidate[0];
    normals[1] = candidate[1];
  }
  if (!(best > 0)) return 0;

  int count = 0;
  for (const Vector3<double>& n : normals) {
    // On the plane n . d = 0 take the two largest free directions: eliminate the depth with the largest coefficient.
    int a = 0;
    if (std::abs(n[1]) > std::abs(n[a])) a = 1;
    if (std::abs(n[2]) > std::abs(n[a])) a = 2;
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    Vector3<double> u = Vector3<double>::Zero(), v = Vector3<double>::Zero();  // d = u + tau v, up to scale
    u[b] = 1, u[a] = -n[b] / n[a];
    v[c] = 1, v[a] = -n[c] / n[a];
    const Matrix3<double>& Q = D1.norm() * length_sq[1] > D2.norm() * length_sq[0] ? D1 : D2;
    const double qa = v.dot(Q * v), qb = u.dot(Q * v), qc = u.dot(Q * u);
    const double discriminant = qb * qb - qa * qc;
    // A slightly negative discriminant is a double root after rounding; the polish below tells.
    if (!(discriminant > -1e-10 * (qb * qb + std::abs(qa * qc)))) continue;
    const double w = -(qb + (qb > 0 ? 1.0 : -1.0) * std::sqrt((std::max)(discriminant, 0.0)));
    const Vector3<double> directions[2] = {u * qa + v * w, u * w + v * qc};  // tau = w / qa and tau = qc / w
    for (Vector3<double> d : directions) {
      if (d.sum() < 0) d = -d;
      if (!(d[0] > 0 && d[1] > 0 && d[2] > 0)) continue;
      // Scale from all three edges.
      double ratio = 0, weight = 0;
      for (int k = 0; k < 3; ++k) {
        const int i = k == 2 ? 1 : 0, j = k == 0 ? 1 : 2;
        const double measured = d[i] * d[i] + d[j] * d[j] - 2 * d[i] * d[j] * cosine[k];
        ratio += length_sq[k] * length_sq[k];
        weight += measured * length_sq[k];
      }
      const double scale = std::sqrt(ratio / weight);
      double(&out)[3] = depths[count];
      for (int i = 0; i < 3; ++i) out[i] = scale * d[i];
      if (!is_finite(scale) || !(polish_depths(cosine, length_sq, out) < 1e-12)) continue;
      ++count;
    }
  }
  return count;
}

}  // namespace cfp::detail
