// The frame codec on inputs written by hand. Expected frames and events were worked out from the protocol's
// description.
#include "link/frame.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <ostream>
#include <set>
#include <string>
#include <vector>

#include "firmware/messages.h"
#include "tests/fuzz/differential.h"
#include "tests/link/sensor_frame.h"

namespace tiltproof::link {
namespace {

using tiltproof::testing::Bytes;
using tiltproof::testing::Decode;
using tiltproof::testing::FromHex;
using tiltproof::testing::Hex;
using tiltproof::testing::SeenEvent;

std::string EncodeHex(const Bytes& payload) {
  Bytes wire(FrameBytesMax(payload.size()));
  return Hex(EncodeFrame(payload, wire).bytes);
}

std::string Repeat(std::string_view text, int count) {
  std::string repeated;
  for (int i = 0; i < count; ++i) repeated += text;
  return repeated;
}

// 64 bytes whose frame is the longest there is: all 7D but for 30 7E, placed so that the check is 7D 7D.
Bytes WorstPayload() {
  Bytes payload(64, 0x7D);
  std::fill(payload.begin() + 8, payload.begin() + 38, std::uint8_t{0x7E});
  return payload;
}

struct Golden {
  const char* name;
  Bytes payload;
  std::string frame_hex;
};

// Names the test in listings, in place of its bytes.
void PrintTo(const Golden& golden, std::ostream* out) { *out << golden.name; }

class GoldenFrame : public ::testing::TestWithParam<Golden> {};

TEST_P(GoldenFrame, Encodes) { EXPECT_EQ(EncodeHex(GetParam().payload), GetParam().frame_hex); }

TEST_P(GoldenFrame, Decodes) {
  const Bytes frame = FromHex(GetParam().frame_hex);
  const FrameStatus status = GetParam().payload.empty() ? FrameStatus::kEmpty : FrameStatus::kOk;
  EXPECT_EQ(Decode(frame), (std::vector<SeenEvent>{{status, GetParam().payload, 0, frame.size()}}));
}

INSTANTIATE_TEST_SUITE_P(
    , GoldenFrame,
    ::testing::Values(Golden{"Empty", {}, "7e00007e"}, Golden{"OneZero", {0x00}, "7e0000007e"},
                      Golden{"OneA", {0x41}, "7e4141417e"}, Golden{"OneEscape", {0x7D}, "7e7d5d7d5d7d5d7e"},
                      Golden{"OneFlag", {0x7E}, "7e7d5e7d5e7d5e7e"},
                      Golden{"Text", FromHex("6162636465666768"), "7e616263646566676827067e"},
                      Golden{"AllFlags", Bytes(64, 0x7E), "7e" + Repeat("7d5e", 64) + "9fc37e"},
                      Golden{"AllEscapes", Bytes(64, 0x7D), "7e" + Repeat("7d5d", 64) + "5f9b7e"},
                      Golden{
                          "Worst", WorstPayload(),
                          "7e" + Repeat("7d5d", 8) + Repeat("7d5e", 30) + Repeat("7d5d", 26) + "7d5d7d5d7e"},
                      Golden{"Longest", Bytes(kPayloadBytesMax, 0xFF), "7e" + Repeat("ff", 256) + "00007e"},
                      Golden{"Sensors", FromHex(tiltproof::testing::kSampleSensorsHex),
                             tiltproof::testing::kSampleFrameHex}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(EncodeFrame, WorstCaseFillsTheBound) {
  EXPECT_EQ(EncodeHex(WorstPayload()).size(), 2 * FrameBytesMax(64));
}

TEST(EncodeFrame, RefusesALongerPayload) {
  const Bytes payload(kPayloadBytesMax + 1);
  Bytes wire(FrameBytesMax(payload.size()));
  EXPECT_FALSE(EncodeFrame(payload, wire).ok());
}

// Every buffer length: the frame comes out when it fits and nothing is written when it does not.
TEST(EncodeFrame, FitsExactlyOrLeavesTheBufferAlone) {
  for (const Bytes& payload :
       {Bytes{}, Bytes{0x00}, WorstPayload(), FromHex(tiltproof::testing::kSampleSensorsHex)}) {
    const Bytes expected = tiltproof::testing::SlowEncode(payload);
    for (std::size_t length = 0; length <= FrameBytesMax(payload.size()); ++length) {
      Bytes wire(length, 0xA5);
      const EncodedFrame frame = EncodeFrame(payload, wire);
      ASSERT_EQ(frame.ok(), length >= expected.size()) << length;
      if (frame.ok()) {
        ASSERT_EQ(Bytes(frame.bytes.begin(), frame.bytes.end()), expected);
        ASSERT_EQ(frame.bytes.data(), wire.data());
      } else {
        ASSERT_EQ(wire, Bytes(length, 0xA5));
      }
    }
  }
}

// One stream and all that a decoder tells about it, its end included.
struct Case {
  const char* name;
  std::string stream_hex;
  std::vector<SeenEvent> events;
};

void PrintTo(const Case& test, std::ostream* out) { *out << test.name; }

class DecoderCase : public ::testing::TestWithParam<Case> {};

TEST_P(DecoderCase, TellsWhatItSaw) {
  const Bytes stream = FromHex(GetParam().stream_hex);
  for (const tiltproof::testing::Chunking& chunking : {tiltproof::testing::Chunking{}, {1}, {2}, {3, 0}}) {
    EXPECT_EQ(Decode(stream, chunking), GetParam().events);
  }
}

INSTANTIATE_TEST_SUITE_P(
    , DecoderCase,
    ::testing::Values(
        Case{"Nothing", "", {}}, Case{"OneFlag", "7e", {}}, Case{"IdleFlags", "7e7e7e7e", {}},
        Case{"SharedFlag",
             "7e4141417e4242427e",
             {{FrameStatus::kOk, {0x41}, 0, 5}, {FrameStatus::kOk, {0x42}, 4, 9}}},
        Case{"SeparateFlags",
             "7e4141417e7e4242427e",
             {{FrameStatus::kOk, {0x41}, 0, 5}, {FrameStatus::kOk, {0x42}, 5, 10}}},
        Case{"IdleBeforeAFrame", "7e7e7e4141417e", {{FrameStatus::kOk, {0x41}, 2, 7}}},
        // Noise between two flags: a heap overflow in the authors' receiver.
        Case{"OneNoiseByte", "7e557e", {{FrameStatus::kTooShort, {0x55}, 0, 3}}},
        // The check of nothing: an assertion in the authors' receiver.
        Case{"Empty", "7e00007e", {{FrameStatus::kEmpty, {}, 0, 4}}},
        Case{"ThreeZeros", "7e0000007e", {{FrameStatus::kOk, {0x00}, 0, 5}}},
        Case{"TwoWrongBytes", "7e00017e", {{FrameStatus::kBadChecksum, {}, 0, 4}}},
        // 00 and FF are one number to the sums, not to the receiver: a check is sent reduced.
        Case{"CheckNotReduced", "7effff7e", {{FrameStatus::kBadChecksum, {}, 0, 4}}},
        Case{"BadChecksum", "7e4141427e", {{FrameStatus::kBadChecksum, {0x41}, 0, 5}}},
        Case{"EscapeAlone", "7e7d7e", {{FrameStatus::kDanglingEscape, {}, 0, 3}}},
        Case{"DanglingEscapeOpensTheNext",
             "7e41417d7e4242427e",
             {{FrameStatus::kDanglingEscape, {0x41, 0x41}, 0, 5}, {FrameStatus::kOk, {0x42}, 4, 9}}},
        Case{"NeedlessEscapes", "7e7d617d61417e", {{FrameStatus::kOk, {0x41}, 0, 7}}},
        Case{"EscapedEscape", "7e7d7d5d5d7e", {{FrameStatus::kOk, {0x5D}, 0, 6}}},
        Case{"GarbageThenFrame",
             "0102037e4141417e",
             {{FrameStatus::kNoOpeningFlag, {}, 0, 4}, {FrameStatus::kOk, {0x41}, 3, 8}}},
        Case{"GarbageOnly", "7d0102", {{FrameStatus::kNoOpeningFlag, {}, 0, 3}}},
        Case{"OpeningFlagLost", "4141417e", {{FrameStatus::kNoOpeningFlag, {}, 0, 4}}},
        Case{"ClosingFlagLost",
             "7e4141417e414141",
             {{FrameStatus::kOk, {0x41}, 0, 5}, {FrameStatus::kAborted, {0x41, 0x41, 0x41}, 4, 8}}},
        Case{"EndsAfterAnEscape", "7e7d", {{FrameStatus::kAborted, {}, 0, 2}}},
        Case{"NoiseBetweenFrames",
             "7e4141417e0102037e4242427e",
             {{FrameStatus::kOk, {0x41}, 0, 5},
              {FrameStatus::kBadChecksum, {0x01}, 4, 9},
              {FrameStatus::kOk, {0x42}, 8, 13}}}),
    [](const auto& test) { return std::string(test.param.name); });

// A flag, `count` bytes 00, and what follows.
Bytes OpenFrame(std::size_t count, const Bytes& tail) {
  Bytes stream = {kFlag};
  stream.resize(1 + count, 0x00);
  stream.insert(stream.end(), tail.begin(), tail.end());
  return stream;
}

constexpr std::size_t kRoom = kPayloadBytesMax + 2;

TEST(FrameDecoder, LongestPayloadIsAccepted) {
  EXPECT_EQ(Decode(OpenFrame(kRoom, {kFlag})),
            (std::vector<SeenEvent>{{FrameStatus::kOk, Bytes(kPayloadBytesMax), 0, kRoom + 2}}));
}

TEST(FrameDecoder, TooLongComesAtTheByteTooManyAndOnce) {
  const Bytes shown(kPayloadBytesMax);
  Bytes after = {0x01, 0x02, kEscape, 0x03};  // silent
  for (const std::uint8_t byte : FromHex("7e4141417e")) after.push_back(byte);
  EXPECT_EQ(Decode(OpenFrame(kRoom, after)),
            (std::vector<SeenEvent>{{FrameStatus::kTooLong, shown, 0, kRoom + 2},
                                    {FrameStatus::kOk, {0x41}, kRoom + 5, kRoom + 10}}));
}

// An escape is no byte yet: what it makes of the next one is.
TEST(FrameDecoder, EscapeAtTheLimit) {
  const Bytes shown(kPayloadBytesMax);
  EXPECT_EQ(Decode(OpenFrame(kRoom, {kEscape, 0x5E})),
            (std::vector<SeenEvent>{{FrameStatus::kTooLong, shown, 0, kRoom + 3}}));
  EXPECT_EQ(Decode(OpenFrame(kRoom, {kEscape, kFlag})),
            (std::vector<SeenEvent>{{FrameStatus::kDanglingEscape, shown, 0, kRoom + 3}}));
  EXPECT_EQ(Decode(OpenFrame(kRoom, {kEscape})),
            (std::vector<SeenEvent>{{FrameStatus::kAborted, shown, 0, kRoom + 2}}));
}

// The largest sums that a decoder can hold.
TEST(FrameDecoder, SumsDoNotOverflow) {
  const Bytes payload(kPayloadBytesMax, 0xFF);
  Bytes stream = {kFlag};
  stream.insert(stream.end(), kPayloadBytesMax + 2, 0xFF);
  stream.push_back(kFlag);
  EXPECT_EQ(Decode(stream), (std::vector<SeenEvent>{{FrameStatus::kBadChecksum, payload, 0, stream.size()}}));
}

TEST(FrameDecoder, FinishForgetsTheFrameButNotTheOffset) {
  FrameDecoder decoder;
  std::vector<SeenEvent> events;
  EXPECT_FALSE(decoder.Finish().has_value());
  tiltproof::testing::Feed(decoder, FromHex("7e4141"), {}, events);
  const auto aborted = decoder.Finish();
  ASSERT_TRUE(aborted.has_value());
  EXPECT_EQ(aborted->status, FrameStatus::kAborted);
  EXPECT_FALSE(decoder.Finish().has_value());
  // The rest of the aborted frame has no opening flag any more.
  tiltproof::testing::Feed(decoder, FromHex("417e4242427e"), {}, events);
  EXPECT_EQ(events, (std::vector<SeenEvent>{{FrameStatus::kNoOpeningFlag, {}, 3, 5},
                                            {FrameStatus::kOk, {0x42}, 4, 9}}));
}

// A frame that was reported as too long is not reported again as aborted.
TEST(FrameDecoder, FinishAfterTooLongIsSilent) {
  FrameDecoder decoder;
  std::vector<SeenEvent> events;
  tiltproof::testing::Feed(decoder, OpenFrame(kRoom, {1, 2, 3}), {}, events);
  ASSERT_EQ(events.size(), 1U);
  EXPECT_FALSE(decoder.Finish().has_value());
}

TEST(FrameDecoder, StopsAtEachEventAndConsumesTheRestLater) {
  const Bytes stream = FromHex("7e4141417e42");
  std::span<const std::uint8_t> rest = stream;
  FrameDecoder decoder;
  ASSERT_TRUE(decoder.Next(rest).has_value());
  EXPECT_EQ(rest.size(), 1U);
  EXPECT_FALSE(decoder.Next(rest).has_value());
  EXPECT_TRUE(rest.empty());
  EXPECT_FALSE(decoder.Next(rest).has_value());
}

TEST(FrameDecoder, CountsEveryStatus) {
  FrameDecoder decoder;
  std::vector<SeenEvent> events;
  Bytes stream = FromHex("ff7e4141417e4141427e557e00007e417d7e4242427e");  // one of each, ok twice
  const Bytes long_frame = OpenFrame(kRoom, {0x01, kFlag, 0x02});          // too long, then aborted
  stream.insert(stream.end(), long_frame.begin(), long_frame.end());
  tiltproof::testing::Feed(decoder, stream, {}, events);
  decoder.Finish();
  EXPECT_EQ(decoder.Counts()[static_cast<std::size_t>(FrameStatus::kOk)], 2U);
  for (std::size_t i = 1; i < kFrameStatusCount; ++i) {
    EXPECT_EQ(decoder.Counts()[i], 1U) << Name(static_cast<FrameStatus>(i));
  }
}

TEST(FrameStatus, NamesAreDistinct) {
  std::set<std::string_view> names;
  for (std::size_t i = 0; i < kFrameStatusCount; ++i) names.insert(Name(static_cast<FrameStatus>(i)));
  EXPECT_EQ(names, (std::set<std::string_view>{"ok", "bad_checksum", "too_short", "too_long",
                                               "dangling_escape", "empty", "aborted", "no_opening_flag"}));
  EXPECT_EQ(Name(FrameStatus::kOk), "ok");
  EXPECT_EQ(Name(FrameStatus::kBadChecksum), "bad_checksum");
}

}  // namespace
}  // namespace tiltproof::link
