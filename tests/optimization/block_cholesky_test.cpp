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

/// A sparse positive definite block matrix: a band and a few far blocks, and right sides.
template <int N>
struct System {
  cfp::detail::BlockEnvelope envelope;
  std::vector<double> blocks, right_side;
  Eigen::MatrixXd dense;

  System(int n, int band, int far, std::uint64_t seed) : dense(Eigen::MatrixXd::Zero(N * n, N * n)) {
    cfp::Random random(seed, "block system");
    std::vector<std::pair<int, int>> pattern;
    for (int r = 0; r < n; ++r) {
      for (int c = (std::max)(0, r - band); c <= r; ++c) pattern.emplace_back(r, c);
    }
    for (int f = 0; f < far; ++f) {
      const int r = static_cast<int>(random.index(static_cast<std::uint32_t>(n))),
                c = static_cast<int>(random.index(static_cast<std::uint32_t>(n)));
      if (r - c > band) pattern.emplace_back(r, c);
    }
    for (int r = 0; r < n; ++r) envelope.first.push_back(static_cast<std::size_t>(r));
    for (const auto& [r, c] : pattern) {
      Eigen::Matrix<double, N, N> block;
      for (int e = 0; e < N * N; ++e) block(e / N, e % N) = random.uniform(-1, 1);
      if (r == c) {
        block =
            (block + block.transpose()).eval() + 12.0 * (2 * band + 1 + far) * Eigen::Matrix<double, N, N>::Identity();
      }
      dense.block<N, N>(N * r, N * c) = block;
      dense.block<N, N>(N * c, N * r) = block.transpose();
      std::size_t& first = envelope.first[static_cast<std::size_t>(r)];
      first = (std::min)(first, static_cast<std::size_t>(c));
    }
    cfp::detail::number_blocks(envelope);
    for (int r = 0; r < n; ++r) {
      for (int c = static_cast<int>(envelope.first[static_cast<std::size_t>(r)]); c <= r; ++c) {
        REQUIRE(envelope.at(static_cast<std::size_t>(r), static_cast<std::size_t>(c)) == blocks.size() / (N * N));
        Eigen::Matrix<double, N, N> block = dense.block<N, N>(N * r, N * c);
        if (r == c)
          block.template triangularView<Eigen::StrictlyUpper>().setConstant(std::numeric_limits<double>::quiet_NaN());
        blocks.insert(blocks.end(), block.data(), block.data() + N * N);
      }
    }
    for (int i = 0; i < N * n; ++i) right_side.push_back(random.uniform(-1, 1));
  }
};

template <int N>
void check_solution(int size, int band, int far) {
  CAPTURE(N, size, band, far);
  System<N> system(size, band, far, 5);
  CHECK(system.envelope.blocks == system.blocks.size() / (N * N));
  REQUIRE(cfp::detail::factorize_blocks<N>(system.envelope, system.blocks));
  std::vector<double> x = system.right_side;
  cfp::detail::solve_blocks<N>(system.envelope, system.blocks, x);
  const Eigen::VectorXd expected =
      system.dense.llt().solve(Eigen::Map<const Eigen::VectorXd>(system.right_side.data(), N * size));
  CHECK((Eigen::Map<const Eigen::VectorXd>(x.data(), N * size) - expected).norm() <= 1e-12 * expected.norm());
}

}  // namespace

TEST_CASE("The block factorisation solves as a dense one", "[optimization][block_cholesky]") {
  struct Case {
    int size, band, far;
  };
  for (const Case c : {Case{0, 0, 0}, Case{1, 0, 0}, Case{2, 1, 0}, Case{9, 8, 0}, Case{40, 2, 15}, Case{80, 79, 0},
                       Case{100, 4, 30}}) {
    check_solution<6>(c.size, c.band, c.far);
    check_solution<3>(c.size, c.band, c.far);
  }
}

TEST_CASE("A matrix that is badly conditioned is solved as well as by a dense factorisation",
          "[optimization][block_cholesky]") {
  constexpr int n = 70;
  cfp::Random random(7, "badly conditioned");
  Eigen::MatrixXd dense(3 * n, 3 * n);
  for (int e = 0; e < dense.size(); ++e) dense.data()[e] = random.uniform(-1, 1);
  dense = (dense * dense.transpose() + Eigen::MatrixXd::Identity(3 * n, 3 * n)).eval();
  cfp::detail::BlockEnvelope envelope;
  std::vector<double> blocks;
  for (int r = 0; r < n; ++r) {
    envelope.first.push_back(0);
    for (int c = 0; c <= r; ++c) {
      const Eigen::Matrix3d block = dense.block<3, 3>(3 * r, 3 * c);
      blocks.insert(blocks.end(), block.data(), block.data() + 9);
    }
  }
  cfp::detail::number_blocks(envelope);
  REQUIRE(cfp::detail::factorize_blocks<3>(envelope, blocks));
  std::vector<double> x(3 * n, 1.0);
  cfp::detail::solve_blocks<3>(envelope, blocks, x);
  const Eigen::VectorXd expected = dense.llt().solve(Eigen::VectorXd::Ones(3 * n));
  CHECK((Eigen::Map<const Eigen::VectorXd>(x.data(), 3 * n) - expected).norm() <= 1e-9 * expected.norm());
}

TEST_CASE("A matrix that is not positive definite is refused", "[optimization][block_cholesky]") {
  for (const double bad : {-1.0, 0.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
                           -std::numeric_limits<double>::infinity()}) {
    System<6> system(5, 1, 0, 6);
    system.blocks[36 * system.envelope.at(3, 3) + 14] = bad;
    CHECK_FALSE(cfp::detail::factorize_blocks<6>(system.envelope, system.blocks));
  }
}

TEST_CASE("Factorising and solving allocates nothing, numbering again neither", "[optimization][block_cholesky]") {
  System<6> system(100, 4, 30, 5);
  CHECK(cfp_test::allocations_in([&] {
          cfp::detail::number_blocks(system.envelope);
          CHECK(cfp::detail::factorize_blocks<6>(system.envelope, system.blocks));
          cfp::detail::solve_blocks<6>(system.envelope, system.blocks, system.right_side);
        }) == 0);
}
