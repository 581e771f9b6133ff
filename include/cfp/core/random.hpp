/// @file random.hpp
/// The seeded generator of every sampling algorithm in cfp. The standard distributions differ between libraries, so
/// their results would too; this one gives the same numbers everywhere.
#pragma once

#include <cmath>

#include "cfp/core/numeric.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// SplitMix64 (Steele, Lea, Flood: "Fast splittable pseudorandom number generators", 2014): 64 bits of state, period
/// 2^64. Meets the standard's UniformRandomBitGenerator, so std::shuffle and RapidCheck-like tools accept it.
class Random {
 public:
  using result_type = std::uint64_t;
  static constexpr result_type(min)() noexcept { return 0; }
  static constexpr result_type(max)() noexcept { return ~result_type(0); }

  constexpr explicit Random(std::uint64_t seed = 0) noexcept : state_(seed) {}
  /// An independent stream by name: same seed, other name, other numbers.
  constexpr Random(std::uint64_t seed, const char* stream) noexcept : state_(seed) {
    for (; *stream != '\0'; ++stream) state_ = (state_ ^ static_cast<unsigned char>(*stream)) * 0x100000001b3ULL;
    (*this)();
  }

  constexpr result_type operator()() noexcept {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15ULL);
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31U);
  }
  /// Uniform in [0, 1), 53 random bits.
  [[nodiscard]] constexpr double uniform() noexcept { return static_cast<double>((*this)() >> 11U) * 0x1.0p-53; }
  /// Uniform in [low, high); high itself by rounding alone.
  [[nodiscard]] constexpr double uniform(double low, double high) noexcept { return low + (high - low) * uniform(); }
  /// Uniform in {0, …, n − 1}, n in [1, 2^32); the bias is below n / 2^32.
  [[nodiscard]] constexpr std::uint32_t index(std::uint32_t n) noexcept {
    CFP_ASSERT(n > 0);
    return static_cast<std::uint32_t>((((*this)() >> 32U) * n) >> 32U);
  }
  /// Standard normal (Box and Muller, one of the pair).
  [[nodiscard]] double normal() noexcept {
    const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));
    return radius * std::cos(2.0 * pi<double> * uniform());
  }

 private:
  std::uint64_t state_;
};

}  // namespace CFP_ISA
}  // namespace cfp
