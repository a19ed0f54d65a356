// Everything that one damaged byte, one damaged bit or a cut can do to the frame of a sensor reply, one by
// one: decoder and slow reference must tell the same story, and what gets past the checksum must be a
// collision of the checksum.
//
// The counts were found with a third implementation (a byte-wise state machine in Python), not with the code
// under test.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <set>

#include "firmware/messages.h"
#include "link/frame.h"
#include "tests/fuzz/differential.h"
#include "tests/link/sensor_frame.h"

namespace tiltproof::link {
namespace {

using tiltproof::testing::Bytes;
using tiltproof::testing::Decode;
using tiltproof::testing::Disagreement;
using tiltproof::testing::FromHex;
using tiltproof::testing::SeenEvent;

const Bytes& SamplePayload() {
  static const Bytes kPayload = FromHex(tiltproof::testing::kSampleSensorsHex);
  return kPayload;
}
const Bytes& Frame() {
  static const Bytes kFrame = FromHex(tiltproof::testing::kSampleFrameHex);
  return kFrame;
}

// All that came of a family of damaged frames.
struct Tally {
  int streams = 0;
  int right_payload = 0;
  int wrong_payload = 0;                                    // past the checksum
  std::array<int, kMessageStatusCount> wrong_payload_is{};  // what DecodeSensors() says of those
  std::array<int, kFrameStatusCount> events{};

