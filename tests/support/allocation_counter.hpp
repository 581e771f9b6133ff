// Counts every allocation of the process (operator new and malloc-backed Eigen storage alike go through operator new or
// are caught by the malloc hooks below), so that "allocates nothing" is a number and not a belief.
#pragma once

#include <cstddef>

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

}  // namespace cfp_test
