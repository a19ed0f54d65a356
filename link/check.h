// Invariants, checked in every build: what our own code must keep, never what a user, a firmware or another program may get
// wrong. A broken one ends the flight with a verdict of "error" that names the place; it is never the firmware's failure.
//
//   Check(now >= last_ns_, "the sender's time never goes back");
//
//   broken invariant at link/wire.cpp:65: the sender's time never goes back
#pragma once

#include <source_location>
#include <stdexcept>
#include <string>

namespace tiltproof {

class BrokenInvariant : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

// Throws BrokenInvariant. Also for what cannot be reached: a value that its enumeration does not have.
[[noreturn, gnu::cold]] inline void ThrowBrokenInvariant(
    const std::string& expected, std::source_location where = std::source_location::current()) {
  throw BrokenInvariant(std::string("broken invariant at ") + where.file_name() + ":" +
                        std::to_string(where.line()) + ": " + expected);
}

inline void Check(bool holds, const char* expected,
                  std::source_location where = std::source_location::current()) {
  if (!holds) [[unlikely]]
    ThrowBrokenInvariant(expected, where);
}

}  // namespace tiltproof
