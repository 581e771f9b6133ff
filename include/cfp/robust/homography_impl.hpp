/// @file homography_impl.hpp
/// Homographies for the degeneracy check of fundamental_ransac.hpp. Scaled pixels throughout. Not an interface.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/math/matrix3.hpp"
#include "cfp/robust/fundamental_pairs_impl.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

// Squared distance of the current point to the mapped previous one; infinite when that lies at infinity.
template <typename T>
[[nodiscard]] T transfer_sq(const PairArrays& pairs, const Matrix3<T>& H, std::size_t i) noexcept {
  const Vector3<T> mapped = H * previous_point<T>(pairs, i);
  const T dx = mapped.x() / mapped.z() - pairs.row(cur_x)[i], dy = mapped.y() / mapped.z() - pairs.row(cur_y)[i];
  const T d2 = dx * dx + dy * dy;
  return d2 >= 0 ? d2 : std::numeric_limits<T>::infinity();
}

// The same under the noise of both images: J, the derivative of H, carries that of the previous one over. r is the
// difference of the points, 2 r^T (I + J J^T)^-1 r the value: that of transfer_sq where J is a rotation.
template <typename T>
[[nodiscard]] T whitened_transfer_sq(const PairArrays& pairs, const Matrix3<T>& H, std::size_t i) noexcept {
  const Vector3<T> mapped = H * previous_point<T>(pairs, i);
  const T inverse_z = 1 / mapped.z(), u = mapped.x() * inverse_z, v = mapped.y() * inverse_z;
  const T dx = u - pairs.row(cur_x)[i], dy = v - pairs.row(cur_y)[i];
  const T ux = (H(0, 0) - u * H(2, 0)) * inverse_z, uy = (H(0, 1) - u * H(2, 1)) * inverse_z;
  const T vx = (H(1, 0) - v * H(2, 0)) * inverse_z, vy = (H(1, 1) - v * H(2, 1)) * inverse_z;
  const T uu = 1 + ux * ux + uy * uy, uv = ux * vx + uy * vy, vv = 1 + vx * vx + vy * vy;
  const T d2 = 2 * (vv * dx * dx - 2 * uv * dx * dy + uu * dy * dy) / (uu * vv - uv * uv);
  return d2 >= 0 ? d2 : std::numeric_limits<T>::infinity();
}

// Sum of w min(d^2 / limit, 1), d the transfer distance.
template <typename T>
[[nodiscard]] double transfer_cost(const PairColumns<T>& in, const Matrix3<double>& H, double limit) noexcept {
  using P = simd::Packet<T>;
  const Matrix3<T> h = H.template cast<T>();
  const P most(static_cast<T>(limit)), tiny(T(1e-30));
  const auto cost = [&](std::size_t i) {
    const auto load = [&](std::size_t row) { return P::load(in.row[row] + i); };
    const P x = load(prev_x), y = load(prev_y);
    const auto mapped = [&](int r) { return multiply_add(P(h(r, 0)), x, multiply_add(P(h(r, 1)), y, P(h(r, 2)))); };
    // Multiplied out by z, so that a point mapped to infinity is an outlier and not a NaN.
    const P z = mapped(2), dx = mapped(0) - load(cur_x) * z, dy = mapped(1) - load(cur_y) * z;
    const P d2 = (dx * dx + dy * dy) / multiply_add(z, z, tiny);
    return load(score_weight) * select(d2 < most, d2, most);
  };
  return bounded_sum<T>(in.size, std::numeric_limits<double>::infinity(), cost) / limit;
}

// The homography of four pairs: each image's four points are a projective basis. False when three lie on a line.
template <typename T>
[[nodiscard]] bool homography_of_four(const PairArrays& pairs, const std::array<std::uint32_t, 4>& sample,
                                      Matrix3<T>& H) noexcept {
  const auto basis = [&](auto&& point) -> Matrix3<T> {
    Matrix3<T> M;
    for (std::size_t k = 0; k < 3; ++k) M.col(static_cast<Eigen::Index>(k)) = point(pairs, sample[k]);
    return M * Vector3<T>(inverse(M) * point(pairs, sample[3])).asDiagonal();
  };
  const Matrix3<T> previous = basis(previous_point<T>);
  H = basis(current_point<T>) * inverse(previous);
  const T norm = H.norm();
  return H.allFinite() && std::abs(determinant(H)) > T(1e-9) * norm * norm * norm;
}

// Sum of w rho(d^2 / scale), d the transfer distance, rho(x) = x / (1 + x), as a model of least_squares.hpp: eight
// unknowns, h22 = 1 (points are centred, so that it is not near zero). Multiplied by z the residual is linear in h, and
// every sum is one of W, W u, W v and W (u^2 + v^2) times the products of (x, y, 1); leaving out the derivative of 1 /
// z moves the minimum by less than the square of the noise.
template <typename T>
struct TransferModel {
  PairColumns<T> pairs;
  double scale;

