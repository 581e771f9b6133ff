#include "cfp/optimization/bundle/two_threads.hpp"

#include <atomic>
#include <thread>
#include <vector>

#include "support/allocation_counter.hpp"
#include "support/catch.hpp"

TEST_CASE("Two threads do every task once, each on one of the two", "[optimization][two_threads]") {
  cfp::TwoThreads two;
  for (const int count : {0, 1, 2, 3, 7}) {
    std::vector<int> done(static_cast<std::size_t>(count), 0);
    std::vector<std::thread::id> by(static_cast<std::size_t>(count));
    two(count, [&](int i) {
      ++done[static_cast<std::size_t>(i)];
      by[static_cast<std::size_t>(i)] = std::this_thread::get_id();
    });
    for (std::size_t i = 0; i < done.size(); ++i) {
      CHECK(done[i] == 1);
      CHECK(by[i] != std::thread::id());
    }
  }
}

TEST_CASE("A long task of the one leaves the others to the other", "[optimization][two_threads]") {
  cfp::TwoThreads two;
  std::atomic<int> others{0};
  std::vector<std::thread::id> by(5);
  two(5, [&](int i) {
    by[static_cast<std::size_t>(i)] = std::this_thread::get_id();
    if (i == 0) {
      while (others.load() < 4) std::this_thread::yield();
    } else {
      ++others;
    }
  });
  for (std::size_t i = 1; i < by.size(); ++i) CHECK(by[i] != by[0]);
}

TEST_CASE("The hand-over to the helper holds for many short rounds and allocates nothing",
          "[optimization][two_threads]") {
  cfp::TwoThreads two;
  long long sums[2] = {0, 0};
  CHECK(cfp_test::allocations_in([&] {
          for (int round = 0; round < 2000; ++round) two(2, [&](int i) { sums[i] += round + i; });
        }) == 0);
  CHECK(sums[0] == 1999000);
  CHECK(sums[1] == 1999000 + 2000);
}
