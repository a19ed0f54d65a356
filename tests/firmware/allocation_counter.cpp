#include "tests/firmware/allocation_counter.h"

#include <cstdlib>
#include <new>

namespace {
std::size_t allocation_count = 0;
}  // namespace

std::size_t tiltproof::firmware::AllocationCount() { return allocation_count; }

void* operator new(std::size_t size) {
  ++allocation_count;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  ++allocation_count;
  return std::malloc(size);
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, const std::nothrow_t&) noexcept { std::free(memory); }
