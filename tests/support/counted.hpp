// A number that counts how often it is compared: what a promise of linear time costs, without a clock.
#pragma once

#include <cstddef>
#include <limits>

namespace cfp_test {

struct Counted {
  double value = 0;

  static std::size_t& comparisons() {
    static std::size_t count = 0;
    return count;
  }

  Counted() = default;
  template <typename Number>
  explicit Counted(Number number) : value(static_cast<double>(number)) {}
  explicit operator std::size_t() const { return static_cast<std::size_t>(value); }

  friend Counted operator-(Counted a, Counted b) { return Counted(a.value - b.value); }
  friend Counted operator*(Counted a, Counted b) { return Counted(a.value * b.value); }
  friend Counted operator/(Counted a, Counted b) { return Counted(a.value / b.value); }
  friend bool operator<(Counted a, Counted b) { return ++comparisons(), a.value < b.value; }
  friend bool operator>(Counted a, Counted b) { return ++comparisons(), a.value > b.value; }
  friend bool operator<=(Counted a, Counted b) { return ++comparisons(), a.value <= b.value; }
  friend bool operator>=(Counted a, Counted b) { return ++comparisons(), a.value >= b.value; }
};

}  // namespace cfp_test

template <>
class std::numeric_limits<cfp_test::Counted> : public std::numeric_limits<double> {
 public:
  static cfp_test::Counted(max)() { return cfp_test::Counted((std::numeric_limits<double>::max)()); }
  static cfp_test::Counted(lowest)() { return cfp_test::Counted(std::numeric_limits<double>::lowest()); }
};