  int Count(FrameStatus status) const { return events[static_cast<std::size_t>(status)]; }
  int Count(MessageStatus status) const { return wrong_payload_is[static_cast<std::size_t>(status)]; }
};

// Equal but for bytes that are 00 in one and FF in the other.
bool DiffersOnlyInZeroAndFF(const Bytes& a, const Bytes& b) {
  if (a.size() != b.size()) return false;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const bool collides = (a[i] == 0x00 && b[i] == 0xFF) || (a[i] == 0xFF && b[i] == 0x00);
    if (a[i] != b[i] && !collides) return false;
  }
  return true;
}

// The status that DecodeSensors() must report, computed with <cmath> instead of bit patterns.
MessageStatus ExpectedVerdict(const Bytes& payload) {
  if (payload.size() != 64) return MessageStatus::kBadLength;
  constexpr std::array<double, 16> kLimits = {1e4, 1e4, 1e4, 100, 100, 100, 100, 100,
                                              1e3, 1e3, 1e3, 1e3, 1e3, 1e3, 1e3, 1e3};
  bool in_range = true;
  for (std::size_t i = 0; i < kLimits.size(); ++i) {
    std::uint32_t bits = 0;
    for (std::size_t j = 4; j-- > 0;) bits = bits * 256 + payload[4 * i + j];
    float value = 0;
    std::memcpy(&value, &bits, sizeof value);
    if (!std::isfinite(value)) return MessageStatus::kNotFinite;
    in_range = in_range && std::abs(value) <= kLimits[i];
  }
  return in_range ? MessageStatus::kOk : MessageStatus::kOutOfRange;
}

void Judge(const Bytes& stream, Tally& tally) {
  ++tally.streams;
  ASSERT_EQ(Disagreement({stream}, {}), "");
  ASSERT_EQ(Disagreement({stream}, {1}), "");
  for (const SeenEvent& event : Decode(stream)) {
    ++tally.events[static_cast<std::size_t>(event.status)];
    if (event.status != FrameStatus::kOk) continue;
    if (event.payload == SamplePayload()) {
      ++tally.right_payload;
      continue;
    }
    ++tally.wrong_payload;
    Sensors sensors;
    const MessageStatus verdict = DecodeSensors(event.payload, sensors);
    ASSERT_EQ(verdict, ExpectedVerdict(event.payload));
    ++tally.wrong_payload_is[static_cast<std::size_t>(verdict)];
    if (event.payload.size() == kSensorMessageBytes) {
      ASSERT_TRUE(DiffersOnlyInZeroAndFF(event.payload, SamplePayload()))
          << tiltproof::testing::Hex(event.payload);
    }
  }
}

TEST(SensorFrameCorruption, EverySingleBit) {
  Tally tally;
  for (std::size_t at = 0; at < Frame().size(); ++at) {
    for (int bit = 0; bit < 8; ++bit) {
      Bytes stream = Frame();
      stream[at] = static_cast<std::uint8_t>(stream[at] ^ 1 << bit);
      Judge(stream, tally);
    }
  }
  EXPECT_EQ(tally.streams, 560);
  EXPECT_EQ(tally.right_payload, 0);
  EXPECT_EQ(tally.wrong_payload, 0);
  EXPECT_EQ(tally.Count(FrameStatus::kBadChecksum), 545);
  EXPECT_EQ(tally.Count(FrameStatus::kDanglingEscape), 1);
  EXPECT_EQ(tally.Count(FrameStatus::kNoOpeningFlag), 8);
  EXPECT_EQ(tally.Count(FrameStatus::kAborted), 8);
}

// 43 bytes of this payload are 00. Each of them turned into FF passes the checksum; 39 of the values so made
// are small (their lowest bytes changed), and four are of 1e38 and out of range. The other four are frames
// cut in two by a forged flag.
TEST(SensorFrameCorruption, EverySingleByte) {
  Tally tally;
  for (std::size_t at = 0; at < Frame().size(); ++at) {
    for (int change = 1; change < 256; ++change) {
      Bytes stream = Frame();
      stream[at] = static_cast<std::uint8_t>(stream[at] ^ change);
      Judge(stream, tally);
    }
  }
  EXPECT_EQ(tally.streams, 17'850);
  EXPECT_EQ(tally.right_payload, 0);
  EXPECT_EQ(tally.wrong_payload, 47);
  EXPECT_EQ(tally.Count(MessageStatus::kOk), 39);
  EXPECT_EQ(tally.Count(MessageStatus::kOutOfRange), 4);
  EXPECT_EQ(tally.Count(MessageStatus::kNotFinite), 0);
  EXPECT_EQ(tally.Count(MessageStatus::kBadLength), 4);
  EXPECT_EQ(tally.Count(FrameStatus::kBadChecksum), 17'353);
  EXPECT_EQ(tally.Count(FrameStatus::kTooShort), 2);
  EXPECT_EQ(tally.Count(FrameStatus::kEmpty), 1);
  EXPECT_EQ(tally.Count(FrameStatus::kDanglingEscape), 3);
  EXPECT_EQ(tally.Count(FrameStatus::kNoOpeningFlag), 255);
  EXPECT_EQ(tally.Count(FrameStatus::kAborted), 255);
}

// A whole 0.0f that turns into FFFFFFFF passes the checksum and is a NaN.
TEST(SensorFrameCorruption, EveryZeroFloatTurnedIntoFF) {
  Tally tally;
  for (std::size_t at = 0; at < SamplePayload().size(); at += 4) {
    Bytes payload = SamplePayload();
    bool zero = true;
    for (std::size_t i = at; i < at + 4; ++i) {
      zero = zero && payload[i] == 0;
      payload[i] = 0xFF;
    }
    if (!zero) continue;
    Bytes stream = {kFlag};
    for (std::size_t i = 0; i < payload.size(); ++i) {
      if (payload[i] == kFlag || payload[i] == kEscape) {
        stream.insert(stream.end(), {kEscape, static_cast<std::uint8_t>(payload[i] ^ kEscapeXor)});
      } else {
        stream.push_back(payload[i]);
      }
    }
    stream.insert(stream.end(), {0x33, 0xF6, kFlag});  // the check of the undamaged payload
    Judge(stream, tally);
  }
  EXPECT_EQ(tally.streams, 4);
  EXPECT_EQ(tally.wrong_payload, 4);
  EXPECT_EQ(tally.Count(MessageStatus::kNotFinite), 4);
}

TEST(SensorFrameCorruption, EveryTruncation) {
  Tally heads;
  Tally tails;
  for (std::size_t length = 0; length < Frame().size(); ++length) {
    Judge(Bytes(Frame().begin(), Frame().begin() + static_cast<std::ptrdiff_t>(length)), heads);
    Judge(Bytes(Frame().end() - static_cast<std::ptrdiff_t>(length), Frame().end()), tails);
  }
  EXPECT_EQ(heads.streams, 70);
  EXPECT_EQ(heads.right_payload + heads.wrong_payload, 0);
  EXPECT_EQ(heads.Count(FrameStatus::kAborted), 68);  // nothing and the flag alone are no frame
  EXPECT_EQ(tails.right_payload + tails.wrong_payload, 0);
  EXPECT_EQ(tails.Count(FrameStatus::kNoOpeningFlag), 68);
}

// Every run of bytes lost from the middle, and the frame sent again right after: the second one always
// arrives.
TEST(SensorFrameCorruption, EveryGapIsFollowedByAFrameThatArrives) {
  Tally tally;
  for (std::size_t from = 0; from < Frame().size(); ++from) {
    for (std::size_t to = from + 1; to <= Frame().size(); ++to) {
      Bytes stream(Frame().begin(), Frame().begin() + static_cast<std::ptrdiff_t>(from));
      stream.insert(stream.end(), Frame().begin() + static_cast<std::ptrdiff_t>(to), Frame().end());
      stream.insert(stream.end(), Frame().begin(), Frame().end());
      Judge(stream, tally);
      const std::vector<SeenEvent> events = Decode(stream);
      ASSERT_FALSE(events.empty());
      ASSERT_EQ(events.back().status, FrameStatus::kOk);
      ASSERT_EQ(events.back().payload, SamplePayload());
    }
  }
  EXPECT_EQ(tally.streams, 70 * 71 / 2);
}

// The same after any single damaged byte.
TEST(SensorFrameCorruption, EverySingleByteIsFollowedByAFrameThatArrives) {
  for (std::size_t at = 0; at < Frame().size(); ++at) {
    for (int change = 1; change < 256; ++change) {
      Bytes stream = Frame();
      stream[at] = static_cast<std::uint8_t>(stream[at] ^ change);
      stream.insert(stream.end(), Frame().begin(), Frame().end());
      const std::vector<SeenEvent> events = Decode(stream);
      ASSERT_FALSE(events.empty());
      ASSERT_EQ(events.back(),
                (SeenEvent{FrameStatus::kOk, SamplePayload(), Frame().size(), 2 * Frame().size()}));
    }
  }
}

}  // namespace
}  // namespace tiltproof::link
