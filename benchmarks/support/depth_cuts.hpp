// One-line and textbook ways to part a person from what is behind by a cut in depth: rivals of depth_foreground in
// foreground_study. All take ascending, valid depths and return how many of them are foreground.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace cfp_study {

/// Everything up to `behind_m` behind the depth that the nearest 15 % reach.
inline std::size_t quantile_cut(const std::vector<double>& depths, double behind_m) {
  if (depths.empty()) return 0;
  const double z = depths[static_cast<std::size_t>(0.15 * static_cast<double>(depths.size()))];
  return static_cast<std::size_t>(std::upper_bound(depths.begin(), depths.end(), z + behind_m) - depths.begin());
}

/// Otsu, "A threshold selection method from gray-level histograms", 1979: the cut with the largest variance between its
/// two sides. All for fewer than two depths.
inline std::size_t otsu_cut(const std::vector<double>& depths) {
  const double n = static_cast<double>(depths.size());
  double total = 0, sum = 0, best = -1;
  for (const double z : depths) total += z;
  std::size_t cut = depths.size();
  for (std::size_t i = 1; i < depths.size(); ++i) {
    sum += depths[i - 1];
    const double left = static_cast<double>(i), gap = sum / left - (total - sum) / (n - left);
    if (left * (n - left) * gap * gap > best) best = left * (n - left) * gap * gap, cut = i;
  }
  return cut;
}

/// Two normal distributions by expectation maximisation, started from Otsu's cut; the cut is where the nearer one stops
/// being the likelier. All for fewer than four depths.
inline std::size_t mixture_cut(const std::vector<double>& depths) {
  const std::size_t n = depths.size();
  if (n < 4) return n;
  struct Part {
    double weight, mean, variance;
    [[nodiscard]] double density(double z) const {
      return weight / std::sqrt(variance) * std::exp(-(z - mean) * (z - mean) / (2 * variance));
    }
  };
  std::vector<double> near(n, 0.0);
  std::fill_n(near.begin(), otsu_cut(depths), 1.0);
  std::array<Part, 2> parts{};
  for (int round = 0; round < 30; ++round) {
    for (std::size_t k = 0; k < 2; ++k) {
      double sum = 1e-9, mean = 0, variance = 0;
      for (std::size_t i = 0; i < n; ++i) sum += k == 0 ? near[i] : 1 - near[i];
      for (std::size_t i = 0; i < n; ++i) mean += (k == 0 ? near[i] : 1 - near[i]) * depths[i] / sum;
      for (std::size_t i = 0; i < n; ++i)
        variance += (k == 0 ? near[i] : 1 - near[i]) * (depths[i] - mean) * (depths[i] - mean) / sum;
      parts[k] = {sum / static_cast<double>(n), mean, (std::max)(variance, 1e-4)};
    }
    for (std::size_t i = 0; i < n; ++i) {
      const double a = parts[0].density(depths[i]), b = parts[1].density(depths[i]);
      near[i] = a + b > 0 ? a / (a + b) : depths[i] < parts[0].mean ? 1.0 : 0.0;
    }
  }
  std::size_t cut = n;
  while (cut > 0 && depths[cut - 1] > parts[0].mean && near[cut - 1] < 0.5) --cut;
  return cut;
}

}  // namespace cfp_study
