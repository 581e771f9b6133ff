// A progress bar on a terminal, a plain line now and then otherwise.
#pragma once

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <string>
#include <utility>

namespace cfp_slam {

class Progress {
 public:
  Progress(std::string what, std::size_t total)
      : what_(std::move(what)), total_(std::max<std::size_t>(total, 1)), terminal_(isatty(fileno(stderr)) == 1) {}
  ~Progress() {
    if (terminal_ && shown_) std::fprintf(stderr, "\r\033[K");
  }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void operator()(std::size_t done) {
    const auto now = std::chrono::steady_clock::now();
    const double seconds = std::chrono::duration<double>(now - start_).count(),
                 since = std::chrono::duration<double>(now - last_).count();
    if (since < (terminal_ ? 0.1 : 5.0) && done < total_) return;
    last_ = now;
    const double rate = seconds > 0 ? double(done) / seconds : 0,
                 left = rate > 0 ? double(total_ - std::min(done, total_)) / rate : 0;
    if (terminal_) {
      shown_ = true;
      constexpr std::size_t width = 30;
      const std::size_t filled = width * std::min(done, total_) / total_;
      std::fprintf(stderr, "\r\033[K%s [%s%s] %zu/%zu  %.1f frames/s  %.0f s left", what_.c_str(),
                   std::string(filled, '#').c_str(), std::string(width - filled, '.').c_str(), done, total_, rate,
                   left);
    } else {
      std::fprintf(stderr, "%s: %zu of %zu frames, %.1f frames/s, %.0f s left\n", what_.c_str(), done, total_, rate,
                   left);
    }
  }

 private:
  std::string what_;
  std::size_t total_;
  bool terminal_, shown_ = false;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now(), last_ = start_;
};

}  // namespace cfp_slam
