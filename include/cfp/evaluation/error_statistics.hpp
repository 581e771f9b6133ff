/// @file error_statistics.hpp
/// The six numbers in which trajectory errors are published.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "cfp/core/numeric.hpp"
#include "cfp/math/so3.hpp"

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

namespace detail {
inline namespace CFP_ISA {

/// Median time between neighbours (numpy.median); 0 below two poses.
template <typename Poses>
double median_interval(const Poses& poses, const std::vector<std::size_t>& order) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < order.size(); ++i) {
    intervals.push_back(
        (std::min)(poses[order[i]].time_s - poses[order[i - 1]].time_s, (std::numeric_limits<double>::max)()));
  }
  return error_statistics(std::move(intervals)).median;
}

template <typename Matrix>  // so that an evaluation that is not called is not compiled
double angle_deg(const Matrix& R) noexcept {
  return so3_log<double>(R).norm() * 180 / pi<double>;
}

/// The length; the largest double where it overflows.
inline double finite_norm(const Vector3<double>& v) noexcept {
  const double length = std::hypot(v[0], v[1], v[2]);
  return is_finite(length) ? length : (std::numeric_limits<double>::max)();
}

}  // namespace CFP_ISA
}  // namespace detail
}  // namespace cfp
