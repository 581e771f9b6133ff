/// @file fundamental_impl.hpp
/// Inner parts of fundamental.hpp and fundamental_ransac.hpp: scaling of pixels, the seven-point core. Not an
/// interface.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include <Eigen/Core>
#include <Eigen/LU>

#include "cfp/core/span.hpp"
#include "cfp/math/cubic.hpp"
#include "cfp/math/so3.hpp"

namespace cfp::detail {

inline constexpr double max_pixel = 1e5;  // beyond it a coordinate is taken for a broken one; no image is that large

template <typename Scalar>
[[nodiscard]] bool usable_pair(const PointSpan<Scalar, 2>& prev, const PointSpan<Scalar, 2>& cur,
                               std::size_t i) noexcept {
  using std::abs;
  const Scalar limit = Scalar(max_pixel);
  return abs(prev(i, 0)) < limit && abs(prev(i, 1)) < limit && abs(cur(i, 0)) < limit && abs(cur(i, 1)) < limit;
}

// The weight of a pair; 0 for one that counts as absent.
template <typename Scalar>
[[nodiscard]] double pair_weight(const PointSpan<Scalar, 2>& prev, const PointSpan<Scalar, 2>& cur,
                                 const span<const Scalar>& weights, std::size_t i) noexcept {
  const double w = weights.empty() ? 1.0 : static_cast<double>(weights[i]);
  return w > 0 && is_finite(w) && usable_pair(prev, cur, i) ? w : 0.0;
}

// x -> factor (x - centre) of one image.
struct PixelScaling {
  double factor = 0, x = 0, y = 0;
  double largest_weight = 0;

