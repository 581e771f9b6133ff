// How many optical-flow pairs does an object's static probability need? Simulated objects: static ones with epipolar
// noise, and moving ones of which only a share of the pairs moves (an arm, a leg). Prints, for M pairs, how often
// either passes O_Th = 0.9. Supports ObjectProbabilityOptions::min_pairs. Usage: cfp_object_score_study [trials |
// --smoke]
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/probability/object.hpp"

namespace {

/// Share of `trials` objects whose O exceeds 0.9. A moving pair is off its line by up to 5 px.
double pass_share(std::size_t pairs, double sigma_px, double moving_share, int trials, cfp::Random& random) {
  cfp::ObjectProbabilityOptions options;
  options.min_pairs = 1;
  std::vector<double> distances(pairs), scratch(pairs);
  int passed = 0;
  for (int trial = 0; trial < trials; ++trial) {
    for (double& d : distances) {
      const double offset = random.uniform() < moving_share ? random.uniform(0.5, 5.0) : 0.0;
      d = std::abs(offset + sigma_px * random.normal());
    }
    const auto o = cfp::object_probability(distances, options, scratch);
    passed += o.static_probability > 0.9 ? 1 : 0;
  }
  return static_cast<double>(passed) / trials;
}

}  // namespace

int main(int argc, char** argv) {
  const bool smoke = argc > 1 && std::strcmp(argv[1], "--smoke") == 0;
  const int trials = smoke ? 200 : argc > 1 ? std::atoi(argv[1]) : 20000;
  if (trials < 1) {
    std::fprintf(stderr, "usage: cfp_object_score_study [trials >= 1 | --smoke]\n");
    return 2;
  }
  std::printf("Share of objects with O > 0.9, %d trials each, seed 1\n", trials);
  std::printf("balanced = mean of (static 0.2 px passes) and (20 %% of the pairs move, does not pass)\n\n");
  std::printf(
      "| M | static, 0.2 px | static, 0.3 px | static, 0.5 px | 20 %% move | 40 %% move | all move | balanced "
      "|\n|--:|--:|--:|--:|--:|--:|--:|--:|\n");
  for (const std::size_t pairs : {1U, 2U, 3U, 5U, 7U, 10U, 15U, 20U, 30U, 60U, 120U}) {
    cfp::Random random(1, "object score study");
    const double still = pass_share(pairs, 0.2, 0, trials, random);
    const double still3 = pass_share(pairs, 0.3, 0, trials, random);
    const double still5 = pass_share(pairs, 0.5, 0, trials, random);
    const double arm = pass_share(pairs, 0.2, 0.2, trials, random);
    const double half = pass_share(pairs, 0.2, 0.4, trials, random);
    const double all = pass_share(pairs, 0.2, 1.0, trials, random);
    std::printf("| %zu | %.3f | %.3f | %.3f | %.3f | %.3f | %.3f | %.3f |\n", pairs, still, still3, still5, arm, half,
                all, (still + 1 - arm) / 2);
  }
  return 0;
}
