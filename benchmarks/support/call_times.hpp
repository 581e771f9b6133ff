// The spread of single calls, for what runs once per frame: a mean says nothing about the frame that comes too late.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <vector>

#include <benchmark/benchmark.h>

namespace cfp_benchmark {

/// Times each call by the wall clock (two readings, some 50 ns) and gives the benchmark the counters p50_us, p95_us,
/// p99_us, max_us.
class CallTimes {
 public:
  explicit CallTimes(const benchmark::State& state) { us_.reserve(static_cast<std::size_t>(state.max_iterations)); }

  template <typename Work>
  void add(Work&& work) {
    const auto start = std::chrono::steady_clock::now();
    work();
    us_.push_back(std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count());
  }
  void report(benchmark::State& state) {
    if (us_.empty()) return;
    std::sort(us_.begin(), us_.end());
    const auto at = [&](std::size_t percent) { return us_[(std::min)(us_.size() * percent / 100, us_.size() - 1)]; };
    state.counters["p50_us"] = at(50);
    state.counters["p95_us"] = at(95);
    state.counters["p99_us"] = at(99);
    state.counters["max_us"] = us_.back();
  }

 private:
  std::vector<double> us_;
};

}  // namespace cfp_benchmark
