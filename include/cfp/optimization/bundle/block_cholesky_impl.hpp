/// @file block_cholesky_impl.hpp
/// Sparse Cholesky factorisation of a symmetric positive definite matrix of N x N blocks: the reduced system of bundle
/// adjustment (internal to bundle_adjustment.hpp). The symbolic part is done once per pattern; nothing allocates after
/// a first call of the same size. Source: Davis: "Direct Methods for Sparse Linear Systems", 2006, chapters 4 and 7,
/// with blocks in the place of scalars.
#pragma once

#include <algorithm>
#include <bitset>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include "cfp/core/assert.hpp"
#include "cfp/core/span.hpp"

namespace cfp::detail {

[[nodiscard]] constexpr std::size_t to_index(int i) noexcept { return static_cast<std::size_t>(i); }

/// L L^T = P A P^T. Blocks are column-major; the diagonal blocks of L are kept as their inverses.
struct BlockFactor {
  struct Input {
    std::size_t entry;
    bool transposed;
  };
  int size = 0;                           // block rows
  std::vector<int> position;              // of a row of A in the elimination order
  std::vector<std::size_t> column_begin;  // entries of column k of L: the diagonal one first, rows ascending
  std::vector<int> row;                   // per entry
  std::vector<Input> input;               // per block of A
  std::vector<double> values, permuted;
  std::vector<std::uint64_t> neighbours;  // a row of bits per block row, while eliminating symbolically
  std::vector<int> degree;
};

/// Up to this many block rows the order is kept: any fill is cheap there.
inline constexpr int natural_order_limit = 64;

inline namespace CFP_ISA {

/// Eliminates the rows symbolically, in their order or by minimum degree; fills position, and row with the rows of A.
inline void eliminate_symbolically(bool by_degree, BlockFactor& factor) {
  const std::size_t n = to_index(factor.size), words = (n + 63) / 64;
  std::vector<std::uint64_t>& bits = factor.neighbours;
  const auto count = [&](std::size_t r) {
    std::size_t sum = 0;
    for (std::size_t w = 0; w < words; ++w) sum += std::bitset<64>(bits[r * words + w]).count();
    return static_cast<int>(sum);
  };
  factor.degree.resize(n);
  for (std::size_t r = 0; by_degree && r < n; ++r) factor.degree[r] = count(r);
  factor.position.assign(n, -1);
  factor.row.clear();
  factor.column_begin.assign(1, 0);
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t pivot = k;
    for (std::size_t r = 0, least = n + 1; by_degree && r < n; ++r) {
      if (factor.position[r] >= 0 || to_index(factor.degree[r]) >= least) continue;
      least = to_index(factor.degree[r]);
      pivot = r;
    }
    factor.position[pivot] = static_cast<int>(k);
    factor.row.push_back(static_cast<int>(pivot));
    const std::uint64_t* const clique = bits.data() + pivot * words;
    for (std::size_t r = 0; r < n; ++r) {
      if (((clique[r / 64] >> (r % 64)) & 1U) == 0) continue;
      factor.row.push_back(static_cast<int>(r));
      std::uint64_t* const target = bits.data() + r * words;
      for (std::size_t w = 0; w < words; ++w) target[w] |= clique[w];
      target[r / 64] &= ~(std::uint64_t(1) << (r % 64));
      target[pivot / 64] &= ~(std::uint64_t(1) << (pivot % 64));
      if (by_degree) factor.degree[r] = count(r);
    }
    factor.column_begin.push_back(factor.row.size());
  }
}

/// Symbolic factorisation for `size` block rows whose non-zero blocks on and below the diagonal are (rows[i],
/// columns[i]), rows[i] >= columns[i], each once, all diagonal ones among them, in any order.
template <int N>
void analyze_blocks(int size, span<const int> rows, span<const int> columns, BlockFactor& factor,
                    int keep_order_up_to = natural_order_limit) {
  CFP_ASSERT(size >= 0 && rows.size() == columns.size());
  const std::size_t n = to_index(size), words = (n + 63) / 64;
  factor.size = size;
  factor.neighbours.assign(n * words, 0);
  const auto connect = [&](std::size_t a, std::size_t b) {
    factor.neighbours[a * words + b / 64] |= std::uint64_t(1) << (b % 64);
  };
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (rows[i] == columns[i]) continue;
    connect(to_index(rows[i]), to_index(columns[i]));
    connect(to_index(columns[i]), to_index(rows[i]));
  }
  eliminate_symbolically(size > keep_order_up_to, factor);
  for (int& r : factor.row) r = factor.position[to_index(r)];
  const auto entry = [&](std::size_t e) { return factor.row.begin() + static_cast<std::ptrdiff_t>(e); };
  for (std::size_t k = 0; k < n; ++k) std::sort(entry(factor.column_begin[k]), entry(factor.column_begin[k + 1]));
  factor.input.resize(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const int a = factor.position[to_index(rows[i])], b = factor.position[to_index(columns[i])];
    const std::size_t column = to_index((std::min)(a, b));
    const auto found =
        std::lower_bound(entry(factor.column_begin[column]), entry(factor.column_begin[column + 1]), (std::max)(a, b));
    factor.input[i] = {static_cast<std::size_t>(found - factor.row.begin()), a < b};
  }
  factor.values.resize(factor.row.size() * N * N);
  factor.permuted.resize(n * N);
}

