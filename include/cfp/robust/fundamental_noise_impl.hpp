/// @file fundamental_noise_impl.hpp
/// The noise of the pairs of fundamental_ransac.hpp under an F, the significance of their support, and the covariance
/// of F. Not an interface.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "cfp/core/span.hpp"
#include "cfp/geometry/epipolar.hpp"
#include "cfp/geometry/point_pairs.hpp"
#include "cfp/math/normal_equations.hpp"
#include "cfp/robust/fundamental_pairs_impl.hpp"
#include "cfp/robust/fundamental_sampson_impl.hpp"
#include "cfp/simd/packet.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

// Scaled pixels.
template <typename T>
struct PairNoise {
  T variance;    // of the Sampson distances of true pairs
  T near_pairs;  // by weight, within 2.5 standard deviations of it
};

// Minus the logarithm of the number of F that chance lets have so many of the pairs so near: weighs few pairs and
// little noise against many and more. A mismatch lies anywhere within some tenth of the image. C(n, k) by its entropy,
// C(k, 7) as (k - 3)^7 / 7!, of which 3.38 is the seventh root. Source: Moisan and Stival, "A probabilistic criterion
// to detect rigid point matches between two images and estimate the fundamental matrix", IJCV 2004.
template <typename T>
[[nodiscard]] T nats(const PairArrays& pairs, const PairNoise<T>& noise) noexcept {
  const T n = static_cast<T>(pairs.size), k = noise.near_pairs, reach = T(0.25);
  if (!(k > 7)) return -std::numeric_limits<T>::infinity();
  const T subsets = k * std::log(n / k) + (n > k ? (n - k) * std::log(n / (n - k)) : T(0));
  return (k - 7) * std::log(reach / (T(2.5) * std::sqrt(noise.variance))) - subsets - 7 * std::log((k - 3) / T(3.38));
}

// A truncated variance of the squared distances, iterated from `start` to its fixed point; 0.911 is the variance that a
// normal distribution keeps within 2.5 sigma. At least 0.01 px. The distances are as long as the arrays.
template <typename T>
[[nodiscard]] PairNoise<T> settled_noise(const PairArrays& pairs, span<const T> distances_sq, T start, T cut) noexcept {
  using P = simd::Packet<T>;
  const P zero(T(0));
  const T floor = T(1e-4) * pairs.factor * pairs.factor;
  PairNoise<T> noise{start, 0};
  for (int step = 0; step < 10; ++step) {
    const P farthest((std::min)(cut, T(6.25) * noise.variance));
    P sum = zero, weight = zero;
    for (std::size_t i = 0; i < pairs.size; i += P::lanes) {
      const P d2 = P::load(distances_sq.data() + i), w = P::load(pairs.row(score_weight) + i);
      const auto near = d2 <= farthest;
      sum += select(near, w * d2, zero);
      weight += select(near, w, zero);
    }
    const T near = reduce_add(weight);
    noise.near_pairs = near / pairs.total_shared * static_cast<T>(pairs.size);
    if (!(near > 0)) break;
    const T freedom = noise.near_pairs / (std::max)(noise.near_pairs - 7, T(1));  // F follows seven of their distances
    const T next = (std::max)(freedom * reduce_add(sum) / near / T(0.911), floor);
    const bool settled = std::abs(next - noise.variance) < T(5e-3) * next;
    noise.variance = next;
    if (settled) break;
  }
  return noise;
}

// The noise that the squared distances from an F show under a squared threshold. Where it comes near to what the cut
// leaves of any distribution it exceeds the threshold, and a wider cut tells by how much. Somebody who leaves the lines
// by less than the threshold seems to be noise: the lesser noise of the other pairs counts where chance explains these
// less. The refinement needs it for its loss, and whether a homography suffices must not be judged by a threshold above
// the parallax of a video.
template <typename T>
[[nodiscard]] PairNoise<T> measured_noise(const PairArrays& pairs, span<const T> distances_sq, T limit) noexcept {
  T cut = limit;
  PairNoise<T> noise{};
  for (int width = 0; width < 3; ++width, cut *= 4) {
    noise = settled_noise(pairs, distances_sq, cut / T(3.84), cut);
    if (noise.variance < T(0.22) * cut) break;
  }
  if (cut > limit) return noise;
  const PairNoise<T> lesser = settled_noise(pairs, distances_sq, noise.variance / 16, cut);
  return nats(pairs, lesser) > nats(pairs, noise) ? lesser : noise;
}

// By how much a covariance by the weighted sum of squares is too large, in the mean, where weights are no information,
// the inverse variances of the pairs: sum of w^2 s^4 d^2 over that of w s^4 d^2, s the root of the loss's weight at d.
[[nodiscard]] inline double weight_in_covariance(const PairArrays& pairs, span<const double> distances_sq,
                                                 double scale) noexcept {
  double with_squares = 0, with_weights = 0;
  for (std::size_t i = 0; i < pairs.size; ++i) {
    const double w = pairs.row(score_weight)[i], root = scale / (scale + distances_sq[i]), share = root * root;
    if (!is_finite(distances_sq[i])) continue;
    with_weights += w * share * share * distances_sq[i];
    with_squares += w * w * share * share * distances_sq[i];
  }
  return with_weights > 0 ? with_squares / with_weights : 1;
}

// The covariance of F in pixels, of unit norm: F, of scaled pixels, was fitted to pairs of this variance under a loss
// of this many variances. Zero if they do not determine it.
template <typename T>
[[nodiscard]] FundamentalCovariance covariance_in_pixels(const PairArrays& pairs, const Matrix3<T>& F, T variance,
                                                         T loss) noexcept {
  const FactoredF<T> factored(F);
  NormalEquations<7> sums;
  Eigen::Matrix<double, 7, 7> inverse;
  SampsonModel<T>{exact_columns(pairs), loss * variance}.linearize(factored, sums);
  sums.H *= loss;
  if (!invert_normal_equations<7>(sums.H, 1e-14, inverse)) return FundamentalCovariance::Zero();
  const Matrix3<double> previous = scaling_matrix(pairs.scaling.previous),
                        current = scaling_matrix(pairs.scaling.current).transpose();
  const double norm = (current * factored.matrix() * previous).norm();
  Eigen::Matrix<double, 9, 7> B = factored.tangents();
  for (int k = 0; k < 7; ++k) {
    const Matrix3<double> tangent = B.col(k).reshaped<Eigen::RowMajor>(3, 3), pixels = current * tangent * previous;
    B.col(k) = pixels.reshaped<Eigen::RowMajor>() / norm;
  }
  const Eigen::Matrix<double, 9, 7> BC = B.lazyProduct(inverse);
  return BC.lazyProduct(B.transpose());
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
