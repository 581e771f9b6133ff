/// @file image_motion.hpp
/// The motion of the image as a whole, from optical flow. Not in the paper, whose boxes are predicted as if the camera
/// were still: a shaken camera moves all of them at once, which no box's own prediction contains.
#pragma once

#include <complex>
#include <vector>

#include "cfp/core/span.hpp"
#include "cfp/core/types.hpp"
#include "cfp/math/order_statistic.hpp"

namespace cfp {

inline namespace CFP_ISA {

/// Sets `motion` to what moves pixels of the frame before to this one, for `warp_box`: a similarity, since a camera
/// that turns shifts and rolls the image, fitted with Geman-McClure's weights in four passes. A translating camera
/// moves each pixel according to its depth, and a box unlike the room behind it: the larger the residuals, the smaller
/// the share of the similarity that is applied, 1 - 12 d^2 / D^2, with D the median displacement and d the median
/// residual of the pairs (cfp_tracker_study). False, and `motion` stays, where that is nothing, where D is half a pixel
/// or less, and below 12 pairs.
///
/// The caller leaves out moving objects; of the rest, less than half may be outliers, less than a quarter if these are
/// stationary in the image. Coordinates finite and within +-1e6 px. `distances` is scratch memory. O(pairs), allocates
/// only while it grows.
template <typename Scalar>
[[nodiscard]] bool image_motion(const PointSpan<Scalar, 2>& prev, const PointSpan<non_deduced<Scalar>, 2>& cur,
                                std::vector<non_deduced<Scalar>>& distances, Matrix3<non_deduced<Scalar>>& motion) {
  CFP_ASSERT(prev.size() == cur.size());
  constexpr int passes = 4;
  const std::size_t n = prev.size();
  if (n < 12) return false;
  using Complex = std::complex<double>;  // a pixel x + iy, which goes to turn (x + iy) + shift
  const auto pixel = [](const PointSpan<Scalar, 2>& points, std::size_t i) {
    return Complex(static_cast<double>(points(i, 0)), static_cast<double>(points(i, 1)));
  };
  Complex turn = 1, shift = 0;
  const auto distance_sq = [&](std::size_t i) { return std::norm(turn * pixel(prev, i) + shift - pixel(cur, i)); };
  double moved_sq = 0, left_sq = 0;
  distances.resize(n);
  for (int pass = 0;; ++pass) {
    for (std::size_t i = 0; i < n; ++i) distances[i] = static_cast<Scalar>(distance_sq(i));
    left_sq = static_cast<double>(order_statistic(span<Scalar>(distances), n / 2));
    if (pass == 0 && !((moved_sq = left_sq) > 0.25)) return false;
    if (pass == passes) break;
    // Fits anew, by Geman-McClure's weights of the distances so far.
    const double scale_sq = 2 * left_sq + 0.1;  // px^2; exact pairs, too, need one
    double count = 0, square = 0;
    Complex from = 0, to = 0, product = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const Complex p = pixel(prev, i), q = pixel(cur, i);
      const double share = scale_sq / (scale_sq + distance_sq(i)), weight = share * share;
      count += weight;
      from += weight * p;
      to += weight * q;
      square += weight * std::norm(p);
      product += weight * q * std::conj(p);
    }
    const double spread = square - std::norm(from) / count;
    if (!(spread > 1e-9 * square)) return false;  // all that counts is at one place
    turn = (product - to * std::conj(from) / count) / spread;
    shift = (to - turn * from) / count;
  }
  const double taken = 1 - 12 * left_sq / moved_sq;
  if (!(taken > 0)) return false;
  turn = 1.0 + taken * (turn - 1.0), shift *= taken;
  const Scalar a = Scalar(turn.real()), b = Scalar(turn.imag());
  motion = Matrix3<Scalar>{{a, -b, Scalar(shift.real())}, {b, a, Scalar(shift.imag())}, {0, 0, 1}};
  return true;
}

}  // namespace CFP_ISA
}  // namespace cfp
