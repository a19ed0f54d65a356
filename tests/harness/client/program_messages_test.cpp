// Both ends of the protocol of programs against the bytes of docs/program.md.
#include "harness/client/program_messages.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

namespace tiltproof::harness {
namespace {

using ::testing::ElementsAreArray;
using ::testing::HasSubstr;
using Bytes = std::vector<std::uint8_t>;

Bytes Hex(std::string_view text) {
  Bytes bytes;
  std::string digits;
  for (const char c : text) {
    if (c != ' ') digits += c;
    if (digits.size() < 2) continue;
    bytes.push_back(static_cast<std::uint8_t>(std::stoi(digits, nullptr, 16)));
    digits.clear();
  }
  return bytes;
}

std::string Refusal(std::string_view hex) {
  ProgramReader reader;
  reader.Add(Hex(hex));
  try {
    while (reader.Next()) {
    }
  } catch (const BrokenProtocol& broken) {
    return broken.what();
  }
  return "";
}

TEST(ProgramMessages, AreTheBytesOfThePage) {
  Bytes out;
  AppendGrant(12'000'000, false, out);
  EXPECT_THAT(out, ElementsAreArray(Hex("08000000 02 00 00 00  001BB70000000000")));
  out.clear();
  AppendHello({.uarts = {{.baud = 921600}, {.baud = 0}}, .firmware = "a", .dialect = "", .parameters = "{}"},
              out);
  EXPECT_THAT(out, ElementsAreArray(
                       Hex("27000000 01 00 00 00  01000000 02000000  00100E00 0A000000  00000000 0A000000"
                           "01000000 61  00000000  02000000 7B7D")));
  out.clear();
  AppendBytes(1, -1, Hex("7E"), true, out);
  AppendReset(0, true, out);
  AppendSent(0, 1, out);
  AppendEnd(out);
  AppendComputed(2, out);
  EXPECT_THAT(out, ElementsAreArray(
                       Hex("09000000 03 01 01 00 FFFFFFFFFFFFFFFF 7E  08000000 04 00 01 00 0000000000000000"
                           "08000000 05 00 00 00 0100000000000000  00000000 06 00 00 00"
                           "08000000 07 00 00 00 0200000000000000")));
}

TEST(ProgramMessages, AreReadInAnyPieces) {
  const Bytes stream =
      Hex("04000000 81 00 03 00 01000000  0A000000 83 01 01 00 001BB70000000000 7E01  08000000 84 00 00 00 "
          "02000000 03000000"
          "00000000 85 02 00 00  0A000000 86 00 00 00 0500000000000000 6869  08000000 82 00 00 00 "
          "FFFFFFFFFFFFFF7F"
          "03000000 87 00 00 00 6E6F00"
          "18000000 88 00 00 00 0100000000000000 0200000000000000 FFFFFFFFFFFFFF7F");
  for (std::size_t piece = 1; piece <= stream.size(); ++piece) {
    ProgramReader reader;
    std::string seen;
    for (std::size_t at = 0; at < stream.size(); at += piece) {
      reader.Add(std::span(stream).subspan(at, std::min(piece, stream.size() - at)));
      while (const auto message = reader.Next()) {
        seen += std::to_string(static_cast<int>(message->kind) - 0x80) + ":" +
                std::to_string(message->number) + ":" + std::to_string(message->time_ns) + ":" +
                std::string(message->text) + ":" + std::to_string(message->bytes.size()) + ":" +
                std::to_string(message->version) + std::to_string(message->supervisor_state) +
                std::to_string(message->failsafe_count) + (message->ask ? "?" : "") +
                (message->tells_status ? "s" : "") +
                (message->length_ns != 0
                     ? std::to_string(message->length_ns) + "," + std::to_string(message->deadline_ns)
                     : "") +
                " ";
      }
    }
    EXPECT_EQ(seen,
              "1:0:0::0:100s 3:1:12000000::2:000? 4:0:0::0:023 5:2:0::0:000 6:0:5:hi:0:000 "
              "2:0:9223372036854775807::0:000 7:0:0:no:0:000 8:0:1::0:0002,9223372036854775807 ");
    EXPECT_EQ(reader.offset(), stream.size());
  }
}

TEST(ProgramMessages, AreRefusedWithTheirBytesAndOffset) {
  EXPECT_THAT(
      Refusal("08000000 82 00 00 00 0000000000000000 DEADBEEF 07 00 00 00"),
      HasSubstr("kind 7, which no program sends, at byte 16 of what it sent (de ad be ef 07 00 00 00)"));
  EXPECT_THAT(Refusal("08000000 02 00 00 00"), HasSubstr("kind 2"));
  EXPECT_THAT(Refusal("09000000 82 00 00 00"), HasSubstr("a body of 9 bytes for kind 130, which has 8,"));
  EXPECT_THAT(Refusal("08000000 83 00 00 00"),
              HasSubstr("a body of 8 bytes for kind 131, which has at least 9,"));
  EXPECT_THAT(Refusal("01001000 83 00 00 00"), HasSubstr("a body of 1048577 bytes"));
  EXPECT_THAT(Refusal("FFFFFFFF 86 00 00 00"), HasSubstr("a body of 4294967295 bytes"));
  EXPECT_THAT(Refusal("09000000 83 02 00 00"), HasSubstr("number 2 for kind 131, which has at most 1,"));
  EXPECT_THAT(Refusal("10000000 88 00 00 00"), HasSubstr("a body of 16 bytes for kind 136, which has 24,"));
  EXPECT_THAT(Refusal("00000000 85 03 00 00"), HasSubstr("number 3 for kind 133"));
  EXPECT_THAT(Refusal("08000000 82 01 00 00"), HasSubstr("number 1 for kind 130"));
  EXPECT_THAT(Refusal("08000000 82 00 01 00"), HasSubstr("flags that kind 130 does not have"));
  EXPECT_THAT(Refusal("04000000 81 00 04 00"), HasSubstr("flags"));
  EXPECT_THAT(Refusal("08000000 82 00 00 01"), HasSubstr("flags"));
  EXPECT_EQ(Refusal("08000000 82 00 00"), "") << "half a head is none yet";
}

}  // namespace
}  // namespace tiltproof::harness
