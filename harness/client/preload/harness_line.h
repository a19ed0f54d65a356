// The preloaded clock's end of the protocol of programs (docs/program.md).
//
//   Connect(getenv("TILTPROOF_SOCKET"));                                // hello, ready; then the first grant
//   const std::int64_t now_ns = Exchange(12'000'000, sink);  // waits until 12 ms, or until bytes have come
//
// Times are nanoseconds of the client's clock since power-on. Safe in a signal handler.
#pragma once

#include <cstddef>
#include <cstdint>

namespace tiltproof::preload {

inline constexpr std::int64_t kNever = INT64_MAX;
inline constexpr std::int64_t kSecond = 1'000'000'000;
inline constexpr int kUartsMax = 4;

struct UartRate {
  std::int64_t baud = 0, character_bits = 0;  // baud 0: bytes take no time
};

// Bytes that have arrived on a UART.
using ByteSink = void (*)(int uart, const unsigned char* bytes, std::size_t count);

// Connects, reads who to be, and says that it is ready. Returns null, or what went wrong.
const char* Connect(const char* path);
UartRate RateOf(int uart);

// Descriptors of this library: above those that a program uses, and below FD_SETSIZE.
inline constexpr int kOwnDescriptorMin = 900, kOwnDescriptorMax = 950;
// The descriptor, moved there when it can be.
int AboveOthers(int descriptor);
inline bool IsOwnDescriptor(long descriptor) {
  return descriptor >= kOwnDescriptorMin && descriptor < kOwnDescriptorMax;
}

// Gives bytes to the UART's transmitter; they leave with the next exchange.
void Transmit(int uart, std::int64_t now_ns, const unsigned char* bytes, std::size_t count);
void Log(std::int64_t now_ns, const char* text);
// Sends what has been given, although the program will not wait again.
void Flush();
// Says until when the program waits, and passes on the bytes that come first. Returns the time that it now has; does not return
// when the flight is over.
std::int64_t Exchange(std::int64_t until_ns, ByteSink sink);
// The first grant, before which there is nothing to wait for.
std::int64_t FirstGrant(ByteSink sink);
// Ends the program: it cannot be held. The reason becomes the flight's error.
[[noreturn]] void Refuse(const char* reason);

}  // namespace tiltproof::preload
