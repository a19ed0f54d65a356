// The three lines, 8N1:
//   main       USART2, 921600 baud, both ways: sensors and actuators
//   reference  USART3, 921600 baud, receives: references from the base station or the joystick reader
//   console    USART1, 115200 baud, sends: log lines for a person
//
// Receivers put each byte into a ring from the interrupt, and wake the application only at a frame's flag (or
// when the ring fills): a wake-up for each byte would cost it ten times its work. Transmitters send from a
// ring, by interrupt.
#pragma once

#include <cstdint>
#include <span>

#include "firmware/port.h"
#include "firmware/ports/stm32f4/board.h"
#include "firmware/ports/stm32f4/byte_ring.h"

inline constexpr std::uint32_t kReceiveRingBytes = 256;   // 2.8 ms of line: two replies, one after the other
inline constexpr std::uint32_t kTransmitRingBytes = 128;  // two of the longest frames sent
inline constexpr std::uint32_t kConsoleRingBytes = 1024;  // the output of a start-up after a fault

// Global, under these names, so that tools that read the image find them.
extern tiltproof::stm32f4::ByteRing<kReceiveRingBytes> main_receive_ring;
extern tiltproof::stm32f4::ByteRing<kTransmitRingBytes> main_transmit_ring;
extern tiltproof::stm32f4::ByteRing<kReceiveRingBytes> reference_receive_ring;
extern tiltproof::stm32f4::ByteRing<kConsoleRingBytes> console_transmit_ring;

namespace tiltproof::stm32f4 {

inline constexpr std::uint32_t kLineBaud = 921'600;
inline constexpr std::uint32_t kConsoleBaud = 115'200;

// With 16 samples a bit the divider is the clock by the baud rate, in sixteenths included (RM0090, section
// 30.3.4): rounded.
constexpr std::uint32_t BaudDivider(std::uint32_t clock_hz, std::uint32_t baud) {
  return (clock_hz + baud / 2) / baud;
}
// One byte of 10 bits at the rate that the divider gives.
constexpr TimeNs ByteTimeNs(std::uint32_t clock_hz, std::uint32_t baud) {
  return 10 * kNsPerS * BaudDivider(clock_hz, baud) / clock_hz;
}

void StartUsarts();

// Passes bytes to the main line's transmitter: all of them or, when there is not enough room, none. Returns
// when the last stop bit will have left. May be called from any task.
TimeNs SendMain(std::span<const std::uint8_t> bytes);

// The same for the console, without the time.
void SendConsole(std::span<const std::uint8_t> bytes);

// Called from the interrupt when a receiver got a flag or its ring is three quarters full. Each image has its
// own.
void OnReceived(firmware::Uart uart);

}  // namespace tiltproof::stm32f4
