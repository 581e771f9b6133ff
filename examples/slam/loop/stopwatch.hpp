// Milliseconds per module of one frame.
#pragma once

#include <array>
#include <chrono>

#include "../record.hpp"

namespace cfp_slam {

class Stopwatch {
 public:
  explicit Stopwatch(std::array<double, module_count>& milliseconds) : milliseconds_(&milliseconds) {}
  // The time since the last lap, or since the construction, goes to the module.
  void lap(Module module) {
    const auto now = std::chrono::steady_clock::now();
    (*milliseconds_)[static_cast<std::size_t>(module)] +=
        std::chrono::duration<double, std::milli>(now - last_).count();
    last_ = now;
  }

 private:
  std::array<double, module_count>* milliseconds_;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

}  // namespace cfp_slam
