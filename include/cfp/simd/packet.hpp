/// @file packet.hpp
/// Several numbers of one type, float or double, in one vector register, for loops over points stored one array per
/// coordinate:
///
///   for (std::size_t i = 0; i < n; i += Packet<float>::lanes) (Packet<float>::load(x + i) * 2.0F).store(y + i);
///
/// Built on Eigen's packet operations (internal, but the same from Eigen 3.4 to 5 and from SSE2 to AVX-512 and NEON);
/// this is the only header that touches them. The width follows the flags of the including project. Nothing asks for
/// flags and nothing allocates.
#pragma once

#include <cmath>
#include <type_traits>
#include <utility>

#include <Eigen/Core>

#include "cfp/version.hpp"

// GCC 12 takes the deliberately undefined registers of its own AVX-512 intrinsics for a mistake of whoever inlines
// them.
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wuninitialized"
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif

namespace cfp::simd {
inline namespace CFP_ISA {

namespace eigen = Eigen::internal;

/// `lanes` numbers of type T: 4 floats for SSE2 and NEON, 16 for AVX-512; 1 where there is no vector unit for T. For
/// registers and local arrays only: its alignment depends on flags, so no struct may hold one.
template <typename T>
struct Packet {
  using Register = typename eigen::packet_traits<T>::type;
  static constexpr std::size_t lanes = eigen::packet_traits<T>::size;
  Register bits;

  /// Result of a comparison: a choice per lane.
  struct Mask {
    Register bits;
  };

  Packet() = default;
  Packet(const T& x) noexcept : bits(eigen::pset1<Register>(x)) {}
  static Packet wrap(const Register& r) noexcept {
    Packet p;
    p.bits = r;
    return p;
  }
  /// `lanes` adjacent numbers, no alignment asked.
  [[nodiscard]] static Packet load(const T* from) noexcept { return wrap(eigen::ploadu<Register>(from)); }
  void store(T* to) const noexcept { eigen::pstoreu(to, bits); }

  friend Packet operator+(const Packet& a, const Packet& b) noexcept { return wrap(eigen::padd(a.bits, b.bits)); }
  friend Packet operator-(const Packet& a, const Packet& b) noexcept { return wrap(eigen::psub(a.bits, b.bits)); }
  friend Packet operator*(const Packet& a, const Packet& b) noexcept { return wrap(eigen::pmul(a.bits, b.bits)); }
  friend Packet operator/(const Packet& a, const Packet& b) noexcept { return wrap(eigen::pdiv(a.bits, b.bits)); }
  Packet& operator+=(const Packet& b) noexcept { return *this = *this + b; }

  // A comparison with NaN is false.
  friend Mask operator<(const Packet& a, const Packet& b) noexcept { return {eigen::pcmp_lt(a.bits, b.bits)}; }
  friend Mask operator<=(const Packet& a, const Packet& b) noexcept { return {eigen::pcmp_le(a.bits, b.bits)}; }
  friend Mask operator>(const Packet& a, const Packet& b) noexcept { return b < a; }
  friend Mask both(const Mask& a, const Mask& b) noexcept { return {eigen::pand(a.bits, b.bits)}; }

  /// a b + c, fused (one rounding) where the flags allow.
  friend Packet multiply_add(const Packet& a, const Packet& b, const Packet& c) noexcept {
    return wrap(eigen::pmadd(a.bits, b.bits, c.bits));
  }
  friend Packet abs(const Packet& a) noexcept { return wrap(eigen::pabs(a.bits)); }
  /// log(1 + x) for x > -1, within a few units in the last place.
  friend Packet log1p(const Packet& a) noexcept { return wrap(eigen::generic_plog1p(a.bits)); }
  /// The sum of the lanes.
  friend T reduce_add(const Packet& a) noexcept { return eigen::predux(a.bits); }
};

// For formulas of packets and of scalars alike, dual numbers included.

template <typename P>
P lane_of(const P&);  // for its type alone
template <typename T>
T lane_of(const Packet<T>&);
template <typename P>
using scalar_of = decltype(lane_of(std::declval<P>()));

/// The numbers at `from`, as many as P has lanes.
template <typename P>
[[nodiscard]] P load(const scalar_of<P>* from) noexcept {
  if constexpr (std::is_arithmetic_v<P>)
    return *from;
  else
    return P::load(from);
}

/// Per lane: a where the condition holds, else b. Both are evaluated; the one not taken may hold NaN or infinity.
template <typename T>
[[nodiscard]] constexpr T select(bool condition, const T& a, const T& b) noexcept {
  return condition ? a : b;
}
template <typename T>
[[nodiscard]] Packet<T> select(const typename Packet<T>::Mask& condition, const Packet<T>& a,
                               const Packet<T>& b) noexcept {
  return Packet<T>::wrap(eigen::pselect(condition.bits, a.bits, b.bits));
}

/// 1 / sqrt(x) within 3 units in the last place; infinite at 0 (for packets also at denormals), 0 at infinity. One root
/// and no division where the hardware has an estimate to refine.
template <typename T>
[[nodiscard]] T reciprocal_sqrt(const T& x) noexcept {
  using std::sqrt;
  return T(1) / sqrt(x);
}
template <typename T>
[[nodiscard]] Packet<T> reciprocal_sqrt(const Packet<T>& x) noexcept {
  return Packet<T>::wrap(eigen::prsqrt(x.bits));
}

}  // namespace CFP_ISA
}  // namespace cfp::simd

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic pop
#endif