  [[nodiscard]] bool valid() const noexcept { return factor > 0 && is_finite(factor); }
  template <typename Scalar>
  [[nodiscard]] Vector3<double> operator()(Scalar u, Scalar v) const noexcept {
    return {factor * (static_cast<double>(u) - x), factor * (static_cast<double>(v) - y), 1.0};
  }
  [[nodiscard]] Matrix3<double> matrix() const noexcept {
    Matrix3<double> T = Matrix3<double>::Identity();
    T(0, 0) = T(1, 1) = factor;
    T(0, 2) = -factor * x;
    T(1, 2) = -factor * y;
    return T;
  }
};

// Weighted centroid to the origin, weighted mean distance to sqrt 2, in each image. Returns the number of pairs
// present.
template <typename Scalar>
std::size_t scale_pixels(const PointSpan<Scalar, 2>& prev, const PointSpan<Scalar, 2>& cur,
                         const span<const Scalar>& weights, PixelScaling& scale_prev,
                         PixelScaling& scale_cur) noexcept {
  std::size_t used = 0;
  double largest = 0;
  for (std::size_t i = 0; i < prev.size(); ++i) {
    const double w = pair_weight(prev, cur, weights, i);
    used += w > 0 ? 1 : 0;
    largest = (std::max)(largest, w);
  }
  if (used == 0) return 0;
  double sum = 0;
  PixelScaling scale[2];
  for (std::size_t i = 0; i < prev.size(); ++i) {
    const double w = pair_weight(prev, cur, weights, i) / largest;
    if (!(w > 0)) continue;
    sum += w;
    scale[0].x += w * static_cast<double>(prev(i, 0)), scale[0].y += w * static_cast<double>(prev(i, 1));
    scale[1].x += w * static_cast<double>(cur(i, 0)), scale[1].y += w * static_cast<double>(cur(i, 1));
  }
  double spread[2] = {0, 0};
  for (PixelScaling& s : scale) s.x /= sum, s.y /= sum, s.largest_weight = largest;
  for (std::size_t i = 0; i < prev.size(); ++i) {
    const double w = pair_weight(prev, cur, weights, i) / largest;
    if (!(w > 0)) continue;
    for (int k = 0; k < 2; ++k) {
      const PointSpan<Scalar, 2>& points = k == 0 ? prev : cur;
      const double dx = static_cast<double>(points(i, 0)) - scale[k].x,
                   dy = static_cast<double>(points(i, 1)) - scale[k].y;
      spread[k] += w * std::sqrt(dx * dx + dy * dy);
    }
  }
  for (int k = 0; k < 2; ++k) scale[k].factor = spread[k] > 1e-9 * sum ? std::sqrt(2.0) * sum / spread[k] : 0;
  scale_prev = scale[0];
  scale_cur = scale[1];
  return used;
}

// F of pixels from F of scaled pixels, unit norm.
[[nodiscard]] inline Matrix3<double> unscaled(const Matrix3<double>& F, const PixelScaling& scale_prev,
                                              const PixelScaling& scale_cur) noexcept {
  return (scale_cur.matrix().transpose() * F * scale_prev.matrix()).normalized();
}

// Null space of the seven epipolar equations by elimination with complete pivoting (rows and columns), which stays
// exact when any of the nine coefficients vanishes (pure translations do that). False when the rank is below seven.
[[nodiscard]] inline bool seven_point_null_space(double (&A)[7][9], Matrix3<double>& F1, Matrix3<double>& F2) noexcept {
  int column[9] = {0, 1, 2, 3, 4, 5, 6, 7, 8};
  double first_pivot = 0;
  for (int k = 0; k < 7; ++k) {
    int pivot_row = k, pivot_col = k;
    double pivot = 0;
    for (int r = k; r < 7; ++r) {
      for (int c = k; c < 9; ++c) {
        const double value = std::abs(A[r][c]);
        if (value > pivot) pivot = value, pivot_row = r, pivot_col = c;
      }
    }
    if (k == 0) first_pivot = pivot;
    if (!(pivot > 1e-12 * first_pivot)) return false;
    if (pivot_row != k) std::swap(A[k], A[pivot_row]);
    if (pivot_col != k) {
      for (auto& row : A) std::swap(row[k], row[pivot_col]);
      std::swap(column[k], column[pivot_col]);
    }
    const double inverse = 1.0 / A[k][k];
    for (int c = k + 1; c < 9; ++c) A[k][c] *= inverse;
    for (int r = k + 1; r < 7; ++r) {
      const double factor = A[r][k];
      for (int c = k + 1; c < 9; ++c) A[r][c] -= factor * A[k][c];
    }
  }
  for (int free = 0; free < 2; ++free) {
    double x[9];
    x[7] = free == 0 ? 1 : 0;
    x[8] = free == 0 ? 0 : 1;
    for (int k = 6; k >= 0; --k) {
      x[k] = 0;
      for (int c = k + 1; c < 9; ++c) x[k] -= A[k][c] * x[c];
    }
    Matrix3<double>& F = free == 0 ? F1 : F2;
    for (int k = 0; k < 9; ++k) F(column[k] / 3, column[k] % 3) = x[k];
    F.normalize();
  }
  return true;
}

// Seven-point solver on scaled pixels: the matrices of the pencil through the null space whose determinant vanishes.
[[nodiscard]] inline int solve_seven_point(const double (&p)[7][2], const double (&q)[7][2],
                                           Matrix3<double> (&F)[3]) noexcept {
  double A[7][9];
  for (int i = 0; i < 7; ++i) {
    const double row[9] = {q[i][0] * p[i][0], q[i][0] * p[i][1], q[i][0], q[i][1] * p[i][0], q[i][1] * p[i][1], q[i][1],
                           p[i][0],           p[i][1],           1.0};
    for (int c = 0; c < 9; ++c) A[i][c] = row[c];
  }
  Matrix3<double> a, b;
  if (!seven_point_null_space(A, a, b)) return 0;
  // det(a + x b) has at most three roots, so among four members of the pencil one has a determinant well away from
  // zero: that one as b makes the cubic's leading coefficient safe and leaves no root at infinity.
  const Matrix3<double> candidates[4] = {b, a, (a + b).normalized(), (a - b).normalized()};
  int best = 0;
  double det_b = candidates[0].determinant();
  for (int k = 1; k < 4; ++k) {
    const double det = candidates[k].determinant();
    if (std::abs(det) > std::abs(det_b)) best = k, det_b = det;
  }
  if (best == 1) a = b;
  b = candidates[best];
  if (!(std::abs(det_b) > 0)) return 0;
  // Coefficients of det(a + x b) through the adjugates: tr(adj(a) b) and tr(a adj(b)).
  Matrix3<double> cofactor_a, cofactor_b;
  for (int i = 0; i < 3; ++i) {
    cofactor_a.col(i) = a.col((i + 1) % 3).cross(a.col((i + 2) % 3));
    cofactor_b.col(i) = b.col((i + 1) % 3).cross(b.col((i + 2) % 3));
  }
  double roots[3];
  const int count = real_cubic_roots(cofactor_b.cwiseProduct(a).sum() / det_b, cofactor_a.cwiseProduct(b).sum() / det_b,
                                     a.determinant() / det_b, roots);
  for (int k = 0; k < count; ++k) F[k] = (a + roots[k] * b).normalized();
  return count;
}

}  // namespace cfp::detail
