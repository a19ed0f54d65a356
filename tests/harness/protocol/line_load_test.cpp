#include "harness/protocol/line_load.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "harness/scenario/shipped_protocols.h"
#include "header_protocols.h"
#include "link/cobs_framing.h"

namespace tiltproof::harness {
namespace {

// The bounds against frames of payloads that hold only one byte, each possible byte in turn, and of any length. A check
// may hold other bytes: it is left out.
TEST(LineLoad, FramesAreBetweenTheBoundsAndReachThem) {
  for (const link::Protocol& protocol : HeaderProtocols()) {
    if (protocol.framing->check_bytes() > 0) continue;
    for (const std::size_t size : {1U, 2U, 100U, 253U, 254U, 255U, 256U}) {
      const FrameBytes bounds = FrameBytesOf(*protocol.framing, size);
      std::size_t least = SIZE_MAX, most = 0;
      for (int byte = 0; byte < 256; ++byte) {
        const std::vector<std::uint8_t> payload(size, static_cast<std::uint8_t>(byte));
        const std::size_t bytes = protocol.framing->Encode(payload).size();
        least = std::min(least, bytes);
        most = std::max(most, bytes);
      }
      EXPECT_EQ(bounds.least, least) << protocol.name << " " << size;
      EXPECT_EQ(bounds.most, most) << protocol.name << " " << size;
    }
  }
}

TEST(LineLoad, ThePaperSendsTwoFramesAndGetsOneInEachPeriod) {
  const link::Protocol& paper = *FindProtocol("paper");
  // Flags and check are 4 bytes; the request has an id of 4, the actuators four numbers more, the reply 16.
  EXPECT_EQ(LineLoadOf(paper, link::Direction::kToPlant).bytes, (4 + 4) + (4 + 4 + 16));
  EXPECT_EQ(LineLoadOf(paper, link::Direction::kToClient).bytes, 4 + 64);
  EXPECT_EQ(LineLoadOf(paper, link::Direction::kReference).bytes, 4 + 28);
  EXPECT_EQ(LineLoadOf(paper, link::Direction::kToClient).bytes_max, 2 * (64 + 2) + 2);
  EXPECT_DOUBLE_EQ(LineTime_s(68, {.baud = 921600}), 680.0 / 921600);
  // A start bit, seven data bits, parity and two stop bits.
  EXPECT_DOUBLE_EQ(
      LineTime_s(68,
                 {.baud = 1000, .character = {.data_bits = 7, .parity = link::Parity::kOdd, .stop_bits = 2}}),
      68 * 0.011);
}

TEST(LineLoad, AStreamedMessageCountsByItsOwnPeriod) {
  link::Protocol protocol{.name = "stream",
                          .framing = link::MakeCobsFraming(link::CheckKind::kNone),
                          .control_period_ns = 4 * kNsPerMs,
                          .messages = {}};
  protocol.messages = {
      link::LayOut({.name = "baro",
                    .direction = link::Direction::kToClient,
                    .period_ns = 40 * kNsPerMs,
                    .fields = {{.signal = "pressure_pa", .type = link::NumberType::kU32}}}),
      link::LayOut(
          {.name = "unused", .direction = link::Direction::kToPlant, .fields = {{.signal = "f_n"}}})};
  EXPECT_DOUBLE_EQ(LineLoadOf(protocol, link::Direction::kToClient).bytes, (4 + 2) / 10.0);
  EXPECT_EQ(CountEachPeriod(protocol, protocol.messages[1]), std::nullopt);
  EXPECT_EQ(LineLoadOf(protocol, link::Direction::kToPlant).bytes, 0);
}

}  // namespace
}  // namespace tiltproof::harness
