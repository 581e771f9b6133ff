/// @file distance.hpp
/// What all pixel distances of cfp share: the value that stands for "no distance".
#pragma once

#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"

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

}  // namespace cfp
