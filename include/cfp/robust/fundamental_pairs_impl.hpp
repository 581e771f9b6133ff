/// @file fundamental_pairs_impl.hpp
/// Pairs of fundamental_ransac.hpp as structure of arrays, and what is computed of all of them at once under an F: MSAC
/// score and distances. Not an interface.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "cfp/core/span.hpp"
#include "cfp/geometry/fundamental_impl.hpp"
#include "cfp/math/so3.hpp"
#include "cfp/simd/packet.hpp"

namespace cfp::detail {

// The arrays of all pairs in one precision.
template <typename T>
struct PairColumns {
  const T *px, *py, *qx, *qy, *weight;
  std::size_t size;
};

// The pairs present, centred per image and scaled by one common factor, so that distances are pixels times `factor`.
// Arrays are padded with weight 0 to whole packets.
struct PairArrays {
  static constexpr std::size_t padding = 64;
  static constexpr std::size_t coordinates = 5;  // previous x, y, current x, y, weight
  static constexpr std::size_t enough = 256;     // pairs, for a candidate

  std::size_t size = 0, capacity = 0;
  double total_weight = 0, factor = 0;
  PixelScaling scale_prev, scale_cur;
  std::vector<std::uint32_t> index;  // position in the caller's arrays
  std::vector<double> exact;         // `coordinates` arrays of `capacity`
  std::vector<float> fast;           // the same rounded, for scoring
  std::vector<float> thinned;        // evenly chosen ones of them, enough to refine a candidate

  [[nodiscard]] const double* array(std::size_t c) const noexcept { return exact.data() + c * capacity; }
  [[nodiscard]] span<const double> weights() const noexcept { return {array(4), size}; }
  [[nodiscard]] PairColumns<double> exact_columns() const noexcept { return columns(exact.data(), capacity, size); }
  [[nodiscard]] PairColumns<float> fast_columns() const noexcept { return columns(fast.data(), capacity, size); }
  [[nodiscard]] PairColumns<float> thinned_columns() const noexcept {
    return size > enough ? columns(thinned.data(), enough, enough) : fast_columns();
  }

  // When the points of an image coincide, only `size` is set and `factor` is 0.
  template <typename Scalar>
  void load(const PointSpan<Scalar, 2>& prev, const PointSpan<Scalar, 2>& cur, const span<const Scalar>& weight) {
    size = scale_pixels(prev, cur, weight, scale_prev, scale_cur);
    total_weight = 0;
    capacity = (prev.size() + padding - 1) / padding * padding;
    index.resize(prev.size());
    exact.resize(coordinates * capacity);
    fast.resize(coordinates * capacity);
    factor = 0;
    if (size == 0 || !scale_prev.valid() || !scale_cur.valid()) return;
    size = 0;
    factor = std::sqrt(scale_prev.factor * scale_cur.factor);
    scale_prev.factor = scale_cur.factor = factor;
    double* out[coordinates];
    for (std::size_t c = 0; c < coordinates; ++c) out[c] = exact.data() + c * capacity;
    for (std::size_t i = 0; i < prev.size(); ++i) {
      const double w = pair_weight(prev, cur, weight, i) / scale_prev.largest_weight;
      if (!(w > 0)) continue;
      const Vector3<double> p = scale_prev(prev(i, 0), prev(i, 1)), q = scale_cur(cur(i, 0), cur(i, 1));
      out[0][size] = p.x(), out[1][size] = p.y(), out[2][size] = q.x(), out[3][size] = q.y(), out[4][size] = w;
      index[size++] = static_cast<std::uint32_t>(i);
      total_weight += w;
    }
    for (std::size_t c = 0; c < coordinates; ++c) std::fill(out[c] + size, out[c] + capacity, 0.0);
    std::transform(exact.begin(), exact.end(), fast.begin(), [](double x) { return static_cast<float>(x); });
    thinned.resize(coordinates * enough);
    for (std::size_t i = 0; i < enough && size > enough; ++i) {
      for (std::size_t c = 0; c < coordinates; ++c) thinned[c * enough + i] = fast[c * capacity + i * size / enough];
    }
  }

