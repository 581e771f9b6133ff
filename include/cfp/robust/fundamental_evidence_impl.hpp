/// @file fundamental_evidence_impl.hpp
/// What the pairs of fundamental_ransac.hpp say for an F against a homography. Not an interface.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "cfp/math/matrix3.hpp"
#include "cfp/robust/fundamental_search_impl.hpp"
#include "cfp/robust/homography_impl.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

// Without parallax the distances of the pairs from H have no preferred direction, be they noise or mismatches; F says
// that they point along its lines. With the distance d from H, a from the line and a scale s the density of the
// direction is (1 + d^2/s^2)^(3/2) / (1 + d^2/2s^2) / (1 + a^2/s^2)^2 of the uniform one. Whatever s, a pair that does
// not know F expects the ratio 1, and so 1 + share (ratio - 1), where only a share of the pairs obeys F. The product
// over all pairs then exceeds e^t with a probability of at most e^-t, and so does the mean of such products for several
// shares: its logarithm is the evidence. Mismatches lie far from H, parallax mostly near it: the share is another one
// in every range of d. T is double.
template <typename T>
struct FundamentalEvidence {
  static constexpr std::size_t strips = 16, person = 5;  // over the extent of the pairs; the width of a person in them
  static constexpr std::size_t ranges = 6, shares = 5;   // of d, doubling
  static constexpr T share[shares] = {T(0), T(0.1), T(0.3), T(0.6), T(0.9)};

  const FundamentalSearch<T>& search;
  std::vector<T>& gains;   // weight times (ratio - 1), and then the range of every pair
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
  [[nodiscard]] std::size_t range_of(std::size_t i) const noexcept {
    return static_cast<std::size_t>(gains[i + pairs.capacity]);
  }

  template <typename Visit>
  void for_each(Visit&& visit) const noexcept {
    for (std::size_t i = 0; i < pairs.size; i += stride) visit(i);
  }

  // Whether more pairs lie near their lines than the pairs up to three times as far let chance put there: the binomial
  // tail of that has to outdo the number of seven-point samples, C(n, 7), as the best of all their F fits some
  // mismatches, too. Source: Moisan and Stival, "A probabilistic criterion to detect rigid point matches between two
  // images and estimate the fundamental matrix", IJCV 2004.
  [[nodiscard]] bool stands_out() const noexcept {
    const T limit = search.wide_limit();
    T near = 0, all = 0, n = 0;
    for (std::size_t i = 0; i < pairs.size; ++i) {
      n += pairs.row(5)[i];
      near += search.distances_sq[i] <= limit ? pairs.row(5)[i] : T(0);
      all += search.distances_sq[i] <= 9 * limit ? pairs.row(5)[i] : T(0);
    }
    const auto nats = [&](T part, T chance) { return part > 0 ? part * std::log(part / (chance * all)) : T(0); };
    return 3 * near > all && nats(near, T(1) / 3) + nats(all - near, T(2) / 3) > 7 * std::log((n - 3) / T(3.38));
  }

  // The gains of the F whose distances were measured last. Returns how many distinct pairs F explains.
  T compare(const Matrix3<T>& H) noexcept {
    const T variance = 2 * search.noise_variance + T(1e-4) * pairs.factor * pairs.factor, s2 = 2 * variance;
    const T limit = search.wide_limit();
    T distinct = 0;
    for_each([&](std::size_t i) {
      const T d2 = (std::min)(transfer_sq(pairs, H, i), T(100)) / s2, a2 = 1 + 2 * search.distances_sq[i] / s2;
      const T ratio = (1 + d2) * std::sqrt(1 + d2) / ((1 + d2 / 2) * a2 * a2);
      std::size_t range = 0;
      for (T edge = 6; range + 1 < ranges && d2 > edge; edge *= 4) ++range;
      gains[i] = pairs.row(5)[i] * (ratio >= 0 ? ratio - 1 : T(-1));
      gains[i + pairs.capacity] = static_cast<T>(range);
      if (search.distances_sq[i] <= limit) distinct += pairs.row(5)[i] / pairs.weights()[i];
    });
    return distinct * static_cast<T>(stride);
  }

  [[nodiscard]] Verdict judge() const noexcept {
    T sums[ranges][shares] = {}, products[ranges][shares];
    for (auto& row : products) std::fill(row, row + shares, T(1));
    for_each([&](std::size_t i) {
      const std::size_t range = range_of(i);
      for (std::size_t k = 1; k < shares; ++k) {
        T& product = products[range][k];
        product *= 1 + share[k] * gains[i];
        if (product > T(1e-100) && product < T(1e100)) continue;
        sums[range][k] += std::log(product);
        product = 1;
      }
    });
    T all = 0, best[ranges];
    for (std::size_t range = 0; range < ranges; ++range) {
      T* const sum = sums[range];
      for (std::size_t k = 1; k < shares; ++k) sum[k] += std::log(products[range][k]);
      const T* const most = std::max_element(sum, sum + shares);
      best[range] = share[most - sum];
      T mean = 0;
      for (std::size_t k = 0; k < shares; ++k) mean += std::exp(sum[k] - *most) / shares;
      all += *most + std::log(mean);
    }
    std::array<T, strips> nats{};
    for_each([&](std::size_t i) { nats[strip_of(pairs, i)] += std::log(1 + best[range_of(i)] * gains[i]); });
    Verdict out{all, all, 0};
    for (std::size_t first = 0; first + person <= strips; ++first) {
      T rest = all;
      for (std::size_t k = first; k < first + person; ++k) rest -= nats[k];
      if (rest < out.outside) out.outside = rest, out.window = first;
    }
    return out;
  }

  // Whether there is no evidence but that of two lines of points, which leave F undetermined. Takes it away.
  [[nodiscard]] bool rests_on_lines(T factor) noexcept {
    drop_line();
    drop_line();
    return !(judge().all > 5 * factor);
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
      for_each([&](std::size_t i) { sum += holds(line, i) ? (std::min)((std::max)(gains[i], T(0)), T(1)) : T(0); });
      if (sum > most) most = sum, best = line;
    }
    for_each([&](std::size_t i) {
      if (holds(best, i)) gains[i] = 0;
    });
  }
};

}  // namespace CFP_ISA
}  // namespace cfp::detail
