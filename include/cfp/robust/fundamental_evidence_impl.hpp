/// @file fundamental_evidence_impl.hpp
/// The evidence of the pairs of fundamental_ransac.hpp for an F against a homography. Not an interface.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "cfp/math/matrix3.hpp"
#include "cfp/robust/fundamental_search_impl.hpp"
#include "cfp/robust/homography_impl.hpp"
#include "cfp/simd/packet.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

// Tests F against H by the directions in which the pairs lie from H, in units of the noise (which H of a plane ahead
// stretches along the lines). Without parallax no direction is preferred, be it noise or mismatches; F says that they
// point along its lines. With the distance d from H, a from the line and a scale s, the density of the direction over
// the uniform one is
//
//   ratio = (1 + d^2/s^2)^(3/2) / (1 + d^2/2s^2) / (1 + a^2/s^2)^2.
//
// Whatever s, a pair that does not know F expects the ratio 1, and so 1 + share (ratio - 1), where only a share of the
// pairs obeys F. By Markov's inequality the product over all pairs then exceeds e^t with a probability of at most e^-t.
// So does the mean of such products for several shares: its logarithm is the evidence. Mismatches lie far from H,
// parallax mostly near it: each range of d has a share of its own. Of n pairs that share their weight each has the n-th
// root of its ratio: together they have the evidence of one. T is double.
template <typename T>
struct FundamentalEvidence {
  static constexpr std::size_t cells = PairArrays::window_cells;
  static constexpr std::size_t ranges = 6, shares = 5;  // of d, doubling
  static constexpr T share[shares] = {T(0), T(0.1), T(0.3), T(0.6), T(0.9)};

  const FundamentalSearch<T>& search;
  std::vector<T>& scratch;  // of four times the arrays' capacity
  std::size_t stride = 1;   // every so manieth pair is looked at
  const PairArrays& pairs = search.pairs;
  // Of the pairs looked at: the previous point, weight times (ratio - 1), and the range.
  T* const x = scratch.data();
  T* const y = x + pairs.capacity;
  T* const gain = y + pairs.capacity;
  T* const range = gain + pairs.capacity;
  std::size_t count = 0;

  // Cells of the previous image in which something may move, and the evidence of the pairs beside them.
  struct Window {
    T evidence;
    std::size_t column, row, width, height;

    [[nodiscard]] bool contains(std::size_t c, std::size_t r) const noexcept {
      return c - column < width && r - row < height;
    }
  };

  struct Verdict {
    T all;                 // evidence of all pairs
    Window person, broad;  // least of evidence beside a person, and beside somebody close or several side by side
  };

  // The logarithm of a product, taken before it leaves the range of numbers.
  struct LogProduct {
    T log = 0, rest = 1;

    void multiply(T factor) noexcept {
      rest *= factor;
      if (rest > T(1e-100) && rest < T(1e100)) return;
      log += std::log(rest);
      rest = 1;
    }
    [[nodiscard]] T value() const noexcept { return log + std::log(rest); }
  };

  [[nodiscard]] std::size_t range_of(std::size_t k) const noexcept { return static_cast<std::size_t>(range[k]); }

  // Of the F whose distances were measured last against H. Some F = [e']x H goes through any two pairs, the loudest if
  // these are mismatches, and through one of them beside a person: so many say nothing for it. epipole: of the current
  // image where H is that of the plane at infinity, beside which all that is seen moves towards one side; what moves
  // the other way, as one of two people who cross does, says nothing. Null otherwise.
  [[nodiscard]] Verdict judge(const Matrix3<T>& H, const Vector3<T>* epipole = nullptr) noexcept {
    compare(H);
    if (epipole != nullptr) keep_one_side(H, *epipole);
    T best[ranges];
    leave_out_loudest();
    const T all = nats(best);
    Verdict out = {all, {all, 0, 0, 0, 0}, {all, 0, 0, 0, 0}};
    find_windows(best, out);
    leave_out_loudest();
    out.all = nats(best);
    return out;
  }

  // Whether there is no evidence but that of two lines of points, which leave F undetermined. Takes it away.
  [[nodiscard]] bool rests_on_lines(T factor) noexcept {
    drop_line();
    drop_line();
    T best[ranges];
    return !(nats(best) > 5 * factor);
  }

 private:
  // Fills the arrays.
  void compare(const Matrix3<T>& H) noexcept {
    // Rounded to a grid, neighbours err alike, by up to its pitch: what is smaller tells nothing.
    const T noise = (std::max)(search.noise.variance, T(pairs.grid_sq));
    const T per_s2 = 1 / (4 * noise + T(2e-4) * pairs.factor * pairs.factor);
    count = 0;
    for (std::size_t i = 0; i < pairs.size; i += stride, ++count) {
      const T d2 = (std::min)(whitened_transfer_sq(pairs, H, i), T(100)) * per_s2;
      const T a2 = 1 + 2 * search.distances_sq[i] * per_s2;
      const T ratio = (1 + d2) * std::sqrt(1 + d2) / ((1 + d2 / 2) * a2 * a2);
      x[count] = pairs.row(prev_x)[i], y[count] = pairs.row(prev_y)[i];
      const T w = pairs.weights()[i], told = distinct_share(pairs, i);
      gain[count] = w * (ratio >= 0 ? (told < 1 ? std::pow(ratio, told) : ratio) - 1 : T(-1));
      range[count] = 0;
      T edge = 6;
      for (std::size_t r = 1; r < ranges; ++r, edge *= 4) range[count] += d2 > edge ? T(1) : T(0);
    }
    std::fill(gain + count, gain + (count + pairs.block - 1) / pairs.block * pairs.block, T(0));
  }