  [[nodiscard]] Matrix3<double> to_pixels(const Matrix3<double>& F) const noexcept {
    return unscaled(F, scale_prev, scale_cur);
  }

 private:
  template <typename T>
  [[nodiscard]] static PairColumns<T> columns(const T* first, std::size_t length, std::size_t size) noexcept {
    return {first, first + length, first + 2 * length, first + 3 * length, first + 4 * length, size};
  }
};

// Of a packet of pairs: the directions l = F p and m = F^T q of the epipolar lines, e = q^T F p and n^2; the Sampson
// distance is e / n.
template <typename T>
struct SampsonPacket {
  using P = Packet<T>;
  P p0, p1, q0, q1, l0, l1, m0, m1, e, n2;

  SampsonPacket(const PairColumns<T>& in, std::size_t i, const Matrix3<T>& F) noexcept
      : p0(cfp::load<P>(in.px + i)),
        p1(cfp::load<P>(in.py + i)),
        q0(cfp::load<P>(in.qx + i)),
        q1(cfp::load<P>(in.qy + i)) {
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

// Sum over the pairs of w min(d^2 / limit, 1), d the Sampson distance of scaled pixels and limit its squared threshold.
// Gives up with a value above `bound` as soon as the sum exceeds it.
[[nodiscard]] inline double msac_cost(const PairColumns<float>& in, const Matrix3<double>& F, double limit,
                                      double bound) noexcept {
  using P = Packet<float>;
  const Matrix3<float> f = F.cast<float>();
  const P most(static_cast<float>(limit)), tiny(1e-30F);
  const double stop = bound * limit;
  double sum = 0;
  for (std::size_t block = 0; block < in.size; block += PairArrays::padding) {
    P cost(0.0F);
    for (std::size_t i = block; i < block + PairArrays::padding; i += static_cast<std::size_t>(lanes_of<P>)) {
      const SampsonPacket<float> pair(in, i, f);
      const P d2 = pair.e * pair.e / (pair.n2 + tiny);
      cost = multiply_add(cfp::load<P>(in.weight + i), select(d2 < most, d2, most), cost);
    }
    sum += static_cast<double>(reduce_add(cost));
    if (!(sum < stop)) break;
  }
  return sum / limit;
}

// Squared Sampson distances of all pairs, scaled pixels; NaN where there is none, so that no comparison takes such a
// pair for an inlier.
inline void sampson_distances_sq(const PairArrays& pairs, const Matrix3<double>& F, std::vector<double>& out) {
  using P = Packet<double>;
  out.resize(pairs.capacity);
  const PairColumns<double> in = pairs.exact_columns();
  for (std::size_t i = 0; i < pairs.size; i += static_cast<std::size_t>(lanes_of<P>)) {
    const SampsonPacket<double> pair(in, i, F);
    store(out.data() + i, pair.e * pair.e / pair.n2);
  }
}

// The epipole of the current image, F^T e = 0, unnormalised: F's columns span the plane across it.
[[nodiscard]] inline Vector3<double> epipole_of(const Matrix3<double>& F) noexcept {
  Vector3<double> epipole = F.col(0).cross(F.col(1));
  for (int c = 0; c < 2; ++c) {
    const Vector3<double> other = F.col(c).cross(F.col(2));
    if (other.squaredNorm() > epipole.squaredNorm()) epipole = other;
  }
  return epipole;
}

// Both points of every pair of a sample must lie on the same side of the cameras: Chum, Werner, Matas: "Epipolar
// geometry estimation via RANSAC benefits from the oriented epipolar constraint", ICPR 2004.
[[nodiscard]] inline bool is_oriented(const Matrix3<double>& F, const double (&p)[7][2],
                                      const double (&q)[7][2]) noexcept {
  const Vector3<double> epipole = epipole_of(F);
  int positive = 0;
  for (int i = 0; i < 7; ++i) {
    const Vector3<double> line = F * Vector3<double>(p[i][0], p[i][1], 1);
    positive += epipole.cross(Vector3<double>(q[i][0], q[i][1], 1)).dot(line) > 0 ? 1 : 0;
  }
  return positive == 0 || positive == 7;
}

}  // namespace cfp::detail
