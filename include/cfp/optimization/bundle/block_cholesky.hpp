/// @file block_cholesky.hpp
/// Sparse Cholesky factorisation of a symmetric positive definite matrix of 6x6 blocks: the reduced camera system of
/// bundle adjustment, one block row per pose. The symbolic part is done once per pattern; factorising and solving
/// allocate nothing. Source: Davis: "Direct Methods for Sparse Linear Systems", 2006, chapters 4 and 7, with blocks in
/// the place of scalars.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>

#include "cfp/core/assert.hpp"
#include "cfp/core/span.hpp"
#include "cfp/math/so3.hpp"

namespace cfp {

/// L L^T = P A P^T. Blocks are 36 doubles, column-major; vectors are 6 doubles per block row.
class BlockCholesky {
 public:
  static constexpr int block_size = 6;
  static constexpr std::size_t block_doubles = 36;
  static constexpr int dense_limit = 64;  ///< up to this many block rows the factor is never treated as dense

  /// Symbolic factorisation for `size` block rows whose non-zero blocks on and below the diagonal are (rows[i],
  /// columns[i]), rows[i] >= columns[i], each once, all diagonal ones among them, in any order. Up to
  /// `natural_order_limit` rows the order is kept (any fill is cheap there) and nothing allocates after a first call of
  /// that size; beyond it an approximate minimum degree order is computed, which allocates.
  void analyze(int size, span<const int> rows, span<const int> columns, int natural_order_limit = dense_limit) {
    CFP_ASSERT(size >= 0 && rows.size() == columns.size());
    size_ = size;
    position_.resize(static_cast<std::size_t>(size));
    if (size <= natural_order_limit) {
      for (int i = 0; i < size; ++i) position_[to(i)] = i;
    } else {
      order_by_minimum_degree(rows, columns);
    }
    find_fill(rows, columns);
    locate_inputs(rows, columns);
    dense_ = size > dense_limit && 4 * row_.size() > to(size) * to(size);
    values_.resize(dense_ ? 0 : row_.size() * block_doubles);
    dense_values_.resize(dense_ ? block_size * size : 0, dense_ ? block_size * size : 0);
  }

  /// Factorises the matrix whose block i (in the order given to analyze) is blocks[36 i …]; of diagonal blocks the
  /// lower triangle is read. False when it is not positive definite (NaN included).
  [[nodiscard]] bool factorize(span<const double> blocks) noexcept {
    CFP_ASSERT(blocks.size() == input_.size() * block_doubles);
    if (dense_) return factorize_dense(blocks);
    std::fill(values_.begin(), values_.end(), 0.0);
    for (std::size_t i = 0; i < input_.size(); ++i) {
      const ConstBlock source(blocks.data() + i * block_doubles);
      Block target = block(input_[i].entry);
      if (input_[i].transposed)
        target = source.transpose();
      else
        target = source;
    }
    for (int k = 0; k < size_; ++k) {
      if (!eliminate(k)) return false;
    }
    return true;
  }

  /// Solves A x = b in place.
  void solve(span<double> vector) noexcept {
    CFP_ASSERT(vector.size() == to(size_) * block_size);
    for (int i = 0; i < size_; ++i)
      segment(permuted_, position_[to(i)]) = ConstSegment(vector.data() + to(i) * block_size);
    if (dense_) {
      Eigen::Map<Eigen::VectorXd> x(permuted_.data(), dense_values_.rows());
      dense_values_.triangularView<Eigen::Lower>().solveInPlace(x);
      dense_values_.transpose().triangularView<Eigen::Upper>().solveInPlace(x);
    } else {
      solve_sparse();
    }
    for (int i = 0; i < size_; ++i) Segment(vector.data() + to(i) * block_size) = segment(permuted_, position_[to(i)]);
  }

  /// Blocks of the factor, for reports.
  [[nodiscard]] std::size_t factor_blocks() const noexcept { return row_.size(); }
  /// Whether the factor is kept as a dense matrix.
  [[nodiscard]] bool is_dense() const noexcept { return dense_; }