  // The windows without which the pairs say least, each pair with the share of its range.
  void find_windows(const T (&share_of_range)[ranges], Verdict& out) const noexcept {
    LogProduct products[cells][cells];
    for (std::size_t k = 0; k < count; ++k) {
      LogProduct& cell = products[window_cell(pairs, 1, y[k])][window_cell(pairs, 0, x[k])];
      cell.multiply(1 + share_of_range[range_of(k)] * gain[k]);
    }
    T sums[cells + 1][cells + 1] = {};  // of all cells above and to the left
    for (std::size_t r = 0; r < cells; ++r) {
      for (std::size_t c = 0; c < cells; ++c)
        sums[r + 1][c + 1] = products[r][c].value() + sums[r][c + 1] + sums[r + 1][c] - sums[r][c];
    }
    const auto find_least = [&](std::size_t width, std::size_t height, Window& least) {
      for (std::size_t r = 0; r + height <= cells; ++r) {
        for (std::size_t c = 0; c + width <= cells; ++c) {
          const T inside = sums[r + height][c + width] - sums[r][c + width] - sums[r + height][c] + sums[r][c];
          if (out.all - inside < least.evidence) least = {out.all - inside, c, r, width, height};
        }
      }
    };
    find_least(PairArrays::person_cells, cells, out.person);
    find_least(10, 6, out.broad);
    // One of the many broad windows holds most of little evidence by chance.
    out.broad.evidence += (std::max)(T(16) - out.all / 5, T(0));
  }

  // q ~ H p + k e, and k has one sign for all that is in front of both cameras: takes away what is far on the other
  // side. Not what is near: a rotation that was fitted takes the mean parallax with it.
  void keep_one_side(const Matrix3<T>& H, const Vector3<T>& e) noexcept {
    T sides[2] = {};
    const auto side = [&](std::size_t k) {
      const Vector3<T> p = H * previous_point<T>(pairs, k * stride);
      return cross(current_point<T>(pairs, k * stride), p).dot(cross(e, p)) > 0;
    };
    for (std::size_t k = 0; k < count; ++k) sides[side(k)] += std::clamp(gain[k], T(0), T(1));
    const bool lesser = sides[1] < sides[0];
    for (std::size_t k = 0; k < count; ++k) {
      if (range[k] > 1 && side(k) == lesser) gain[k] = (std::min)(gain[k], T(0));
    }
  }

  void leave_out_loudest() noexcept {
    T* const most = std::max_element(gain, gain + count);
    *most = (std::min)(*most, T(0));
  }

  // The evidence, and the share in each range that it speaks for.
  T nats(T (&best)[ranges]) const noexcept {
    LogProduct products[ranges][shares];
    for (std::size_t k = 0; k < count; ++k) {
      for (std::size_t s = 1; s < shares; ++s) products[range_of(k)][s].multiply(1 + share[s] * gain[k]);
    }
    T all = 0;
    for (std::size_t r = 0; r < ranges; ++r) {
      T logs[shares], mean = 0;
      for (std::size_t s = 0; s < shares; ++s) logs[s] = products[r][s].value();
      const T* const most = std::max_element(logs, logs + shares);
      best[r] = share[most - logs];
      for (const T log : logs) mean += std::exp(log - *most) / shares;
      all += *most + std::log(mean);
    }
    return all;
  }

  // Takes away the pairs near the line of the previous image that carries most of the gains.
  void drop_line() noexcept {
    using P = simd::Packet<T>;
    const P zero(T(0)), one(T(1)), width_sq(64 * (std::max)(search.noise.variance, search.limit / T(3.84)));
    Random random(pairs.size, "fundamental_evidence");
    const auto point = [&] {
      const std::size_t k = random.index(static_cast<std::uint32_t>(count));
      return Vector3<T>(x[k], y[k], 1);
    };
    const auto near = [&](const Vector3<T>& line, std::size_t k) {
      const P e = multiply_add(P(line[0]), P::load(x + k), multiply_add(P(line[1]), P::load(y + k), P(line[2])));
      return e * e <= width_sq;
    };
    const Vector3<T> best = heaviest_line<T>(point, [&](const Vector3<T>& line) {
      P sum = zero;
      for (std::size_t k = 0; k < count; k += P::lanes) {
        const P g = P::load(gain + k);
        sum += select(near(line, k), select(g < one, select(g > zero, g, zero), one), zero);
      }
      return reduce_add(sum);
    });
    for (std::size_t k = 0; k < count; k += P::lanes) select(near(best, k), zero, P::load(gain + k)).store(gain + k);
  }
};

}  // namespace CFP_ISA
}  // namespace cfp::detail
