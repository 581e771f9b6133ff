// Methods that solve the same problems in turns: each problem by every method, one after the other, so that ratios hold
// although the machine's clock moves and no method meets a problem twice in a row.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <functional>
#include <string>
#include <vector>

namespace cfp_benchmark {

inline double median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}
inline double largest(const std::vector<double>& values) {
  return values.empty() ? 0 : *std::max_element(values.begin(), values.end());
}

template <typename Problem, typename Answer>
struct InterleavedMethod {
  std::string name;
  std::function<Answer(const Problem&, double& iterations)> solve;
  std::vector<double> times_us, iterations;
};

/// Solves every problem `repetitions` times by every method; judge(method number, problem, answer) sees the first
/// repetition's answers.
template <typename Problem, typename Answer, typename Judge>
void run_interleaved(const std::vector<Problem>& problems, int repetitions,
                     std::vector<InterleavedMethod<Problem, Answer>>& methods, Judge&& judge) {
  for (int repetition = 0; repetition < repetitions; ++repetition) {
    for (const Problem& problem : problems) {
      for (std::size_t m = 0; m < methods.size(); ++m) {
        double iterations = 0;
        const auto start = std::chrono::steady_clock::now();
        const Answer answer = methods[m].solve(problem, iterations);
        methods[m].times_us.push_back(
            std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count());
        if (repetition > 0) continue;
        methods[m].iterations.push_back(iterations);
        judge(m, problem, answer);
      }
    }
  }
}

}  // namespace cfp_benchmark
