/// @file two_threads.hpp
/// A second thread for the algorithms of cfp that take an executor (bundle adjustment). The only header that starts a
/// thread: who does not include it does not need the thread library.
#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

#include "cfp/version.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// An executor with one helper thread, started by the constructor and joined by the destructor: keep it as long as you
/// keep the workspace. `executor(count, task)` calls task(0), …, task(count - 1), each on whichever of the two threads
/// comes to it first, and returns when all are done. On a busy machine, where the helper comes late, the caller does
/// all of them: it waits only for a task that the helper has begun. One caller at a time; tasks must not throw.
/// Allocation: none per call.
class TwoThreads {
 public:
  TwoThreads() : helper_([this] { run(); }) {}
  ~TwoThreads() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stop_ = true;
    }
    requested_.notify_one();
    helper_.join();
  }
  TwoThreads(const TwoThreads&) = delete;
  TwoThreads& operator=(const TwoThreads&) = delete;

  template <typename Task>
  void operator()(int count, const Task& task) {
    std::unique_lock<std::mutex> lock(mutex_);
    task_ = std::cref(task);
    next_ = 0, count_ = unfinished_ = count;
    requested_.notify_one();
    work(lock);
    finished_.wait(lock, [this] { return unfinished_ == 0; });
  }

 private:
  /// Does tasks until none is left to begin.
  void work(std::unique_lock<std::mutex>& lock) {
    while (next_ < count_) {
      const int i = next_++;
      lock.unlock();
      task_(i);
      lock.lock();
      if (--unfinished_ == 0) finished_.notify_one();
    }
  }
  void run() {
    std::unique_lock<std::mutex> lock(mutex_);
    while (!stop_) {
      work(lock);
      requested_.wait(lock, [this] { return stop_ || next_ < count_; });
    }
  }

  std::mutex mutex_;  // guards what follows
  std::condition_variable requested_, finished_;
  std::function<void(int)> task_;  // a reference, which fits in without allocation
  int next_ = 0, count_ = 0, unfinished_ = 0;
  bool stop_ = false;
  std::thread helper_;  // last: it uses the others
};

}  // namespace CFP_ISA
}  // namespace cfp
