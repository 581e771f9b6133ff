/// @file logistic.hpp
/// The logistic function, the sigmoid of every constraint and confidence of the paper (sections IV-C and IV-D).
#pragma once

#include <cmath>

#include <Eigen/Core>

#include "cfp/core/chunk.hpp"
#include "cfp/core/span.hpp"

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

/// logistic of every element; `out` may be the same memory as `in`. Equal to the scalar function up to a few roundings
/// (absolutely, not relatively, below -700 for double and -85 for float). Vectorised; allocates nothing.
template <typename Scalar>
void logistic(span<const Scalar> in, span<Scalar> out) noexcept {
  CFP_ASSERT(in.size() == out.size());
  using Chunk = detail::Chunk<Scalar>;
  detail::for_each_chunk(in.size(), [&](std::size_t first, std::size_t count) {
    Chunk x;
    detail::load_chunk(in, first, count, x);
    const Chunk e = (-x.abs()).exp();
    Chunk p = (Scalar(1) + e).inverse();
    for (Eigen::Index i = 0; i < x.size(); ++i) p[i] *= x[i] >= Scalar(0) ? Scalar(1) : e[i];
    for (Eigen::Index i = 0; i < x.size(); ++i) p[i] = x[i] == x[i] ? p[i] : Scalar(0);
    detail::store_chunk(p, first, count, out);
  });
}

template <typename Scalar>
void logistic(span<Scalar> in, span<Scalar> out) noexcept {
  logistic(span<const Scalar>(in), out);
}

}  // namespace cfp
