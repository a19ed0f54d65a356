// Where in a library an address is, in words that are the same in every process.
//
//   std::array<char, 300> text;
//   DescribeCode(signal->si_addr, text);  // " at decoder.so+0x1a2b in Decode"; no "in" where the library hides its functions
#pragma once

#include <span>

namespace tiltproof::harness {

// `addr2line -f -e LIBRARY 0xOFFSET` understands it. Empty when the address is in no library. Asks for no memory: that may
// be damaged.
void DescribeCode(const void* address, std::span<char> text);

// In the instruction that made the call which returns there: what follows it may be another function.
inline const void* CallBefore(const void* return_address) {
  return static_cast<const char*>(return_address) - 1;
}

}  // namespace tiltproof::harness
