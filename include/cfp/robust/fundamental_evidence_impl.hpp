/// @file fundamental_evidence_impl.hpp
/// What the pairs of fundamental_ransac.hpp say for an F against a homography. Not an interface.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "cfp/math/matrix3.hpp"
#include "cfp/robust/fundamental_search_impl.hpp"
#include "cfp/robust/homography_impl.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

// Without parallax the distances of the pairs from H have no preferred direction, be they noise or mismatches; F says
// that they point along its lines. With the distance d from H, a from the line and a scale s the density of the
// direction is sqrt(1 + d^2/s^2) / (1 + a^2/s^2) of the uniform one (a wrapped Cauchy distribution). Whatever s, a pair
// that does not know F expects the ratio 1, and so 1 + share (ratio - 1), where only a share of the pairs obeys F. The
// product over all pairs then exceeds e^t with a probability of at most e^-t: its logarithm is the evidence. T is
// double.
template <typename T>
struct FundamentalEvidence {
  static constexpr std::size_t strips = 16, person = 5;  // over the extent of the pairs; the width of a person in them

  const FundamentalSearch<T>& search;
  std::vector<T>& gains;   // weight times (ratio - 1): of the pairs far from H, then of those near it, else 0
  std::size_t stride = 1;  // every so manieth pair is looked at
  const PairArrays& pairs = search.pairs;

  struct Verdict {
    T all, outside;      // evidence of all pairs, and least of those outside a window that may hold a moving person
    std::size_t window;  // first strip of that window
  };

  [[nodiscard]] static std::size_t strip_of(const PairArrays& pairs, std::size_t i) noexcept {
    return static_cast<std::size_t>((std::min)((std::max)((pairs.row(0)[i] + 2.5) / 5, 0.0), 0.999) * strips);
  }
  [[nodiscard]] static bool in_window(const PairArrays& pairs, std::size_t i, std::size_t window) noexcept {
    return strip_of(pairs, i) - window < person;
  }

  template <typename Visit>
  void for_each(Visit&& visit) const noexcept {
    for (std::size_t i = 0; i < pairs.size; i += stride) visit(i);
  }

  // The gains of the F whose distances were measured last. s^2 is twice the variance of a where d is noise, and falls
  // to 0.4 times it where d is parallax. Returns how many distinct pairs F explains.
  T compare(const Matrix3<T>& H) noexcept {
    const T variance = 2 * search.noise_variance + T(1e-4) * pairs.factor * pairs.factor;
    const T limit = (std::max)(search.limit, search.noise_limit());
    T distinct = 0;
    for_each([&](std::size_t i) {
      const T d2 = (std::min)(transfer_sq(pairs, H, i), T(100)), a2 = 2 * search.distances_sq[i];
      const T s2 = variance * (2 - T(1.6) * d2 / (d2 + 8 * variance)), ratio = std::sqrt(1 + d2 / s2) / (1 + a2 / s2);
      const bool near = d2 < 12 * variance;
      gains[i + (near ? 0 : pairs.capacity)] = 0;
      gains[i + (near ? pairs.capacity : 0)] = pairs.row(5)[i] * (ratio >= 0 ? ratio - 1 : T(-1));
      if (search.distances_sq[i] <= limit) distinct += pairs.row(5)[i] / pairs.weights()[i];
    });
    return distinct * static_cast<T>(stride);
  }

  // Near H there are hardly any mismatches.
  [[nodiscard]] T factor(std::size_t i, T share) const noexcept {
    return (1 + share * gains[i]) * (1 + T(0.9) * gains[i + pairs.capacity]);
  }

  [[nodiscard]] Verdict judge() const noexcept {
    T best = 0, all = -std::numeric_limits<T>::infinity();
    for (const T share : {T(0.1), T(0.3), T(0.6), T(0.9)}) {
      T sum = 0, product = 1;
      for_each([&](std::size_t i) {
        product *= factor(i, share);
        if (product > T(1e-100) && product < T(1e100)) return;
        sum += std::log(product);
        product = 1;
      });
      sum += std::log(product);
      if (sum > all) all = sum, best = share;
    }
    std::array<T, strips> nats{};
    for_each([&](std::size_t i) { nats[strip_of(pairs, i)] += std::log(factor(i, best)); });
    Verdict out{all, all, 0};
    for (std::size_t first = 0; first + person <= strips; ++first) {
      T rest = all;
      for (std::size_t k = first; k < first + person; ++k) rest -= nats[k];
      if (rest < out.outside) out.outside = rest, out.window = first;
    }
    return out;
  }

  // Takes away the pairs near the line of the previous image that carries most of the gains.
  void drop_line() noexcept {
    const T width_sq = 64 * (std::max)(search.noise_variance, search.limit / T(3.84));
    const auto holds = [&](const Vector3<T>& line, std::size_t i) {
      const T e = line[0] * pairs.row(0)[i] + line[1] * pairs.row(1)[i] + line[2];
      return e * e <= width_sq;
    };
    Random random(pairs.size, "fundamental_evidence");
    const auto point = [&] {
      const std::size_t n = (pairs.size - 1) / stride + 1;
      return previous_point<T>(pairs, random.index(static_cast<std::uint32_t>(n)) * stride);
    };
    T most = 0;
    Vector3<T> best = Vector3<T>::Zero();
    for (int k = 0; k < 16; ++k) {
      const Vector3<T> a = point(), across = cross(a, point()), line = across / across.template head<2>().norm();
      T sum = 0;
      for_each([&](std::size_t i) {
        const T gain = gains[i] + gains[i + pairs.capacity];
        sum += holds(line, i) ? (std::min)((std::max)(gain, T(0)), T(1)) : T(0);
      });
      if (sum > most) most = sum, best = line;
    }
    for_each([&](std::size_t i) {
      if (holds(best, i)) gains[i] = gains[i + pairs.capacity] = 0;
    });
  }
};

}  // namespace CFP_ISA
}  // namespace cfp::detail
