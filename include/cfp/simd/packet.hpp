/// @file packet.hpp
/// Several numbers of one type in one vector register, for loops over points stored one array per coordinate. The same
/// template, instantiated with the plain scalar, is the scalar version: every function below exists for float and
/// double.
///
///   template <typename P> void square(const scalar_of<P>* x, scalar_of<P>* y) { store(y, load<P>(x) * load<P>(x)); }
///   square<Packet<float>>(x, y);  square<float>(x, y);
///
/// Built on Eigen's packet operations (internal, but the same from Eigen 3.4 to 5 and from SSE2 to AVX-512 and NEON);
/// this is the only header that touches them. The width follows the flags of the including project. Nothing asks for
/// flags and nothing allocates.
#pragma once

#include <cmath>
#include <type_traits>

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

/// Numbers per register: 4 floats for SSE2 and NEON, 16 for AVX-512; 1 where there is no vector unit for T.
template <typename T>
inline constexpr int native_lanes = static_cast<int>(Eigen::internal::packet_traits<T>::size);

/// Result of a comparison of packets: a choice per lane.
template <typename T>
struct PacketMask {
  typename Eigen::internal::packet_traits<T>::type bits;
};

/// native_lanes<T> numbers of type T. For registers and local arrays only: its alignment depends on flags, so no struct
/// may hold one.
template <typename T>
struct BasicPacket {
  using Register = typename Eigen::internal::packet_traits<T>::type;
  using Mask = PacketMask<T>;
  Register bits;

  BasicPacket() = default;
  BasicPacket(const T& x) noexcept : bits(Eigen::internal::pset1<Register>(x)) {}
  static BasicPacket wrap(const Register& r) noexcept {
    BasicPacket p;
    p.bits = r;
    return p;
  }

  friend BasicPacket operator+(const BasicPacket& a, const BasicPacket& b) noexcept {
    return wrap(Eigen::internal::padd(a.bits, b.bits));
  }
  friend BasicPacket operator-(const BasicPacket& a, const BasicPacket& b) noexcept {
    return wrap(Eigen::internal::psub(a.bits, b.bits));
  }
  friend BasicPacket operator*(const BasicPacket& a, const BasicPacket& b) noexcept {
    return wrap(Eigen::internal::pmul(a.bits, b.bits));
  }
  friend BasicPacket operator/(const BasicPacket& a, const BasicPacket& b) noexcept {
    return wrap(Eigen::internal::pdiv(a.bits, b.bits));
  }
  BasicPacket& operator+=(const BasicPacket& b) noexcept { return *this = *this + b; }

  // A comparison with NaN is false.
  friend Mask operator<(const BasicPacket& a, const BasicPacket& b) noexcept {
    return {Eigen::internal::pcmp_lt(a.bits, b.bits)};
  }
  friend Mask operator<=(const BasicPacket& a, const BasicPacket& b) noexcept {
    return {Eigen::internal::pcmp_le(a.bits, b.bits)};
  }
  friend Mask operator>(const BasicPacket& a, const BasicPacket& b) noexcept { return b < a; }
};

namespace detail {

template <typename P>
struct PacketTraits {
  using Scalar = P;
  static constexpr int lanes = 1;
};
template <typename T>
struct PacketTraits<BasicPacket<T>> {
  using Scalar = T;
  static constexpr int lanes = native_lanes<T>;
};

}  // namespace detail

/// The widest packet the flags of this unit allow; T itself without a vector unit.
template <typename T>
using Packet = std::conditional_t<native_lanes<T> == 1, T, BasicPacket<T>>;

template <typename P>
using scalar_of = typename detail::PacketTraits<P>::Scalar;
template <typename P>
inline constexpr int lanes_of = detail::PacketTraits<P>::lanes;

/// lanes_of<P> adjacent numbers, no alignment asked.
template <typename P>
[[nodiscard]] P load(const scalar_of<P>* from) noexcept {
  if constexpr (lanes_of<P> == 1) {
    return *from;
  } else {
    return P::wrap(Eigen::internal::ploadu<typename P::Register>(from));
  }
}
template <typename T>
void store(T* to, const T& x) noexcept {
  *to = x;
}
template <typename T>
void store(T* to, const BasicPacket<T>& p) noexcept {
  Eigen::internal::pstoreu(to, p.bits);
}

/// a b + c, fused (one rounding) where the flags allow.
template <typename T>
[[nodiscard]] T multiply_add(const T& a, const T& b, const T& c) noexcept {
  return a * b + c;
}
template <typename T>
[[nodiscard]] BasicPacket<T> multiply_add(const BasicPacket<T>& a, const BasicPacket<T>& b,
                                          const BasicPacket<T>& c) noexcept {
  return BasicPacket<T>::wrap(Eigen::internal::pmadd(a.bits, b.bits, c.bits));
}

/// Conjunction of two conditions, of packets or of scalars.
template <typename T>
[[nodiscard]] PacketMask<T> both(const PacketMask<T>& a, const PacketMask<T>& b) noexcept {
  return {Eigen::internal::pand(a.bits, b.bits)};
}
[[nodiscard]] constexpr bool both(bool a, bool b) noexcept { return a && b; }

/// Per lane: a where the condition holds, else b. Both are evaluated; the one not taken may hold NaN or infinity.
template <typename T>
[[nodiscard]] constexpr T select(bool condition, const T& a, const T& b) noexcept {
  return condition ? a : b;
}
template <typename T>
[[nodiscard]] BasicPacket<T> select(const PacketMask<T>& condition, const BasicPacket<T>& a,
                                    const BasicPacket<T>& b) noexcept {
  return BasicPacket<T>::wrap(Eigen::internal::pselect(condition.bits, a.bits, b.bits));
}

// Found by argument-dependent lookup, as for dual numbers: `using std::sqrt; sqrt(x)` in a formula covers scalar and
// packet.

template <typename T>
[[nodiscard]] BasicPacket<T> abs(const BasicPacket<T>& a) noexcept {
  return BasicPacket<T>::wrap(Eigen::internal::pabs(a.bits));
}
/// log(1 + x) for x > -1, within a few units in the last place.
template <typename T>
[[nodiscard]] BasicPacket<T> log1p(const BasicPacket<T>& a) noexcept {
  return BasicPacket<T>::wrap(Eigen::internal::generic_plog1p(a.bits));
}

/// 1 / sqrt(x) within 3 units in the last place; infinite at 0 (for packets also at denormals), 0 at infinity. One root
/// and no division where the hardware has an estimate to refine.
template <typename T>
[[nodiscard]] T reciprocal_sqrt(const T& x) noexcept {
  using std::sqrt;
  return T(1) / sqrt(x);
}
template <typename T>
[[nodiscard]] BasicPacket<T> reciprocal_sqrt(const BasicPacket<T>& x) noexcept {
  return BasicPacket<T>::wrap(Eigen::internal::prsqrt(x.bits));
}

/// 1 / x, correctly rounded (a division, not the hardware's estimate, whose bits differ between makers).
template <typename P>
[[nodiscard]] P reciprocal(const P& x) noexcept {
  return P(scalar_of<P>(1)) / x;
}

/// The sum of the lanes.
template <typename T>
[[nodiscard]] T reduce_add(const T& x) noexcept {
  return x;
}
template <typename T>
[[nodiscard]] T reduce_add(const BasicPacket<T>& p) noexcept {
  return Eigen::internal::predux(p.bits);
}

}  // namespace CFP_ISA
}  // namespace cfp::simd

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic pop
#endif
