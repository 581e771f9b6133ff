// Sorted depths of a box: half of them a person at 2 m, the rest anything.
#pragma once

#include <algorithm>
#include <vector>

#include "cfp/core/random.hpp"

namespace cfp_test {

inline std::vector<double> random_depths(cfp::Random& random, std::size_t n) {
  std::vector<double> depths;
  for (std::size_t i = 0; i < n; ++i)
    depths.push_back(random.index(2) == 0 ? 2 + 0.1 * random.normal() : random.uniform(0.5, 6));
  std::sort(depths.begin(), depths.end());
  return depths;
}

}  // namespace cfp_test
