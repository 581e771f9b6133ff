// Counts every allocation of the process (operator new and malloc-backed Eigen storage alike go through operator new or
// are caught by the malloc hooks below), so that "allocates nothing" is a number and not a belief.
#pragma once

#include <cstddef>
#include <new>

namespace cfp_test {

/// Allocations by this thread since the program started.
std::size_t allocation_count() noexcept;

/// Allocations made while `work` runs.
template <typename Work>
std::size_t allocations_in(Work&& work) {
  const std::size_t before = allocation_count();
  work();
  return allocation_count() - before;
}

/// From here on this thread's k-th allocation fails, once; 0: none. Without effect under sanitizers that own malloc.
void fail_allocation(std::size_t k) noexcept;

/// Runs work(make()) with the first, the second, ... allocation failing until it needs no more, and check(object) after
/// each that failed. Returns how many did.
template <typename Make, typename Work, typename Check>
std::size_t without_memory(const Make& make, const Work& work, const Check& check) {
  for (std::size_t k = 1;; ++k) {
    auto object = make();
    bool failed = false;
    fail_allocation(k);
    try {
      work(object);
    } catch (const std::bad_alloc&) {
      failed = true;
    }
    fail_allocation(0);
    if (!failed) return k - 1;
    check(object);
  }
}

}  // namespace cfp_test
