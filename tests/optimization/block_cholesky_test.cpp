#include "cfp/optimization/bundle/block_cholesky_impl.hpp"

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>

#include "cfp/core/random.hpp"
#include "cfp/core/types.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"

namespace {

/// A sparse positive definite block matrix: a band and a few far blocks, in random order.
struct System {
  int size;
  std::vector<int> rows, columns;
  std::vector<double> blocks, right_side;
  Eigen::MatrixXd dense;

  System(int n, int band, int far, std::uint64_t seed) : size(n), dense(Eigen::MatrixXd::Zero(6 * n, 6 * n)) {
    cfp::Random random(seed, "block system");
    std::vector<std::pair<int, int>> pattern;
    for (int r = 0; r < n; ++r) {
      for (int c = (std::max)(0, r - band); c <= r; ++c) pattern.emplace_back(r, c);
    }
    for (int f = 0; f < far; ++f) {
      const int r = static_cast<int>(random.index(static_cast<std::uint32_t>(n))),
                c = static_cast<int>(random.index(static_cast<std::uint32_t>(n)));
      if (r - c > band && std::find(pattern.begin(), pattern.end(), std::make_pair(r, c)) == pattern.end())
        pattern.emplace_back(r, c);
    }
    for (std::size_t i = pattern.size(); i > 1; --i)
      std::swap(pattern[i - 1], pattern[random.index(static_cast<std::uint32_t>(i))]);
    for (const auto& [r, c] : pattern) {
      rows.push_back(r);
      columns.push_back(c);
      cfp::Matrix6<double> block;
      for (int e = 0; e < 36; ++e) block(e / 6, e % 6) = random.uniform(-1, 1);
      if (r == c)
        block = (block + block.transpose()).eval() + 12.0 * (2 * band + 1 + far) * cfp::Matrix6<double>::Identity();
      dense.block<6, 6>(6 * r, 6 * c) = block;
      dense.block<6, 6>(6 * c, 6 * r) = block.transpose();
      if (r == c) block.triangularView<Eigen::StrictlyUpper>().setConstant(std::numeric_limits<double>::quiet_NaN());
      blocks.insert(blocks.end(), block.data(), block.data() + 36);
    }
    for (int i = 0; i < 6 * n; ++i) right_side.push_back(random.uniform(-1, 1));
  }
};

}  // namespace

TEST_CASE("The block factorisation solves as a dense one, in natural and in minimum degree order",
          "[optimization][block_cholesky]") {
  struct Case {
    int size, band, far;
  };
  for (const Case c : {Case{0, 0, 0}, Case{1, 0, 0}, Case{2, 1, 0}, Case{9, 8, 0}, Case{40, 2, 15}, Case{80, 79, 0},
                       Case{100, 4, 30}}) {
    System system(c.size, c.band, c.far, 5);
    for (const int keep_order_up_to : {0, 1000}) {
      CAPTURE(c.size, keep_order_up_to);
      cfp::detail::BlockFactor factor;
      cfp::detail::analyze_blocks<6>(c.size, system.rows, system.columns, factor, keep_order_up_to);
      REQUIRE(cfp::detail::factorize_blocks<6>(system.blocks, factor));
      std::vector<double> x = system.right_side;
      cfp::detail::solve_blocks<6>(x, factor);
      const Eigen::VectorXd b = Eigen::Map<const Eigen::VectorXd>(system.right_side.data(), 6 * c.size);
      const Eigen::VectorXd expected = system.dense.llt().solve(b);
      CHECK((Eigen::Map<const Eigen::VectorXd>(x.data(), 6 * c.size) - expected).norm() <= 1e-12 * expected.norm());
    }
  }
}

TEST_CASE("Minimum degree order keeps an arrow sparse", "[optimization][block_cholesky]") {
  std::vector<int> rows, columns;  // the natural order fills everything
  constexpr int n = 80;
  for (int i = 0; i < n; ++i) rows.push_back(i), columns.push_back(i);
  for (int i = 1; i < n; ++i) rows.push_back(i), columns.push_back(0);
  cfp::detail::BlockFactor factor;
  cfp::detail::analyze_blocks<6>(n, rows, columns, factor, 0);
  CHECK(factor.row.size() == 2 * n - 1);
  cfp::detail::analyze_blocks<6>(n, rows, columns, factor, n);
  CHECK(factor.row.size() == n * (n + 1) / 2);
}

TEST_CASE("Blocks of another size are factorised by the same code", "[optimization][block_cholesky]") {
  constexpr int n = 70;
  Eigen::MatrixXd dense = Eigen::MatrixXd::Random(3 * n, 3 * n);
  dense = (dense * dense.transpose() + Eigen::MatrixXd::Identity(3 * n, 3 * n)).eval();
  std::vector<int> rows, columns;
  std::vector<double> blocks;
  for (int r = 0; r < n; ++r) {
    for (int c = 0; c <= r; ++c) {
      rows.push_back(r), columns.push_back(c);
      const Eigen::Matrix3d block = dense.block<3, 3>(3 * r, 3 * c);
      blocks.insert(blocks.end(), block.data(), block.data() + 9);
    }
  }
  cfp::detail::BlockFactor factor;
  cfp::detail::analyze_blocks<3>(n, rows, columns, factor);
  REQUIRE(cfp::detail::factorize_blocks<3>(blocks, factor));
  std::vector<double> x(3 * n, 1.0);
  cfp::detail::solve_blocks<3>(x, factor);
  const Eigen::VectorXd expected = dense.llt().solve(Eigen::VectorXd::Ones(3 * n));
  CHECK((Eigen::Map<const Eigen::VectorXd>(x.data(), 3 * n) - expected).norm() <= 1e-9 * expected.norm());
}

TEST_CASE("A matrix that is not positive definite is refused", "[optimization][block_cholesky]") {
  for (const double bad :
       {-1.0, 0.0, std::numeric_limits<double>::quiet_NaN(), -std::numeric_limits<double>::infinity()}) {
    System system(5, 1, 0, 6);
    for (std::size_t i = 0; i < system.rows.size(); ++i) {
      if (system.rows[i] == 3 && system.columns[i] == 3) system.blocks[36 * i + 14] = bad;
    }
    cfp::detail::BlockFactor factor;
    cfp::detail::analyze_blocks<6>(5, system.rows, system.columns, factor);
    CHECK_FALSE(cfp::detail::factorize_blocks<6>(system.blocks, factor));
  }
}

TEST_CASE("Factorising and solving again allocates nothing", "[optimization][block_cholesky]") {
  System system(100, 4, 30, 5), small(20, 4, 5, 6);
  cfp::detail::BlockFactor factor;
  cfp::detail::analyze_blocks<6>(100, system.rows, system.columns, factor);
  CHECK(cfp_test::allocations_in([&] {
          CHECK(cfp::detail::factorize_blocks<6>(system.blocks, factor));
          cfp::detail::solve_blocks<6>(system.right_side, factor);
        }) == 0);
  cfp::detail::analyze_blocks<6>(20, small.rows, small.columns, factor);
  CHECK(cfp_test::allocations_in([&] {
          cfp::detail::analyze_blocks<6>(20, small.rows, small.columns, factor);
          CHECK(cfp::detail::factorize_blocks<6>(small.blocks, factor));
          cfp::detail::solve_blocks<6>(small.right_side, factor);
        }) == 0);
}
