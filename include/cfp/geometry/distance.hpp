/// @file distance.hpp
/// Common to all pixel distances of cfp: the value that stands for "no distance", and a robust estimate of their noise.
#pragma once

#include "cfp/core/span.hpp"
#include "cfp/math/order_statistic.hpp"

namespace cfp {

/// Stands for a distance that does not exist (behind the camera, no depth, undefined line), so that arrays of distances
/// stay finite. Every real distance is >= 0.
template <typename Scalar>
inline constexpr Scalar no_distance = Scalar(-1);

inline namespace CFP_ISA {

/// Whether d is a distance: finite and >= 0.
template <typename Scalar>
[[nodiscard]] constexpr bool has_distance(const Scalar& d) noexcept {
  return d >= Scalar(0) && d <= Scalar((std::numeric_limits<Scalar>::max)());
}

/// Copies those of `from` that are distances, in their order; `to` needs room for all of them and may be the same
/// memory. Returns how many there are.
template <typename Scalar>
[[nodiscard]] std::size_t copy_distances(span<const Scalar> from, span<Scalar> to) noexcept {
  CFP_ASSERT(to.size() >= from.size());
  std::size_t kept = 0;
  for (const Scalar d : from) {  // no branch: which distances are missing is hard to foresee
    to.data()[kept] = d;
    kept += static_cast<std::size_t>(static_cast<int>(d >= Scalar(0)) &
                                     static_cast<int>(d <= (std::numeric_limits<Scalar>::max)()));
  }
  return kept;
}

/// The median of the chi distribution of one or two degrees of freedom.
[[nodiscard]] constexpr double chi_median(int degrees_of_freedom) noexcept {
  return degrees_of_freedom == 1 ? 0.674489750196082 : 1.177410022515475;
}

/// The standard deviation of one coordinate, from distances of static points with at least half inliers: their median
/// over that of the chi distribution; 7 % too large with a tenth of mismatches, 18 % with a fifth. degrees_of_freedom:
/// 1 for distances from a line, 2 for distances from a point. Distances that are none are left out; none at all gives
/// 0. `distances` is overwritten. O(n).
template <typename Scalar>
[[nodiscard]] Scalar robust_sigma(span<Scalar> distances, int degrees_of_freedom) noexcept {
  const std::size_t n = copy_distances(span<const Scalar>(distances), distances);
  return quantile(distances.subspan(0, n), 0.5) / Scalar(chi_median(degrees_of_freedom));
}

}  // namespace CFP_ISA
}  // namespace cfp