 private:
  using Block = Eigen::Map<Matrix6<double>>;
  using ConstBlock = Eigen::Map<const Matrix6<double>>;
  using Segment = Eigen::Map<Vector6<double>>;
  using ConstSegment = Eigen::Map<const Vector6<double>>;
  struct Input {
    std::size_t entry;
    int row, column;  // in the elimination order
    bool transposed;
  };

  [[nodiscard]] static std::size_t to(int i) noexcept { return static_cast<std::size_t>(i); }
  [[nodiscard]] Block block(std::size_t entry) noexcept { return Block(values_.data() + entry * block_doubles); }
  [[nodiscard]] Block diagonal_inverse(int k) noexcept { return Block(inverse_.data() + to(k) * block_doubles); }
  [[nodiscard]] static Segment segment(std::vector<double>& vector, int i) noexcept {
    return Segment(vector.data() + to(i) * block_size);
  }

  void order_by_minimum_degree(span<const int> rows, span<const int> columns) {
    using Pattern = Eigen::SparseMatrix<double, Eigen::ColMajor, int>;
    std::vector<Eigen::Triplet<double, int>> entries;
    entries.reserve(2 * rows.size());
    for (std::size_t i = 0; i < rows.size(); ++i) {
      entries.emplace_back(rows[i], columns[i], 1.0);
      if (rows[i] != columns[i]) entries.emplace_back(columns[i], rows[i], 1.0);
    }
    Pattern pattern(size_, size_);
    pattern.setFromTriplets(entries.begin(), entries.end());
    Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
    Eigen::AMDOrdering<int>()(pattern, order);  // order.indices()[new] = old
    for (int i = 0; i < size_; ++i) position_[to(order.indices()[i])] = i;
  }

  // The pattern of column k of L: that of A, united with those of its children in the elimination tree.
  void find_fill(span<const int> rows, span<const int> columns) {
    const std::size_t n = to(size_);
    input_begin_.assign(n + 1, 0);
    for (std::size_t i = 0; i < rows.size(); ++i)
      ++input_begin_[to((std::min)(position_[to(rows[i])], position_[to(columns[i])])) + 1];
    for (std::size_t k = 0; k < n; ++k) input_begin_[k + 1] += input_begin_[k];
    input_row_.resize(rows.size());
    cursor_.assign(input_begin_.begin(), input_begin_.end() - 1);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const int a = position_[to(rows[i])], b = position_[to(columns[i])];
      input_row_[cursor_[to((std::min)(a, b))]++] = (std::max)(a, b);
    }
    row_.clear();
    column_begin_.assign(n + 1, 0);
    first_child_.assign(n, -1);
    next_sibling_.assign(n, -1);
    marker_.assign(n, -1);
    for (int k = 0; k < size_; ++k) {
      const std::size_t begin = row_.size();
      const auto add = [&](int row) {
        if (row < k || marker_[to(row)] == k) return;
        marker_[to(row)] = k;
        row_.push_back(row);
      };
      for (std::size_t i = input_begin_[to(k)]; i < input_begin_[to(k) + 1]; ++i) add(input_row_[i]);
      for (int child = first_child_[to(k)]; child >= 0; child = next_sibling_[to(child)]) {
        for (std::size_t e = column_begin_[to(child)] + 1; e < column_begin_[to(child) + 1]; ++e) add(row_[e]);
      }
      std::sort(row_.begin() + static_cast<std::ptrdiff_t>(begin), row_.end());
      CFP_ASSERT(begin < row_.size() && row_[begin] == k);
      column_begin_[to(k) + 1] = row_.size();
      if (row_.size() > begin + 1) {
        const int parent = row_[begin + 1];
        next_sibling_[to(k)] = first_child_[to(parent)];
        first_child_[to(parent)] = k;
      }
    }
  }

