// Boards of the emulator: which end of a frame stops them, so that their line can be answered.
#include "harness/client/firmware_files.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <utility>
#include <variant>

#include "harness/scenario/shipped_protocols.h"
#include "link/cobs_framing.h"
#include "link/length_framing.h"

namespace tiltproof::harness {
namespace {

link::FrameEnd EndOf(std::shared_ptr<const link::Framing> framing) {
  link::Protocol protocol = *FindProtocol("paper");
  protocol.framing = std::move(framing);
  return BoardOf({.file = "mine.elf"}, "paper", protocol).frame_end;
}

TEST(BoardOf, TheEndIsTheFlagOfTheFraming) {
  EXPECT_EQ(std::get<std::uint8_t>(EndOf(link::HdlcFraming())), 0x7E);
  EXPECT_EQ(std::get<std::uint8_t>(EndOf(link::MakeCobsFraming(link::CheckKind::kCrc16Ibm3740))), 0);
}

TEST(BoardOf, OrTheLengthInFront) {
  const auto header = std::get<link::LengthHeader>(EndOf(
      link::MakeLengthFraming({.sync = {0xAA, 0x55}, .length_bytes = 2}, link::CheckKind::kCrc32IsoHdlc)));
  EXPECT_EQ(header.sync_count, 2U);
  EXPECT_EQ(header.sync[0], 0xAA);
  EXPECT_EQ(header.sync[1], 0x55);
  EXPECT_EQ(header.length_bytes, 2U);
  EXPECT_EQ(header.payload_bytes_max, link::kPayloadBytesMax);
  EXPECT_EQ(header.check_bytes, 4U);
}

}  // namespace
}  // namespace tiltproof::harness
