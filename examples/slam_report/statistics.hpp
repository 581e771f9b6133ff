// Order statistics over frames and over seeds. Values that are not finite (a run without a result) are counted, never
// averaged.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace cfp_slam {

inline constexpr double not_known = std::numeric_limits<double>::quiet_NaN();

// The value at a share of the ranked finite values, linear between neighbours; not_known when there is none.
inline double quantile(std::vector<double> values, double share) {
  values.erase(std::remove_if(values.begin(), values.end(), [](double v) { return !std::isfinite(v); }), values.end());
  if (values.empty()) return not_known;
  std::sort(values.begin(), values.end());
  const double position = share * static_cast<double>(values.size() - 1);
  const std::size_t below = static_cast<std::size_t>(position);
  const std::size_t above = (std::min)(below + 1, values.size() - 1);
  const double part = position - static_cast<double>(below);
  return values[below] * (1 - part) + values[above] * part;
}

// Median over the seeds with its spread.
struct Spread {
  double median = not_known, minimum = not_known, maximum = not_known;
  std::size_t known = 0, total = 0;  // values that are finite; all
};

inline Spread spread_of(const std::vector<double>& values) {
  Spread s;
  s.total = values.size();
  for (const double v : values) {
    if (!std::isfinite(v)) continue;
    s.minimum = s.known == 0 ? v : (std::min)(s.minimum, v);
    s.maximum = s.known == 0 ? v : (std::max)(s.maximum, v);
    ++s.known;
  }
  s.median = quantile(values, 0.5);
  return s;
}

// How much smaller than `reference`, in percent of it: 100 (reference - value) / reference.
inline double improvement_percent(double reference, double value) {
  return reference > 0 && std::isfinite(reference) && std::isfinite(value) ? 100 * (reference - value) / reference
                                                                           : not_known;
}

}  // namespace cfp_slam