  void locate_inputs(span<const int> rows, span<const int> columns) {
    input_.resize(rows.size());
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const int a = position_[to(rows[i])], b = position_[to(columns[i])];
      const std::size_t column = to((std::min)(a, b));
      const auto begin = row_.begin() + static_cast<std::ptrdiff_t>(column_begin_[column]);
      const auto end = row_.begin() + static_cast<std::ptrdiff_t>(column_begin_[column + 1]);
      input_[i] = {static_cast<std::size_t>(std::lower_bound(begin, end, (std::max)(a, b)) - row_.begin()),
                   (std::max)(a, b), (std::min)(a, b), a < b};
    }
    inverse_.resize(to(size_) * block_doubles);
    permuted_.resize(to(size_) * block_size);
  }

  [[nodiscard]] bool factorize_dense(span<const double> blocks) noexcept {
    dense_values_.setZero();
    for (std::size_t i = 0; i < input_.size(); ++i) {
      const ConstBlock source(blocks.data() + i * block_doubles);
      const int row = block_size * input_[i].row, column = block_size * input_[i].column;
      if (input_[i].transposed)
        dense_values_.block<6, 6>(row, column) = source.transpose();
      else
        dense_values_.block<6, 6>(row, column) = source;
    }
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(dense_values_);
    return llt.info() == Eigen::Success && dense_values_.diagonal().minCoeff() > 0;
  }

  // Both triangular systems, on permuted_.
  void solve_sparse() noexcept {
    for (int k = 0; k < size_; ++k) {
      Segment x = segment(permuted_, k);
      x = diagonal_inverse(k).triangularView<Eigen::Lower>() * Vector6<double>(x);
      for (std::size_t e = column_begin_[to(k)] + 1; e < column_begin_[to(k) + 1]; ++e) {
        segment(permuted_, row_[e]).noalias() -= block(e).lazyProduct(x);
      }
    }
    for (int k = size_ - 1; k >= 0; --k) {
      Segment x = segment(permuted_, k);
      for (std::size_t e = column_begin_[to(k)] + 1; e < column_begin_[to(k) + 1]; ++e) {
        x.noalias() -= block(e).transpose().lazyProduct(segment(permuted_, row_[e]));
      }
      x = diagonal_inverse(k).transpose().triangularView<Eigen::Upper>() * Vector6<double>(x);
    }
  }

  // Column k of L from the updated column k of A, then its contribution to the columns to the right.
  [[nodiscard]] bool eliminate(int k) noexcept {
    const std::size_t begin = column_begin_[to(k)], end = column_begin_[to(k) + 1];
    const Eigen::LLT<Matrix6<double>> llt(block(begin));
    if (llt.info() != Eigen::Success || !(llt.matrixLLT().diagonal().minCoeff() > 0)) return false;
    Block inverse = diagonal_inverse(k);
    inverse.setIdentity();
    llt.matrixL().solveInPlace(inverse);
    for (std::size_t e = begin + 1; e < end; ++e) {
      const Matrix6<double> a = block(e);
      block(e).noalias() = a.lazyProduct(inverse.transpose());
    }
    for (std::size_t j = begin + 1; j < end; ++j) {
      const ConstBlock right(values_.data() + j * block_doubles);
      std::size_t target = column_begin_[to(row_[j])];
      for (std::size_t i = j; i < end; ++i, ++target) {
        while (row_[target] != row_[i]) ++target;
        block(target).noalias() -= block(i).lazyProduct(right.transpose());
      }
    }
    return true;
  }

  int size_ = 0;
  std::vector<int> position_;              // of an input row in the elimination order
  std::vector<std::size_t> column_begin_;  // entries of column k of L: the diagonal one first, rows ascending
  std::vector<int> row_;
  std::vector<double> values_, inverse_, permuted_;
  bool dense_ = false;
  Eigen::MatrixXd dense_values_;
  std::vector<Input> input_;
  std::vector<std::size_t> input_begin_, cursor_;
  std::vector<int> input_row_, first_child_, next_sibling_, marker_;
};

}  // namespace cfp
