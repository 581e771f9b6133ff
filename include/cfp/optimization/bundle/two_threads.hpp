/// @file two_threads.hpp
/// A second thread for the algorithms of cfp that take an executor (bundle adjustment). The only header that starts a
/// thread: who does not include it does not need the thread library.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <thread>

#include "cfp/version.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// An executor with one helper thread, started by the constructor and joined by the destructor: keep it as long as you
/// keep the workspace. `executor(count, task)` calls task(0), …, task(count - 1), each on whichever of the two threads
/// comes to it first, and returns when all are done. On a busy machine, where the helper comes late, the caller does
/// all of them: it waits only for a task that the helper has begun. The helper looks for work for a few microseconds
/// (the phases of one solve follow each other closely) and then sleeps. One caller at a time; tasks must not throw.
/// Allocation: none per call.
class TwoThreads {
 public:
  TwoThreads() : helper_([this] { run(); }) {}
  ~TwoThreads() {
    post(nullptr, nullptr, 0);
    helper_.join();
  }
  TwoThreads(const TwoThreads&) = delete;
  TwoThreads& operator=(const TwoThreads&) = delete;

  template <typename Task>
  void operator()(int count, const Task& task) {
    if (count <= 1) {
      if (count == 1) task(0);
      return;
    }
    post([](const void* context, int i) { (*static_cast<const Task*>(context))(i); }, &task, count);
    work();
    std::unique_lock<std::mutex> lock(mutex_);
    finished_.wait(lock, [this] { return unfinished_ == 0; });
    call_ = nullptr;
  }

 private:
  using Call = void (*)(const void*, int);

  void post(Call call, const void* context, int count) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      call_ = call, context_ = context;
      next_ = 0, count_ = unfinished_ = count;
      stop_ = call == nullptr;
      posted_.fetch_add(1, std::memory_order_release);
    }
    requested_.notify_one();
  }
  /// Does tasks until none is left to begin.
  void work() {
    std::unique_lock<std::mutex> lock(mutex_);
    while (next_ < count_) {
      const int i = next_++;
      const Call call = call_;
      const void* const context = context_;
      lock.unlock();
      call(context, i);
      lock.lock();
      if (--unfinished_ == 0) finished_.notify_one();
    }
  }
  void run() {
    for (std::uint32_t seen = 0;;) {
      for (int look = 0; look < looks && posted_.load(std::memory_order_acquire) == seen; ++look) {
      }
      {
        std::unique_lock<std::mutex> lock(mutex_);
        requested_.wait(lock, [&] { return posted_.load(std::memory_order_relaxed) != seen; });
        seen = posted_.load(std::memory_order_relaxed);
        if (stop_) return;
      }
      work();
    }
  }

  static constexpr int looks = 1 << 13;
  std::mutex mutex_;  // guards all but posted_
  std::condition_variable requested_, finished_;
  std::atomic<std::uint32_t> posted_{0};
  Call call_ = nullptr;
  const void* context_ = nullptr;
  int next_ = 0, count_ = 0, unfinished_ = 0;
  bool stop_ = false;
  std::thread helper_;  // last: it uses the others
};

}  // namespace CFP_ISA
}  // namespace cfp
