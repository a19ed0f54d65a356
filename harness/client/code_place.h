// A place in the code of a library, in words that are the same in every process.
//
//   CodePlace place;
//   FindCode(signal->si_addr, place);
//   place.text();  // " at decoder.so+0x1a2b in Decode"; no "in" where the library hides its functions
#pragma once

#include <array>
#include <string>

namespace tiltproof::harness {

// Without a destructor and in arrays, because a handler of signals fills it, and another process reads it.
struct CodePlace {
  std::array<char, 150> at{};        // "decoder.so+0x1a2b"; empty: in no library
  std::array<char, 110> function{};  // empty: not known
  bool known() const { return at[0] != '\0'; }
  std::string text() const;
};

// `addr2line -f -e LIBRARY 0xOFFSET` understands `at`. Asks for no memory: that may be damaged.
void FindCode(const void* address, CodePlace& place);

// In the instruction that made the call which returns there: what follows it may be another function.
inline const void* CallBefore(const void* return_address) {
  return static_cast<const char*>(return_address) - 1;
}

}  // namespace tiltproof::harness
