#include "support/allocation_counter.hpp"

#include <cerrno>
#include <cstdlib>
#include <new>

namespace {
thread_local std::size_t count = 0, failing = 0;  // failing: the count at which there is no memory

// One more; whether it is to be had.
[[maybe_unused]] bool counted() noexcept { return ++count != failing; }
}  // namespace

namespace cfp_test {
std::size_t allocation_count() noexcept { return count; }
void fail_allocation(std::size_t k) noexcept { failing = k > 0 ? count + k : 0; }
}  // namespace cfp_test

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define CFP_TEST_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define CFP_TEST_SANITIZED 1
#endif
#endif

// Eigen allocates dynamic storage with malloc, the containers with operator new, which glibc's allocator serves through
// malloc as well: interposing malloc catches both. The sanitizers own malloc and offer a hook instead. Elsewhere only
// operator new is counted.
#if defined(CFP_TEST_SANITIZED)
// As in sanitizer/allocator_interface.h, which GCC's packages lack.
extern "C" int __sanitizer_install_malloc_and_free_hooks(void (*on_malloc)(const volatile void*, std::size_t),
                                                         void (*on_free)(const volatile void*));
namespace {
[[maybe_unused]] const int installed = __sanitizer_install_malloc_and_free_hooks(
    [](const volatile void*, std::size_t) { ++count; }, [](const volatile void*) {});
}
#elif defined(__GLIBC__)
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t n, std::size_t size);
void* __libc_realloc(void* pointer, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
void* malloc(std::size_t size) { return counted() ? __libc_malloc(size) : nullptr; }
void* calloc(std::size_t n, std::size_t size) { return counted() ? __libc_calloc(n, size) : nullptr; }
void* realloc(void* pointer, std::size_t size) { return counted() ? __libc_realloc(pointer, size) : nullptr; }
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  return counted() ? __libc_memalign(alignment, size) : nullptr;
}
int posix_memalign(void** pointer, std::size_t alignment, std::size_t size) {
  *pointer = counted() ? __libc_memalign(alignment, size) : nullptr;
  return *pointer != nullptr ? 0 : ENOMEM;
}
}
#else
void* operator new(std::size_t size) {
  void* const pointer = counted() ? std::malloc(size == 0 ? 1 : size) : nullptr;
  if (pointer != nullptr) return pointer;
  throw std::bad_alloc();
}
void operator delete(void* pointer) noexcept { std::free(pointer); }
void operator delete(void* pointer, std::size_t) noexcept { std::free(pointer); }
#endif
