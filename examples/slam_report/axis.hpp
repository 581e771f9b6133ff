// Axes of the plots: ranges, ticks at round numbers, linear and logarithmic scales.
#pragma once

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "html.hpp"

namespace cfp_slam {

struct Range {
  Range(std::initializer_list<double> values = {}) {
    for (const double v : values) add(v);
  }
  double low = 0, high = 0;
  bool empty = true;
  void add(double value) {
    if (!std::isfinite(value) || std::abs(value) > 1e12) return;
    low = empty ? value : (std::min)(low, value);
    high = empty ? value : (std::max)(high, value);
    empty = false;
  }
  [[nodiscard]] double size() const { return high - low; }
};

struct Tick {
  double value;
  std::string label;
};

// About `count` ticks at 1, 2 or 5 times a power of ten.
inline std::vector<Tick> ticks(double low, double high, int count) {
  std::vector<Tick> out;
  const double rough = (high - low) / count;
  if (!(rough > 0) || !std::isfinite(rough)) return out;
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  const double part = rough / power;
  const double step = power * (part < 1.5 ? 1 : part < 3.5 ? 2 : part < 7.5 ? 5 : 10);
  const int decimals = (std::max)(0, static_cast<int>(-std::floor(std::log10(step) + 1e-9)));
  for (double k = std::ceil(low / step - 1e-9); k * step <= high + 1e-9 * step && out.size() < 50; ++k) {
    out.push_back({k * step, number(k * step, decimals)});
  }
  return out;
}

// Powers of ten from low to high, and 2 and 5 times them when there are few.
inline std::vector<Tick> log_ticks(double low, double high) {
  std::vector<Tick> out;
  const bool few = high / low < 50;
  for (int exponent = static_cast<int>(std::floor(std::log10(low))); exponent <= std::log10(high) && out.size() < 50;
       ++exponent) {
    for (const double factor : {1.0, 2.0, 5.0}) {
      const double value = factor * std::pow(10.0, exponent);
      if ((factor > 1 && !few) || value < low * 0.999 || value > high * 1.001) continue;
      out.push_back({value, cfp_examples::general(value, 6)});
    }
  }
  return out;
}

struct Axis {
  double low = 0, high = 1;
  std::string label;
  bool logarithmic = false;
  std::vector<Tick> marks;

  // 0 to 1 inside; what lies outside stays at the border.
  [[nodiscard]] double place(double value) const {
    const double share =
        logarithmic ? std::log((std::max)(value, low) / low) / std::log(high / low) : (value - low) / (high - low);
    return (std::min)((std::max)(0.0, share), 1.0);  // in this order not a number is 0
  }
};

inline Axis linear_axis(Range range, std::string label, int tick_count = 6) {
  if (range.empty) range.add(0);
  if (!(range.size() > 1e-9 * (std::max)(std::abs(range.low), 1.0))) range.high = range.low + 1;
  return {range.low, range.high, std::move(label), false, ticks(range.low, range.high, tick_count)};
}

// Four decades at most.
inline Axis log_axis(Range range, std::string label) {
  const double high = range.high > 0 ? range.high * 1.1 : 1;
  const double low = (std::min)((std::max)(range.low, high * 1e-4), high / 3);
  return {low, high, std::move(label), true, log_ticks(low, high)};
}

}  // namespace cfp_slam