/// The inverse of L in A = L L^T (lower triangle of A is read) in its place; false when A is not positive definite.
template <int N>
[[nodiscard]] bool invert_triangle(Eigen::Map<Eigen::Matrix<double, N, N>> A) noexcept {
  Eigen::Matrix<double, N, N> L;
  for (int j = 0; j < N; ++j) {
    for (int i = j; i < N; ++i) {
      double sum = A(i, j);
      for (int k = 0; k < j; ++k) sum -= L(i, k) * L(j, k);
      if (i > j) {
        L(i, j) = sum * L(j, j);
      } else {
        if (!(sum > 0 && sum <= (std::numeric_limits<double>::max)())) return false;
        L(j, j) = 1 / std::sqrt(sum);  // kept as the inverse
      }
    }
  }
  A.setZero();
  for (int j = 0; j < N; ++j) {
    A(j, j) = L(j, j);
    for (int i = j + 1; i < N; ++i) {
      double sum = 0;
      for (int k = j; k < i; ++k) sum -= L(i, k) * A(k, j);
      A(i, j) = sum * L(i, i);
    }
  }
  return true;
}

/// Factorises the matrix whose block i (in the order given to analyze_blocks) is blocks[N N i …]; of diagonal blocks
/// the lower triangle is read. False when it is not positive definite (NaN included).
template <int N>
[[nodiscard]] bool factorize_blocks(span<const double> blocks, BlockFactor& factor) noexcept {
  using Block = Eigen::Map<Eigen::Matrix<double, N, N>>;
  using ConstBlock = Eigen::Map<const Eigen::Matrix<double, N, N>>;
  CFP_ASSERT(blocks.size() == factor.input.size() * N * N);
  const auto block = [&](std::size_t entry) { return Block(factor.values.data() + entry * N * N); };
  std::fill(factor.values.begin(), factor.values.end(), 0.0);
  for (std::size_t i = 0; i < factor.input.size(); ++i) {
    const ConstBlock source(blocks.data() + i * N * N);
    if (factor.input[i].transposed)
      block(factor.input[i].entry) = source.transpose();
    else
      block(factor.input[i].entry) = source;
  }
  for (std::size_t k = 0; k < to_index(factor.size); ++k) {
    const std::size_t begin = factor.column_begin[k], end = factor.column_begin[k + 1];
    if (!invert_triangle<N>(block(begin))) return false;
    for (std::size_t e = begin + 1; e < end; ++e) {
      const Eigen::Matrix<double, N, N> a = block(e);
      block(e).noalias() = a.lazyProduct(block(begin).transpose());
    }
    for (std::size_t j = begin + 1; j < end; ++j) {
      const Eigen::Matrix<double, N, N> right = block(j).transpose();
      std::size_t target = factor.column_begin[to_index(factor.row[j])];
      for (std::size_t i = j; i < end; ++i, ++target) {
        while (factor.row[target] != factor.row[i]) ++target;
        block(target).noalias() -= block(i).lazyProduct(right);
      }
    }
  }
  return true;
}

/// Solves A x = b in place.
template <int N>
void solve_blocks(span<double> vector, BlockFactor& factor) noexcept {
  using Segment = Eigen::Map<Eigen::Matrix<double, N, 1>>;
  using ConstBlock = Eigen::Map<const Eigen::Matrix<double, N, N>>;
  CFP_ASSERT(vector.size() == to_index(factor.size) * N);
  const auto block = [&](std::size_t entry) { return ConstBlock(factor.values.data() + entry * N * N); };
  const auto segment = [&](int k) { return Segment(factor.permuted.data() + to_index(k) * N); };
  for (int i = 0; i < factor.size; ++i)
    segment(factor.position[to_index(i)]) = Segment(vector.data() + to_index(i) * N);
  for (int k = 0; k < factor.size; ++k) {
    const std::size_t begin = factor.column_begin[to_index(k)], end = factor.column_begin[to_index(k) + 1];
    const Eigen::Matrix<double, N, 1> x = block(begin).lazyProduct(segment(k));
    segment(k) = x;
    for (std::size_t e = begin + 1; e < end; ++e) segment(factor.row[e]).noalias() -= block(e).lazyProduct(x);
  }
  for (int k = factor.size - 1; k >= 0; --k) {
    const std::size_t begin = factor.column_begin[to_index(k)], end = factor.column_begin[to_index(k) + 1];
    Eigen::Matrix<double, N, 1> x = segment(k);
    for (std::size_t e = begin + 1; e < end; ++e)
      x.noalias() -= block(e).transpose().lazyProduct(segment(factor.row[e]));
    segment(k).noalias() = block(begin).transpose().lazyProduct(x);
  }
  for (int i = 0; i < factor.size; ++i)
    Segment(vector.data() + to_index(i) * N) = segment(factor.position[to_index(i)]);
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
