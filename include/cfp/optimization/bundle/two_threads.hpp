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

/// An executor with one helper thread, started by the constructor and joined by the destructor: keep it as long as you
/// keep the workspace. `executor(count, task)` calls task(0), …, task(count - 1), even ones on the calling thread and
/// odd ones on the helper, and returns when all are done. The helper waits a few microseconds awake (the phases of one
/// solve follow each other closely) and then sleeps. One caller at a time; tasks must not throw. Allocation: none per
/// call.
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
    if (count > 1) post([](const void* context, int i) { (*static_cast<const Task*>(context))(i); }, &task, count);
    for (int i = 0; i < count; i += 2) task(i);
    if (count > 1) await(done_, posted_);
  }

 private:
  using Call = void (*)(const void*, int);

  void post(Call call, const void* context, int count) {
    call_ = call;
    context_ = context;
    count_ = count;
    ++posted_;
    announce(requested_, posted_);
  }
  void run() {
    for (std::uint32_t next = 1;; ++next) {
      await(requested_, next);
      if (call_ == nullptr) return;
      for (int i = 1; i < count_; i += 2) call_(context_, i);
      announce(done_, next);
    }
  }
  void announce(std::atomic<std::uint32_t>& counter, std::uint32_t value) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      counter.store(value, std::memory_order_release);
    }
    changed_.notify_one();
  }
  void await(std::atomic<std::uint32_t>& counter, std::uint32_t value) {
    for (int spin = 0; spin < spins; ++spin) {
      if (counter.load(std::memory_order_acquire) == value) return;
      if (spin % 64 == 63) std::this_thread::yield();
    }
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait(lock, [&] { return counter.load(std::memory_order_acquire) == value; });
  }

  static constexpr int spins = 1 << 14;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::atomic<std::uint32_t> requested_{0}, done_{0};
  std::uint32_t posted_ = 0;  // by the caller only
  Call call_ = nullptr;
  const void* context_ = nullptr;
  int count_ = 0;
  std::thread helper_;  // last: it uses the others
};

}  // namespace cfp
