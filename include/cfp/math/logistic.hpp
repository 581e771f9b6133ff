/// @file logistic.hpp
/// The logistic function, the sigmoid of every constraint and confidence of the paper (sections IV-C and IV-D).
#pragma once

#include <cmath>
#include <cstddef>

#include "cfp/core/span.hpp"
#include "cfp/math/exponential.hpp"
#include "cfp/simd/chunk.hpp"

namespace cfp {

/// 1 / (1 + exp(-x)), in [0, 1], non-decreasing, logistic(x) + logistic(-x) = 1 up to rounding. Only ever takes the
/// exponential of a number <= 0, so nothing overflows: exactly 0 at -inf and 1 at +inf. NaN gives 0, the safe side of a
/// static probability. For float, double and dual numbers.
template <typename Scalar>
[[nodiscard]] Scalar logistic(const Scalar& x) noexcept {
  using std::exp;
  if (x >= Scalar(0)) return Scalar(1) / (Scalar(1) + exp(-x));
  if (!(x < Scalar(0))) return Scalar(0);
  const Scalar e = exp(x);
  return e / (Scalar(1) + e);
}

namespace detail {

/// logistic of every element of the chunk, NaN becomes 0.
template <typename Scalar>
[[nodiscard]] Chunk<Scalar> logistic_of_chunk(const Chunk<Scalar>& x) noexcept {
  using P = Packet<Scalar>;
  using std::abs;
  Chunk<Scalar> result;
  map_chunk(
      result, [](const P& v) { return -abs(v); }, x);
  const Chunk<Scalar> e = exponential_of_nonpositive(result);
  map_chunk(
      result,
      [](const P& v, const P& power) {
        const P p = select(v >= P(Scalar(0)), P(Scalar(1)), power) / (P(Scalar(1)) + power);
        return select(v <= v, p, P(Scalar(0)));
      },
      x, e);
  return result;
}

}  // namespace detail

/// logistic of every element; `out` may be the same memory as `in`. Equal to the scalar function up to a few roundings
/// (absolutely, not relatively, below -700 for double and -85 for float). Vectorised; allocates nothing.
template <typename Scalar>
void logistic(span<const Scalar> in, span<Scalar> out) noexcept {
  CFP_ASSERT(in.size() == out.size());
  detail::for_each_chunk(in.size(), [&](std::size_t first, std::size_t count) {
    detail::Chunk<Scalar> x;
    detail::load_chunk(in, first, count, x);
    detail::store_chunk(detail::logistic_of_chunk(x), first, count, out);
  });
}

template <typename Scalar>
void logistic(span<Scalar> in, span<Scalar> out) noexcept {
  logistic(span<const Scalar>(in), out);
}

}  // namespace cfp
