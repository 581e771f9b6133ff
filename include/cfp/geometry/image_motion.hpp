/// @file image_motion.hpp
/// How the image moved as a whole, told by optical flow. Not in the paper, whose boxes are predicted as if the camera
/// were still: a shaken one moves all of them at once, and a prediction knows nothing of it.
#pragma once

#include <complex>
#include <vector>

#include "cfp/core/span.hpp"
#include "cfp/core/types.hpp"
#include "cfp/math/order_statistic.hpp"

namespace cfp {

namespace detail {
inline namespace CFP_ISA {

/// p -> turn p + shift, a pixel being x + iy.
struct ImageSimilarity {
  std::complex<double> turn = 1, shift = 0;

  [[nodiscard]] double distance_sq(const std::complex<double>& prev, const std::complex<double>& cur) const noexcept {
    return std::norm(turn * prev + shift - cur);
  }
};

template <typename Scalar>
[[nodiscard]] std::complex<double> complex_pixel(const PointSpan<Scalar, 2>& points, std::size_t i) noexcept {
  return {static_cast<double>(points(i, 0)), static_cast<double>(points(i, 1))};
}

/// Fits anew, by Geman-McClure's weights of the distances so far. False where all that counts is at one place.
template <typename Scalar>
[[nodiscard]] bool refit(const PointSpan<Scalar, 2>& prev, const PointSpan<Scalar, 2>& cur, double scale_sq,
                         ImageSimilarity& fit) noexcept {
  double count = 0, square = 0;
  std::complex<double> from = 0, to = 0, product = 0;
  for (std::size_t i = 0; i < prev.size(); ++i) {
    const std::complex<double> p = complex_pixel(prev, i), q = complex_pixel(cur, i);
    const double share = scale_sq / (scale_sq + fit.distance_sq(p, q)), weight = share * share;
    count += weight;
    from += weight * p;
    to += weight * q;
    square += weight * std::norm(p);
    product += weight * q * std::conj(p);
  }
  const double spread = square - std::norm(from) / count;
  if (!(spread > 1e-9 * square)) return false;
  fit.turn = (product - to * std::conj(from) / count) / spread;
  fit.shift = (to - fit.turn * from) / count;
  return true;
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// Sets `motion` to what moves pixels of the frame before to this one, for `warp_box`: a similarity, since a camera
/// that turns shifts and rolls the image, fitted with Geman-McClure's weights in four passes. A camera that goes moves
/// each pixel by its depth instead, and a box not as the room behind it: the more the pairs disagree, the less of the
/// similarity is taken, 1 - 12 d^2 / D^2 of it, D the median of how far the pairs moved, d of how far they are from it
/// (cfp_tracker_study). False, and `motion` stays, where that is nothing, where D is half a pixel or less, and below 12
/// pairs.
///
/// The caller leaves out what moves by itself; of the rest, less than half may be wrong, less than a quarter where
/// these stay in their place. Coordinates finite and within +-1e6 px. `distances` is scratch memory. O(pairs),
/// allocates only while it grows.
template <typename Scalar>
[[nodiscard]] bool image_motion(const PointSpan<Scalar, 2>& prev, const PointSpan<non_deduced<Scalar>, 2>& cur,
                                std::vector<non_deduced<Scalar>>& distances, Matrix3<non_deduced<Scalar>>& motion) {
  CFP_ASSERT(prev.size() == cur.size());
  constexpr int passes = 4;
  const std::size_t n = prev.size();
  if (n < 12) return false;
  detail::ImageSimilarity fit;
  double moved_sq = 0, left_sq = 0;
  distances.resize(n);
  for (int pass = 0; pass <= passes; ++pass) {
    for (std::size_t i = 0; i < n; ++i)
      distances[i] =
          static_cast<Scalar>(fit.distance_sq(detail::complex_pixel(prev, i), detail::complex_pixel(cur, i)));
    left_sq = static_cast<double>(order_statistic(span<Scalar>(distances), n / 2));
    if (pass == 0 && !((moved_sq = left_sq) > 0.25)) return false;
    const double scale_sq = 2 * left_sq + 0.1;  // px^2; exact pairs, too, need one
    if (pass < passes && !detail::refit<Scalar>(prev, cur, scale_sq, fit)) return false;
  }
  const double taken = 1 - 12 * left_sq / moved_sq;
  if (!(taken > 0)) return false;
  const std::complex<double> turn = 1.0 + taken * (fit.turn - 1.0), shift = taken * fit.shift;
  motion.setIdentity();
  motion(0, 0) = motion(1, 1) = Scalar(turn.real());
  motion(1, 0) = Scalar(turn.imag());
  motion(0, 1) = -motion(1, 0);
  motion(0, 2) = Scalar(shift.real());
  motion(1, 2) = Scalar(shift.imag());
  return true;
}

}  // namespace CFP_ISA
}  // namespace cfp
