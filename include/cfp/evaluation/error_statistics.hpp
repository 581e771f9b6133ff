/// @file error_statistics.hpp
/// The six numbers in which trajectory errors are published.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "cfp/version.hpp"

namespace cfp {

/// Unit of all but count: that of the errors. All zero when count is 0.
struct ErrorStatistics {
  double rmse = 0;
  double mean = 0;
  double median = 0;              ///< mean of the two middle values when count is even
  double standard_deviation = 0;  ///< of the population (divided by count), the papers' S.D.: rmse² = mean² + S.D.²
  double minimum = 0;
  double maximum = 0;
  std::size_t count = 0;
};

inline namespace CFP_ISA {

/// Statistics of finite errors ≥ 0. O(n), in the caller's copy; does not overflow below 1e308.
[[nodiscard]] inline ErrorStatistics error_statistics(std::vector<double> errors) noexcept {
  ErrorStatistics s;
  s.count = errors.size();
  if (errors.empty()) return s;
  const auto [smallest, largest] = std::minmax_element(errors.begin(), errors.end());
  s.minimum = *smallest;
  s.maximum = *largest;
  if (!(s.maximum > 0)) return s;
  const double n = static_cast<double>(s.count);
  double mean_square = 0, variance = 0;
  for (const double error : errors) {
    s.mean += error / n;
    mean_square += (error / s.maximum) * (error / s.maximum) / n;
  }
  for (const double error : errors) variance += ((error - s.mean) / s.maximum) * ((error - s.mean) / s.maximum) / n;
  s.rmse = s.maximum * std::sqrt(mean_square);
  s.standard_deviation = s.maximum * std::sqrt(variance);
  const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
  std::nth_element(errors.begin(), middle, errors.end());
  s.median = errors.size() % 2 == 1 ? *middle : 0.5 * *middle + 0.5 * *std::max_element(errors.begin(), middle);
  return s;
}

}  // namespace CFP_ISA
}  // namespace cfp
