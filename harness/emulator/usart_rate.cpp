#include "harness/emulator/usart_rate.h"

#include <cmath>

namespace tiltproof::harness {
namespace {

constexpr std::uint32_t kOver8 = 1U << 15, kNineBits = 1U << 12, kParityOn = 1U << 10,
                        kOddParity = 1U << 9;     // CR1
constexpr std::uint32_t kTwoStopBits = 1U << 13;  // CR2, STOP
constexpr std::uint32_t kOneBit = 1U << 11;       // CR3

}  // namespace

UsartRate RateOf(std::int64_t clock_hz, std::uint32_t brr, std::uint32_t cr1, std::uint32_t cr3) {
  const bool over8 = (cr1 & kOver8) != 0, nine_bits = (cr1 & kNineBits) != 0, one_bit = (cr3 & kOneBit) != 0;
  const std::uint32_t mantissa = (brr >> 4) & 0xFFF;
  const std::uint32_t fraction = brr & (over8 ? 7U : 15U);
  // By DIV_Fraction (0, or not), M, OVER8, ONEBIT: the reference manual's two tables.
  constexpr double kTolerance[2][2][2][2] = {
      {{{0.0375, 0.04375}, {0.025, 0.0375}}, {{0.0341, 0.0397}, {0.0227, 0.0341}}},
      {{{0.0333, 0.0388}, {0.02, 0.03}}, {{0.0303, 0.0353}, {0.0182, 0.0273}}}};
  return {.clock_hz = clock_hz,
          .clocks_per_bit = mantissa * (over8 ? 8 : 16) + fraction,
          .tolerance = kTolerance[fraction != 0][nine_bits][over8][one_bit]};
}

link::CharacterFormat FormatOf(std::uint32_t cr1, std::uint32_t cr2) {
  const bool has_parity = (cr1 & kParityOn) != 0;
  const link::Parity parity = (cr1 & kOddParity) != 0 ? link::Parity::kOdd : link::Parity::kEven;
  return {.data_bits = ((cr1 & kNineBits) != 0 ? 9 : 8) - (has_parity ? 1 : 0),
          .parity = has_parity ? parity : link::Parity::kNone,
          .stop_bits = (cr2 & kTwoStopBits) != 0 ? 2 : 1};
}

bool Understands(double receiver_bit_ns, double tolerance, double sender_bit_ns) {
  return std::abs(sender_bit_ns - receiver_bit_ns) <= tolerance * receiver_bit_ns;
}

}  // namespace tiltproof::harness
