/// @file exponential.hpp
/// exp of a whole chunk of numbers <= 0, the only exponential that the batch functions of cfp need: vector
/// instructions on every instruction set, the baseline included. The standard library's exp is the specification; the
/// error is below 1.5 units in the last place.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <iterator>

#include "cfp/simd/chunk.hpp"

namespace cfp::detail {

/// e^r = 1 + r + r^2 q(r) for |r| <= log(2)/2. q interpolates at the Chebyshev points of degree 2 more without the two
/// nearest to 0, where r^2 makes them needless; relative error of e^r 6e-9 (float) and 5e-18 (double). log(2) =
/// log2_high + log2_low, the first short enough that its product with any exponent is exact (Cody and Waite, 1980).
template <typename Scalar>
struct Exponential;

template <>
struct Exponential<float> {
  using Bits = std::uint32_t;
  static constexpr int mantissa_bits = 23, exponent_bias = 127;
  static constexpr float lowest = -87.0F;  ///< e^lowest is a normal number
  static constexpr float log2_high = 0.693359375F, log2_low = -2.12194440e-4F;
  static constexpr float q[] = {0.0013641858F, 0.0083706343F, 0.041671968F, 0.166665F, 0.49999975F};
};

template <>
struct Exponential<double> {
  using Bits = std::uint64_t;
  static constexpr int mantissa_bits = 52, exponent_bias = 1023;
  static constexpr double lowest = -708.0;
  static constexpr double log2_high = 6.93145751953125e-1, log2_low = 1.42860682030941723212e-6;
  static constexpr double q[] = {2.5109719945450414e-08, 2.763222657233778e-07, 2.7557242067180346e-06,
                                 2.4801486975901924e-05, 0.0001984126988849669, 0.0013888888950298695,
                                 0.008333333333320557,   0.041666666666500526,  0.16666666666666677,
                                 0.5000000000000016};
};

/// e^x for every x <= 0 of the chunk; exactly 1 at 0, exactly 0 below -87 (float) or -708 (double). NaN gives 0. A
/// positive number is a mistake of the caller: the result is then meaningless.
template <typename Scalar>
[[nodiscard]] Chunk<Scalar> exponential_of_nonpositive(const Chunk<Scalar>& x) noexcept {
  using E = Exponential<Scalar>;
  using P = Packet<Scalar>;
  Chunk<Scalar> clamped, n, power, e;
  map_chunk(
      clamped, [](const P& v) { return select(v >= P(E::lowest), v, P(E::lowest)); }, x);
  for (std::size_t i = 0; i < chunk_size;
       ++i) {  // x = n log(2) + r, n the nearest whole number (rounded to 0, but x <= 0), and 2^n
    const std::int32_t exponent =
        static_cast<std::int32_t>(clamped.data()[i] * Scalar(1.4426950408889634074) - Scalar(0.5));
    const typename E::Bits bits = static_cast<typename E::Bits>(static_cast<std::uint32_t>(exponent + E::exponent_bias))
                                  << E::mantissa_bits;
    std::memcpy(power.data() + i, &bits, sizeof(bits));
    n.data()[i] = static_cast<Scalar>(exponent);
  }
  map_chunk(
      e,
      [](const P& v, const P& m, const P& p, const P& original) {
        const P r = multiply_add(m, P(-E::log2_low), multiply_add(m, P(-E::log2_high), v));
        P q(E::q[0]);
        for (std::size_t i = 1; i < std::size(E::q); ++i) q = multiply_add(q, r, P(E::q[i]));
        return select(original >= P(E::lowest), (multiply_add(q * r, r, r) + P(Scalar(1))) * p, P(Scalar(0)));
      },
      clamped, n, power, x);
  return e;
}

}  // namespace cfp::detail
