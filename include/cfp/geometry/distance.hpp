/// @file distance.hpp
/// What all pixel distances of cfp share: the value that stands for "no distance", and the guarded quotient.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>

#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"
#include "cfp/core/types.hpp"

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

}  // namespace CFP_ISA

namespace detail {
inline namespace CFP_ISA {

/// |numerator| / sqrt(norm_sq), or no_distance unless norm_sq > noise_sq >= 0 and the quotient is finite.
template <typename Scalar>
[[nodiscard]] Scalar ratio_distance(const Scalar& numerator, const Scalar& norm_sq, const Scalar& noise_sq) noexcept {
  using std::abs;
  using std::sqrt;
  if (!(norm_sq > noise_sq)) return Scalar(no_distance<double>);
  const Scalar distance = abs(numerator) / sqrt(norm_sq);
  return has_distance(distance) ? distance : Scalar(no_distance<double>);
}

/// F over its largest coefficient, so that squares neither over- nor underflow; zero when F is zero or not finite.
template <typename Scalar>
[[nodiscard]] Matrix3<Scalar> unit_scale(const Matrix3<Scalar>& F) noexcept {
  using std::abs;
  Scalar largest(0);
  for (Eigen::Index i = 0; i < 9; ++i) {
    const Scalar size = abs(F(i));
    if (!is_finite(size)) return Matrix3<Scalar>::Zero();
    if (size > largest) largest = size;
  }
  if (!(largest > Scalar(0))) return Matrix3<Scalar>::Zero();
  return F / largest;
}

/// Square of the size, per unit of |(u, v, 1)|, below which the normal of the line F (u, v, 1) is rounding noise.
template <typename Scalar>
[[nodiscard]] Scalar line_noise(const Matrix3<Scalar>& F) noexcept {
  const Scalar tolerance(Tolerance<Scalar>::degenerate);
  return tolerance * tolerance * F.template topRows<2>().squaredNorm();
}

}  // namespace CFP_ISA
}  // namespace detail
}  // namespace cfp
