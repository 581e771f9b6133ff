/// @file block_cholesky_impl.hpp
/// Cholesky factorisation of a symmetric positive definite matrix of N x N blocks inside its envelope: of each row the
/// blocks from the first that is not zero up to the diagonal, which are those that fill (internal to
/// bundle_adjustment.hpp). In place; nothing allocates. Source: George, Liu: "Computer Solution of Large Sparse
/// Positive Definite Systems", 1981, chapter 4, with blocks in the place of scalars.
#pragma once

#include <algorithm>
#include <vector>

#include "cfp/core/span.hpp"
#include "cfp/math/normal_equations.hpp"

namespace cfp::detail {

[[nodiscard]] constexpr std::size_t to_index(int i) noexcept { return static_cast<std::size_t>(i); }

/// Blocks are column-major, row after row.
struct BlockEnvelope {
  std::vector<std::size_t> first;  // column of the first block, per row
  std::vector<std::size_t> begin;  // number of that block
  std::size_t blocks = 0;

  [[nodiscard]] std::size_t at(std::size_t row, std::size_t column) const noexcept {
    return begin[row] + column - first[row];
  }
};

inline namespace CFP_ISA {

/// To be called when `first` has been set.
inline void number_blocks(BlockEnvelope& envelope) {
  envelope.begin.clear();
  envelope.blocks = 0;
  for (std::size_t row = 0; row < envelope.first.size(); ++row) {
    envelope.begin.push_back(envelope.blocks);
    envelope.blocks += row + 1 - envelope.first[row];
  }
}

/// From A to L in its place, the diagonal blocks of L inverted; of diagonal blocks the lower triangle is read. False
/// when A is not positive definite (NaN included).
template <int N>
[[nodiscard]] bool factorize_blocks(const BlockEnvelope& envelope, span<double> blocks) noexcept {
  using Block = Eigen::Map<Eigen::Matrix<double, N, N>>;
  CFP_ASSERT(blocks.size() == envelope.blocks * N * N);
  const auto block = [&](std::size_t row, std::size_t column) {
    return Block(blocks.data() + N * N * envelope.at(row, column));
  };
  for (std::size_t row = 0; row < envelope.first.size(); ++row) {
    for (std::size_t column = envelope.first[row]; column <= row; ++column) {
      Eigen::Matrix<double, N, N> rest = block(row, column);
      for (std::size_t k = (std::max)(envelope.first[row], envelope.first[column]); k < column; ++k)
        rest.noalias() -= block(row, k).lazyProduct(block(column, k).transpose());
      if (column < row) {
        block(row, column).noalias() = rest.lazyProduct(block(column, column).transpose());
      } else {
        if (!invert_triangle(rest)) return false;
        block(row, row) = rest;
      }
    }
  }
  return true;
}

/// Solves A x = b in place, after factorize_blocks.
template <int N>
void solve_blocks(const BlockEnvelope& envelope, span<const double> blocks, span<double> x) noexcept {
  using Block = Eigen::Map<const Eigen::Matrix<double, N, N>>;
  using Vector = Eigen::Matrix<double, N, 1>;
  CFP_ASSERT(blocks.size() == envelope.blocks * N * N && x.size() == envelope.first.size() * N);
  const auto block = [&](std::size_t row, std::size_t column) {
    return Block(blocks.data() + N * N * envelope.at(row, column));
  };
  const auto part = [&](std::size_t row) { return Eigen::Map<Vector>(x.data() + N * row); };
  for (std::size_t row = 0; row < envelope.first.size(); ++row) {
    Vector rest = part(row);
    for (std::size_t k = envelope.first[row]; k < row; ++k) rest -= block(row, k).lazyProduct(part(k));
    part(row) = block(row, row).lazyProduct(rest);
  }
  for (std::size_t row = envelope.first.size(); row-- > 0;) {
    const Vector solved = block(row, row).transpose().lazyProduct(part(row));
    part(row) = solved;
    for (std::size_t k = envelope.first[row]; k < row; ++k) part(k) -= block(row, k).transpose().lazyProduct(solved);
  }
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
