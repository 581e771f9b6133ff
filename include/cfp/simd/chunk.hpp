/// @file chunk.hpp
/// How the batch functions of cfp walk over arrays: in chunks of 64 elements that are copied into local, aligned
/// storage, the last one padded with zeros. The fixed length is what lets every compiler use vector instructions, and
/// since no element is treated apart as a remainder, a result does not depend on where in the array its input stood.
#pragma once

#include <algorithm>
#include <cstddef>

#include <Eigen/Core>

#include "cfp/core/span.hpp"
#include "cfp/simd/packet.hpp"

namespace cfp::detail {

inline constexpr std::size_t chunk_size = 64;

template <typename Scalar>
using Chunk = Eigen::Array<Scalar, static_cast<int>(chunk_size), 1>;

/// Calls work(first, count) for consecutive ranges that cover [0, n).
template <typename Work>
void for_each_chunk(std::size_t n, Work&& work) {
  for (std::size_t first = 0; first < n; first += chunk_size) work(first, (std::min)(chunk_size, n - first));
}

/// to[i] = formula(from[i]...), packet by packet; `to` may be one of `from`. Formulas with a choice belong here:
/// select() cannot become a branch, which the vectorisers of compilers do not promise for a conditional expression.
template <typename Scalar, typename Formula, typename... From>
void map_chunk(Chunk<Scalar>& to, const Formula& formula, const From&... from) noexcept {
  constexpr std::size_t step = static_cast<std::size_t>(lanes_of<Packet<Scalar>>);
  static_assert(chunk_size % step == 0, "whole packets");
  for (std::size_t i = 0; i < chunk_size; i += step)
    store(to.data() + i, formula(load<Packet<Scalar>>(from.data() + i)...));
}

template <typename Scalar>
void load_chunk(span<const Scalar> values, std::size_t first, std::size_t count, Chunk<Scalar>& chunk) noexcept {
  CFP_ASSERT(first + count <= values.size());
  const Scalar* source = values.data() + first;
  if (count == chunk_size) {
    std::copy_n(source, chunk_size, chunk.data());
  } else {
    chunk.setZero();
    std::copy_n(source, count, chunk.data());
  }
}

template <typename Scalar>
void load_chunk(const PointSpan<Scalar, 2>& points, std::size_t first, std::size_t count, Chunk<Scalar>& x,
                Chunk<Scalar>& y) noexcept {
  CFP_ASSERT(first + count <= points.size());
  if (const Scalar* packed = points.packed(); packed != nullptr && count == chunk_size) {
    packed += 2 * first;  // a loop of known length and stride, for the vectoriser
    for (std::size_t i = 0; i < chunk_size; ++i) {
      x.data()[i] = packed[2 * i];
      y.data()[i] = packed[2 * i + 1];
    }
    return;
  }
  if (count != chunk_size) {
    x.setZero();
    y.setZero();
  }
  for (std::size_t i = 0; i < count; ++i) {
    x[static_cast<Eigen::Index>(i)] = points(first + i, 0);
    y[static_cast<Eigen::Index>(i)] = points(first + i, 1);
  }
}

template <typename Scalar>
void store_chunk(const Chunk<Scalar>& chunk, std::size_t first, std::size_t count, span<Scalar> values) noexcept {
  CFP_ASSERT(first + count <= values.size());
  if (count == chunk_size) {
    std::copy_n(chunk.data(), chunk_size, values.data() + first);
  } else {
    std::copy_n(chunk.data(), count, values.data() + first);
  }
}

}  // namespace cfp::detail
