#include "cfp/optimization/bundle/block_cholesky.hpp"

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>

#include "cfp/core/random.hpp"
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
    for (const int natural_order_limit : {0, 1000}) {
      CAPTURE(c.size, natural_order_limit);
      cfp::BlockCholesky cholesky;
      cholesky.analyze(c.size, system.rows, system.columns, natural_order_limit);
      REQUIRE(cholesky.factorize(system.blocks));
      std::vector<double> x = system.right_side;
      cholesky.solve(x);
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
  cfp::BlockCholesky cholesky;
  cholesky.analyze(n, rows, columns, 0);
  CHECK(cholesky.factor_blocks() == 2 * n - 1);
  cholesky.analyze(n, rows, columns, n);
  CHECK(cholesky.factor_blocks() == n * (n + 1) / 2);
}

TEST_CASE("A matrix that is not positive definite is refused", "[optimization][block_cholesky]") {
  for (const double bad :
       {-1.0, 0.0, std::numeric_limits<double>::quiet_NaN(), -std::numeric_limits<double>::infinity()}) {
    System system(5, 1, 0, 6);
    for (std::size_t i = 0; i < system.rows.size(); ++i) {
      if (system.rows[i] == 3 && system.columns[i] == 3) system.blocks[36 * i + 14] = bad;
    }
    cfp::BlockCholesky cholesky;
    cholesky.analyze(5, system.rows, system.columns);
    CHECK_FALSE(cholesky.factorize(system.blocks));
  }
}

TEST_CASE("Factorising and solving again allocates nothing", "[optimization][block_cholesky]") {
  System system(100, 4, 30, 5), small(20, 4, 5, 6);
  cfp::BlockCholesky cholesky;
  cholesky.analyze(100, system.rows, system.columns);
  CHECK(cfp_test::allocations_in([&] {
          CHECK(cholesky.factorize(system.blocks));
          cholesky.solve(system.right_side);
        }) == 0);
  cholesky.analyze(20, small.rows, small.columns);
  CHECK(cfp_test::allocations_in([&] {
          cholesky.analyze(20, small.rows, small.columns);
          CHECK(cholesky.factorize(small.blocks));
          cholesky.solve(small.right_side);
        }) == 0);
}
