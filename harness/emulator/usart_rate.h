// The rate that an STM32F405's USART is programmed to (RM0090, section 30.3.4), and how far a sender's may be from it
// (section 30.3.5).
//
//   const UsartRate rate = RateOf(2, registers.brr, registers.cr1, registers.cr3);
//   if (!rate.Understands(921'600)) ...
#pragma once

#include <cstdint>

namespace tiltproof::harness {

struct UsartRate {
  std::int64_t clock_hz = 0;
  std::int64_t clocks_per_bit = 0;  // 0: none is programmed, and the USART stands still
  double tolerance = 0.0;           // of the receiver, as a share of the rate

  bool Runs() const { return clocks_per_bit != 0; }
  double Baud() const {
    return Runs() ? static_cast<double>(clock_hz) / static_cast<double>(clocks_per_bit) : 0.0;
  }
  double BitNs() const { return static_cast<double>(clocks_per_bit) * 1e9 / static_cast<double>(clock_hz); }
};

// `usart`: 1 to 6. The clock tree is taken as it should be: 168 MHz for the core, 42 MHz for APB1, 84 MHz for APB2.
UsartRate RateOf(int usart, std::uint32_t brr, std::uint32_t cr1, std::uint32_t cr3);

// Of a receiver at the other end, whose divider has no fraction: 16 samples a bit, three of them taken.
inline constexpr double kUsualTolerance = 0.0375;

// Whether a receiver with this bit time takes the bits of a sender with that one for what they are.
bool Understands(double receiver_bit_ns, double tolerance, double sender_bit_ns);

}  // namespace tiltproof::harness
