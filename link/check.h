// Invariants, checked in every build: what our own code must keep, never what a user, a firmware or another program may get
// wrong. A broken one ends the flight with a verdict of "error" that names the place; it is never the firmware's failure.
//
//   Check(now >= last_ns_, "the sender's time never goes back");
//
//   broken invariant at link/wire.cpp:65: the sender's time never goes back
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>

namespace tiltproof {

class BrokenInvariant : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

// Throws BrokenInvariant. Also for what cannot be reached: a value that its enumeration does not have.
[[noreturn, gnu::cold]] inline void ThrowBrokenInvariant(const std::string& expected,
                                                         const char* file = __builtin_FILE(),
                                                         int line = __builtin_LINE()) {
  throw BrokenInvariant("broken invariant at " + std::string(file) + ":" + std::to_string(line) + ": " +
                        expected);
}

// The place is the caller's: std::source_location, as clang 14 has it.
inline void Check(bool holds, const char* expected, const char* file = __builtin_FILE(),
                  int line = __builtin_LINE()) {
  if (!holds) [[unlikely]]
    ThrowBrokenInvariant(expected, file, line);
}

[[noreturn, gnu::cold]] inline void ThrowBadIndex(std::size_t index, std::size_t size, const char* expected,
                                                  const char* file, int line) {
  ThrowBrokenInvariant(expected + (" (index " + std::to_string(index)) + " of " + std::to_string(size) + ")",
                       file, line);
}

// Checks an index before the access. The message has both numbers.
//
//   CheckIndex(2, frame.size(), "a byte is one of its frame");
//
//   broken invariant at faults/bits.h:24: a byte is one of its frame (index 2 of 1)
inline void CheckIndex(std::size_t index, std::size_t size, const char* expected,
                       const char* file = __builtin_FILE(), int line = __builtin_LINE()) {
  if (index >= size) [[unlikely]]
    ThrowBadIndex(index, size, expected, file, line);
}

// Checks a part [offset, offset + count) of `size` elements before the access. Never overflows.
//
//   CheckPart(0, 4, payload.size(), "a number is inside its payload");
inline void CheckPart(std::size_t offset, std::size_t count, std::size_t size, const char* expected,
                      const char* file = __builtin_FILE(), int line = __builtin_LINE()) {
  if (offset > size || count > size - offset) [[unlikely]]
    ThrowBadIndex(offset + count, size, expected, file, line);
}

}  // namespace tiltproof
