// The promise "const calls on shared data are safe, and every thread computes the same bits" as one line of a test.
#pragma once

#include <array>
#include <thread>
#include <type_traits>

#include "support/catch.hpp"

namespace cfp_test {

/// Runs `work` once here, then several times in each of four threads at once, and compares the returned values.
template <typename Work>
void check_same_in_all_threads(const Work& work) {
  using Value = std::decay_t<decltype(work())>;
  const Value expected = work();
  std::array<int, 4> wrong{};
  std::array<std::thread, 4> threads;
  for (std::size_t t = 0; t < threads.size(); ++t) {
    threads[t] = std::thread([&work, &expected, &mine = wrong[t]] {
      for (int repeat = 0; repeat < 8; ++repeat) mine += work() == expected ? 0 : 1;
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (const int count : wrong) CHECK(count == 0);
}

}  // namespace cfp_test
