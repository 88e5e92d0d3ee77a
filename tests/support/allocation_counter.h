// Counts the calls of operator new of the test program. Include it in one source file of a program.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>

namespace plumb::testing {

inline std::atomic<size_t> num_allocations{0};
/// Set: allocations of threads that have not claimed memory fail.
inline std::atomic<bool> memory_is_out{false};
inline thread_local bool has_memory = false;

inline void* CountedAllocation(std::size_t size, std::size_t alignment) {
  num_allocations.fetch_add(1, std::memory_order_relaxed);
  if (memory_is_out && !has_memory) throw std::bad_alloc();
  void* memory =
      alignment <= alignof(std::max_align_t)
          ? std::malloc(size == 0 ? 1 : size)
          : std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

}  // namespace plumb::testing

void* operator new(std::size_t size) { return plumb::testing::CountedAllocation(size, 1); }
void* operator new[](std::size_t size) { return plumb::testing::CountedAllocation(size, 1); }
void* operator new(std::size_t size, std::align_val_t alignment) {
  return plumb::testing::CountedAllocation(size, static_cast<std::size_t>(alignment));
}
void* operator new[](std::size_t size, std::align_val_t alignment) {
  return plumb::testing::CountedAllocation(size, static_cast<std::size_t>(alignment));
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
