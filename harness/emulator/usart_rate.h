// The programmed rate of an STM32F405's USART (RM0090, section 30.3.4), how far a sender's rate may be from it (section
// 30.3.5), and the programmed character.
//
//   const UsartRate rate = RateOf(registers.clock_hz, registers.brr, registers.cr1, registers.cr3);
//   if (!Understands(rate.BitNs(), rate.tolerance, sender_bit_ns)) ...
#pragma once

#include <cstdint>

#include "link/character.h"

namespace tiltproof::harness {

// USART1 to USART3, UART4, UART5 and USART6.
inline constexpr int kChipUsartCount = 6;

struct UsartRate {
  std::int64_t clock_hz = 0;
  std::int64_t clocks_per_bit = 0;  // 0: none is programmed, and the USART does not work
  double tolerance = 0.0;           // of the receiver, as a share of the rate

  bool Runs() const { return clocks_per_bit != 0; }
  double Baud() const {
    return Runs() ? static_cast<double>(clock_hz) / static_cast<double>(clocks_per_bit) : 0.0;
  }
  double BitNs() const { return static_cast<double>(clocks_per_bit) * 1e9 / static_cast<double>(clock_hz); }
};

// `clock_hz`: of the USART's bus, APB1 or APB2.
UsartRate RateOf(std::int64_t clock_hz, std::uint32_t brr, std::uint32_t cr1, std::uint32_t cr3);

// The programmed character (sections 30.3.7, 30.6.4 and 30.6.5). M gives the data bits with the parity bit among them, so
// that there may be 7 to 9. Half a stop bit counts as one, and one and a half as two: they are for smart cards.
link::CharacterFormat FormatOf(std::uint32_t cr1, std::uint32_t cr2);

// Tolerance of a receiver at the other end, whose divider has no fraction: 16 samples per bit, three of them
// used.
inline constexpr double kUsualTolerance = 0.0375;

// True if a receiver with this bit time reads the bits of a sender with that one correctly.
bool Understands(double receiver_bit_ns, double tolerance, double sender_bit_ns);

}  // namespace tiltproof::harness
