// SPDX-License-Identifier: MIT
#pragma once

#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstdlib>

#include <malloc.h>

#include <Eigen/Core>  // brings in headers of the compiler that declare these functions differently

/// Counts what a program allocates, however it does so: Eigen calls malloc itself, `operator new` ends in malloc, and
/// the functions here take the place of the C library's (glibc). To be included in one file of the program.
///
///     const test::AllocationCount count;
///     solver.step(...);
///     CHECK(count.so_far() == 0);
namespace test {

inline std::atomic<long> allocations{0};

/// What has been allocated, in any thread, since this was made.
class AllocationCount {
  public:
    long so_far() const { return allocations.load() - before_; }

  private:
    long before_ = allocations.load();
};

}  // namespace test

// What glibc's own functions do, under the names it keeps for this purpose.
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);

void* malloc(std::size_t size) noexcept {
    ++test::allocations;
    return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) noexcept {
    ++test::allocations;
    return __libc_calloc(count, size);
}
void* realloc(void* memory, std::size_t size) noexcept {
    ++test::allocations;
    return __libc_realloc(memory, size);
}
void* memalign(std::size_t alignment, std::size_t size) noexcept {
    ++test::allocations;
    return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
    ++test::allocations;
    return __libc_memalign(alignment, size);
}
int posix_memalign(void** memory, std::size_t alignment, std::size_t size) noexcept {
    ++test::allocations;
    *memory = __libc_memalign(alignment, size);
    return *memory == nullptr ? ENOMEM : 0;
}
}
