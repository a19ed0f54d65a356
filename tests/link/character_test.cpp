// Characters and their time against a slow model of a UART, and against exact fractions.
#include "link/character.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "harness/scenario/shipped_protocols.h"
#include "link/protocol.h"
#include "link/wire.h"
#include "tests/support/uart_waveform.h"

namespace tiltproof::link {
namespace {

// GCC's and Clang's exact integers for the oracle.
__extension__ typedef __int128 Exact;

TEST(CharacterTest, EachByteHasTheBitsOfTheWaveform) {
  for (const UartFormat& uart : AllUartFormats()) {
    const CharacterFormat format = uart.ForLink();
    for (unsigned byte = 0; byte < 256; ++byte) {
      const auto levels = Levels(byte, uart);
      ASSERT_EQ(format.bit_count(), static_cast<std::int64_t>(levels.size())) << Name(format);
      const std::uint16_t word = format.WordOf(static_cast<std::uint8_t>(byte));
      for (std::int64_t bit = 0; bit < format.content_bits(); ++bit)
        ASSERT_EQ((word >> bit & 1) != 0, levels.at(static_cast<std::size_t>(bit) + 1))
            << Name(format) << " " << byte << " " << bit;
      ASSERT_EQ(format.Carried(static_cast<std::uint8_t>(byte)), Hear(levels, uart).byte);
    }
  }
}

// Any pattern of flipped bits between start bit and stop bits: the receiver notices an odd number of them.
TEST(CharacterTest, AnOddNumberOfFlippedBitsIsAParityError) {
  for (const UartFormat& uart : AllUartFormats()) {
    const CharacterFormat format = uart.ForLink();
    if (!format.has_parity()) continue;
    for (unsigned flips = 0; flips < 1U << format.content_bits(); ++flips) {
      auto levels = Levels(0x35, uart);
      for (std::size_t bit = 0; bit < static_cast<std::size_t>(format.content_bits()); ++bit)
        if ((flips >> bit & 1) != 0) levels[bit + 1] = !levels[bit + 1];
      ASSERT_EQ(Hear(levels, uart).parity_error, std::popcount(flips) % 2 == 1) << Name(format) << flips;
    }
  }
}

TEST(CharacterTest, NamesAreTheUsualOnes) {
  EXPECT_EQ(Name(CharacterFormat{}), "8N1");
  EXPECT_EQ(Name(CharacterFormat{.data_bits = 7, .parity = Parity::kEven, .stop_bits = 2}), "7E2");
  EXPECT_EQ(Name(CharacterFormat{.parity = Parity::kOdd}), "8O1");
}

CharacterFormat AnyFormat() {
  const auto all = AllUartFormats();
  return all.at(*rc::gen::inRange<std::size_t>(0, all.size())).ForLink();
}
std::int64_t AnyBaud() {
  return *rc::gen::oneOf(rc::gen::element<std::int64_t>(921'600, 115'200, 1'200, 10'000'000),
                         rc::gen::inRange<std::int64_t>(1'200, 10'000'000));
}

// A transmitter that is never idle, in pieces of any size: after n bytes it is n * bits / baud after its begin, rounded
// down to nanoseconds, however long it has been busy. Rounding does not add up.
RC_GTEST_PROP(CharacterPropertyTest, ABusyTransmitterDoesNotDrift, ()) {
  const CharacterFormat format = AnyFormat();
  const std::int64_t baud = AnyBaud();
  Wire wire({.baud = baud, .character = format}, Direction::kToPlant, *harness::FindProtocol("paper"),
            nullptr);
  const BootTime begin(*rc::gen::inRange<TimeNs>(0, kNsPerS));
  const std::vector<std::uint8_t> bytes(900, 1);
  Exact count = 0;
  BootTime free = begin;
  // More than the bytes after which the wire counts from a new begin, at the slower rates.
  for (int piece = 0; piece < 60; ++piece) {
    const auto size = static_cast<std::size_t>(*rc::gen::inRange(1, 900));
    free = wire.Transmit(piece == 0 ? begin : free, std::span(bytes).first(size));
    count += static_cast<Exact>(size);
    RC_ASSERT(static_cast<Exact>(free - begin) == count * format.bit_count() * kNsPerS / baud);
    wire.Take(free, [](BootTime, std::span<const std::uint8_t>) {});
  }
}

// Each byte of a chunk arrives less than a nanosecond before its last stop bit ends.
RC_GTEST_PROP(CharacterPropertyTest, EachByteArrivesWhenItsLastStopBitEnds, ()) {
  const CharacterFormat format = AnyFormat();
  const std::int64_t baud = AnyBaud();
  const LineRate rate{baud, format};
  const auto bytes_count = *rc::gen::inRange<std::int64_t>(1, 1'000'000);
  const Exact late = static_cast<Exact>(bytes_count) * format.bit_count() * kNsPerS -
                     static_cast<Exact>(rate.BytesTime(bytes_count)) * baud;
  RC_ASSERT(late >= 0 && late < baud);
}

TEST(CharacterTest, SevenDataBitsLoseTheTopBit) {
  Wire wire({.character = {.data_bits = 7}}, Direction::kToPlant, *harness::FindProtocol("paper"), nullptr);
  const std::vector<std::uint8_t> sent = {0x7E, 0x81, 0xFF, 0x12, 0x7E};
  const BootTime end = wire.Transmit(BootTime(), sent);
  EXPECT_EQ(end.ns(), 5LL * 9 * kNsPerS / 921'600);
  std::vector<std::uint8_t> received;
  wire.Take(end, [&](BootTime, std::span<const std::uint8_t> bytes) {
    received.insert(received.end(), bytes.begin(), bytes.end());
  });
  EXPECT_EQ(received, (std::vector<std::uint8_t>{0x7E, 0x01, 0x7F, 0x12, 0x7E}));
}

}  // namespace
}  // namespace tiltproof::link
