// A progress line: in place on a terminal, now and then otherwise.
#pragma once

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <string>
#include <utility>

namespace cfp_examples {

class Progress {
 public:
  Progress(std::string what, std::size_t total) : what_(std::move(what)), total_(std::max<std::size_t>(total, 1)) {}

  void operator()(std::size_t done) {
    const auto now = std::chrono::steady_clock::now();
    const bool terminal = isatty(fileno(stderr)) == 1;
    if (std::chrono::duration<double>(now - last_).count() < (terminal ? 0.1 : 5.0) && done < total_) return;
    last_ = now;
    const double rate = double(done) / std::max(std::chrono::duration<double>(now - start_).count(), 1e-9);
    std::fprintf(stderr, "%s%s: %zu of %zu frames, %.1f frames/s, %.0f s left%s", terminal ? "\r\033[K" : "",
                 what_.c_str(), done, total_, rate, double(total_ - std::min(done, total_)) / rate,
                 terminal && done < total_ ? "" : "\n");
  }

 private:
  std::string what_;
  std::size_t total_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now(), last_ = start_;
};

}  // namespace cfp_examples