  double linearize(const Matrix3<double>& H, NormalEquations<8>& out) const noexcept {
    Eigen::Matrix<double, 9, 4> moments = Eigen::Matrix<double, 9, 4>::Zero();
    double cost = 0;
    for (std::size_t i = 0; i < pairs.size; ++i) {
      const auto of = [&](std::size_t row) { return static_cast<double>(pairs.row[row][i]); };
      const double x = of(prev_x), y = of(prev_y), u = of(cur_x), v = of(cur_y);
      const Vector3<double> mapped = H * Vector3<double>(x, y, 1);
      const double inverse_z = 1 / mapped.z(), dx = mapped.x() * inverse_z - u, dy = mapped.y() * inverse_z - v;
      const double distance = (dx * dx + dy * dy) / scale, w = of(score_weight), share = 1 / (1 + distance);
      // Beyond 9 the weight is below a hundredth; a point at infinity has NaN there and is left out, too.
      cost += distance < 9 ? w * distance * share : 0.9 * w;
      if (!(distance < 9)) continue;
      const double weight = w * share * share * inverse_z * inverse_z / scale;
      const Eigen::Matrix<double, 9, 1> products{x * x, x * y, x, x * y, y * y, y, x, y, 1};
      moments += products * Eigen::Matrix<double, 1, 4>(weight, weight * u, weight * v, weight * (u * u + v * v));
    }
    const auto block = [&](int k) { return moments.col(k).reshaped(3, 3); };
    Eigen::Matrix<double, 9, 9> A = Eigen::Matrix<double, 9, 9>::Zero();
    A.block<3, 3>(0, 0) = A.block<3, 3>(3, 3) = block(0);
    A.block<3, 3>(0, 6) = A.block<3, 3>(6, 0) = -block(1);
    A.block<3, 3>(3, 6) = A.block<3, 3>(6, 3) = -block(2);
    A.block<3, 3>(6, 6) = block(3);
    out.H = A.topLeftCorner<8, 8>();
    out.g = A.topRows<8>().lazyProduct(H.reshaped<Eigen::RowMajor>());
    return cost;
  }
  [[nodiscard]] Matrix3<double> moved(Matrix3<double> H, const Eigen::Matrix<double, 8, 1>& step) const noexcept {
    for (int k = 0; k < 8; ++k) H(k / 3, k % 3) += step[k];
    return H;
  }
};

// The cost never rises.
template <typename T>
void refine_homography(const PairColumns<T>& pairs, double scale, int max_steps, Matrix3<double>& H) noexcept {
  const Matrix3<double> start = H / H(2, 2);
  if (!start.allFinite()) return;
  H = start;
  refine<8>(TransferModel<T>{pairs, scale}, max_steps, 1e-3, H);
}

// The rotation that fits the rays of the pairs best for which `holds(i)`, as a homography of pixels. K: intrinsics.
// Kabsch.
template <typename T, typename Holds>
[[nodiscard]] Matrix3<T> fitted_rotation(const PairArrays& pairs, const Matrix3<T>& K, const Holds& holds) noexcept {
  const Matrix3<T> to_pixels[2] = {unscaling_matrix<T>(pairs.scaling.previous),
                                   unscaling_matrix<T>(pairs.scaling.current)};
  const Matrix3<T> K_inverse = inverse(K);
  Matrix3<T> M = Matrix3<T>::Zero();
  for (std::size_t i = 0; i < pairs.size; ++i) {
    if (!holds(i)) continue;
    const Vector3<T> p = K_inverse * (to_pixels[0] * previous_point<T>(pairs, i)),
                     q = K_inverse * (to_pixels[1] * current_point<T>(pairs, i));
    M += pairs.row(score_weight)[i] * q.normalized() * p.normalized().transpose();
  }
  const SVD3<T> m = svd(M);
  return K * (m.U * m.V.transpose()) * K_inverse;
}

// Of the lines through two points of 16 draws the one that weighs most; zero where none weighs anything.
template <typename T, typename Draw, typename WeightOf>
[[nodiscard]] Vector3<T> heaviest_line(const Draw& draw, const WeightOf& weight_of) noexcept {
  T most = 0;
  Vector3<T> best = Vector3<T>::Zero();
  for (int trial = 0; trial < 16; ++trial) {
    const Vector3<T> a = draw(), across = cross(a, draw()), line = across / across.template head<2>().norm();
    const T weight = weight_of(line);
    if (weight > most) most = weight, best = line;
  }
  return best;
}

// Whether the inliers listed, but for a few, lie on one line of the previous image, which does not determine the
// homography of a plane: two pairs beside the line give one without further support.
[[nodiscard]] inline bool lie_on_a_line(const PairArrays& pairs, const std::vector<std::uint32_t>& inliers,
                                        double width) noexcept {
  if (inliers.empty()) return false;
  Random random(pairs.size, "lie_on_a_line");
  const auto on = [&](const Vector3<double>& line) {
    const auto is_near = [&](std::uint32_t i) { return std::abs(line.dot(previous_point<double>(pairs, i))) <= width; };
    return static_cast<double>(std::count_if(inliers.begin(), inliers.end(), is_near));
  };
  const auto draw = [&] {
    return previous_point<double>(pairs, inliers[random.index(static_cast<std::uint32_t>(inliers.size()))]);
  };
  const double most = on(heaviest_line<double>(draw, on)), off = static_cast<double>(inliers.size()) - most;
  return off <= 4 + most / 20 && most >= 2 * off;
}

// Whether H, which has so many parameters more than `other`, explains the pairs that it holds within the squared
// distance better by no more than these let it: an F test, as the best homography of few pairs follows their noise.
template <typename T>
[[nodiscard]] bool explains_as_well(const PairArrays& pairs, const Matrix3<T>& other, const Matrix3<T>& H, int more,
                                    T limit) noexcept {
  T by_other = 0, by_H = 0, held = 0;
  for (std::size_t i = 0; i < pairs.size; ++i) {
    const T distance_sq = transfer_sq(pairs, H, i);
    if (!(distance_sq <= limit)) continue;
    by_other += transfer_sq(pairs, other, i), by_H += distance_sq, held += 1;
  }
  const T freedom = 2 * held - 8;
  return freedom > 0 && (by_other - by_H) * freedom <= T(6) * static_cast<T>(more) * by_H;
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
