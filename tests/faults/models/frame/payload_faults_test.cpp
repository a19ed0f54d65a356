// Frames that are built well around a wrong payload, read by the codec and, for checksums, by a slow one.
#include <gtest/gtest.h>
#include <bit>

#include <cmath>
#include <limits>

#include "faults/frame_edit.h"
#include "tests/faults/goodness_of_fit.h"
#include "tests/faults/models/frame/message_frames.h"

namespace tiltproof::faults {
namespace {

using link::Direction;
using link::FrameStatus;
using link::MessageStatus;

MessageStatus StatusOf(const Bytes& payload, Direction direction = Direction::kToClient) {
  link::Message message;
  return PaperProtocol().Decode(direction, payload, message);
}

// Fletcher's sums, from their definition.
std::pair<unsigned, unsigned> SlowSums(const Bytes& bytes) {
  unsigned long first = 0, second = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    first += bytes[i];
    second += (bytes.size() - i) * bytes[i];
  }
  return {static_cast<unsigned>(first % 255), static_cast<unsigned>(second % 255)};
}

TEST(FrameEditTest, ChangesNothingByItself) {
  for (const char* message : {"start", "request", "actuators", "sensors", "reference"}) {
    for (std::int64_t n = 0; n < 300; ++n) {
      const Bytes frame = MessageFrame(message, n).bytes;
      const FrameEdit edit(*PaperProtocol().framing, frame);
      ASSERT_TRUE(edit.ok());
      Bytes again;
      edit.WriteTo(again);
      ASSERT_EQ(again, frame) << message << n;
    }
  }
}

TEST(FrameEditTest, ADamagedFrameStaysDamaged) {
  Bytes frame = MessageFrame("sensors", 5).bytes;
  frame[10] ^= 1;
  FrameEdit edit(*PaperProtocol().framing, frame);
  edit.payload().pop_back();
  edit.WriteTo(frame);
  link::FrameDecoder decoder;
  std::span<const std::uint8_t> bytes = frame;
  EXPECT_EQ(decoder.Next(bytes)->status, FrameStatus::kBadChecksum);
}

TEST(FrameEditTest, KnowsWhatIsNoFrame) {
  for (const Bytes& bytes :
       {Bytes{}, Bytes{0x7E}, Bytes{0x7E, 0x7E}, Bytes{0x7E, 1, 0x7E}, Bytes{0x7E, 1, 2, 3},
        Bytes{0x7E, 1, 2, 0x7D, 0x7E}, Bytes{0x7E, 1, 2, 0x7E, 3, 4, 0x7E}})
    EXPECT_FALSE(FrameEdit(*PaperProtocol().framing, bytes).ok());
}

TEST(ShortTest, BytesAreMissingAtTheEndAndTheChecksumIsRight) {
  const auto heard = Decoded(SendMessages(Spec("frame.short", {{"bytes_count", 3.0}}), "sensors", 100));
  ASSERT_EQ(heard.size(), 100U);
  for (std::size_t n = 0; n < heard.size(); ++n) {
    EXPECT_EQ(heard[n].status, FrameStatus::kOk);
    EXPECT_EQ(heard[n].payload.size(), 61U);
    EXPECT_EQ(StatusOf(heard[n].payload), MessageStatus::kBadLength);
    EXPECT_EQ(ValuesOf(heard[n].payload)[1], static_cast<float>(n) + 0.5F);
  }
}

TEST(ShortTest, OneByteIsLeft) {
  for (const Heard& heard :
       Decoded(SendMessages(Spec("frame.short", {{"bytes_count", 200.0}}), "actuators", 20))) {
    EXPECT_EQ(heard.status, FrameStatus::kOk);
    EXPECT_EQ(heard.payload.size(), 1U);
  }
}

TEST(LongTest, BytesFollowAtTheEndAndTheChecksumIsRight) {
  for (const Heard& heard :
       Decoded(SendMessages(Spec("frame.long", {{"bytes_count", 5.0}}), "sensors", 100))) {
    EXPECT_EQ(heard.status, FrameStatus::kOk);
    EXPECT_EQ(heard.payload.size(), 69U);
    EXPECT_EQ(StatusOf(heard.payload), MessageStatus::kBadLength);
  }
  for (const Heard& heard :
       Decoded(SendMessages(Spec("frame.long", {{"bytes_count", 1000.0}}), "sensors", 100)))
    EXPECT_EQ(heard.status, FrameStatus::kTooLong);
}

// Sends 100 000 such frames: true for each that did not go on as it was.
std::vector<bool> Changed(const FaultSpec& spec, const std::string& message) {
  const auto out = SendMessages(spec, message, 100'000);
  std::vector<bool> changed;
  for (std::size_t n = 0; n < out.size(); ++n)
    changed.push_back(out[n].at(0).bytes != MessageFrame(message, static_cast<std::int64_t>(n)).bytes);
  return changed;
}

TEST(PayloadFaultsTest, HappenWithTheirProbability) {
  EXPECT_TRUE(AreBernoulli(
      Changed(Spec("frame.short", {{"bytes_count", 3.0}, {"probability", 0.3}}), "actuators"), 0.3));
  EXPECT_TRUE(AreBernoulli(
      Changed(Spec("frame.long", {{"bytes_count", 3.0}, {"probability", 0.2}}), "actuators"), 0.2));
  EXPECT_TRUE(
      AreBernoulli(Changed(Spec("frame.wrong_id", {{"id", 9.0}, {"probability", 0.4}}), "actuators"), 0.4));
  EXPECT_TRUE(
      AreBernoulli(Changed(Spec("frame.checksum_preserving", {{"probability", 0.1}}), "actuators"), 0.1));
  EXPECT_TRUE(AreBernoulli(
      Changed(Spec("frame.semantic", {{"field", "f_r_n"}, {"kind", "nan"}, {"probability", 0.3}}),
              "actuators"),
      0.3));
}

TEST(LongTest, TheBytesAreUniform) {
  const std::size_t size = Decoded({{MessageFrame("actuators", 0)}}).at(0).payload.size();
  std::vector<double> by_value(256, 0);
  for (const Heard& heard :
       Decoded(SendMessages(Spec("frame.long", {{"bytes_count", 100.0}}), "actuators", 1500))) {
    ASSERT_EQ(heard.payload.size(), size + 100);
    for (std::size_t i = size; i < heard.payload.size(); ++i) ++by_value[heard.payload[i]];
  }
  EXPECT_TRUE(AreUniform(by_value));
}

TEST(WrongIdTest, IsSentWithARightChecksum) {
  const FaultSpec spec = Spec("frame.wrong_id", {{"id", 9.0}, {"probability", 1.0}});
  for (const Heard& heard : Decoded(SendMessages(spec, "actuators", 50))) {
    EXPECT_EQ(heard.status, FrameStatus::kOk);
    EXPECT_EQ(ValuesOf(heard.payload)[0], 9.0F);
    EXPECT_EQ(StatusOf(heard.payload, Direction::kToPlant), MessageStatus::kUnknownId);
  }
}

// A request that says it is a start, with the length of one: a message of the protocol.
TEST(WrongIdTest, CanMakeAnotherMessage) {
  const auto start = static_cast<double>(std::bit_cast<float>(PaperProtocol().Find("start")->id->bits));
  const FaultSpec spec = Spec("frame.wrong_id", {{"id", start}, {"probability", 1.0}});
  for (const Heard& heard : Decoded(SendMessages(spec, "request", 5)))
    EXPECT_EQ(PaperProtocol().Classify(Direction::kToPlant, heard.payload), PaperProtocol().Find("start"));
}

TEST(ChecksumPreservingTest, ChangesThreeBytesAndNeitherSum) {
  constexpr std::int64_t kCount = 100'000;
  const auto out = SendMessages(Spec("frame.checksum_preserving", {{"probability", 1.0}}), "sensors", kCount);
  const auto heard = Decoded(out);
  ASSERT_EQ(heard.size(), static_cast<std::size_t>(kCount));
  std::vector<double> by_place(62, 0), by_difference(254, 0);  // of 1 to 254
  for (std::int64_t n = 0; n < kCount; ++n) {
    const Bytes before = Decoded({{MessageFrame("sensors", n)}}).at(0).payload;
    const Bytes& after = heard[static_cast<std::size_t>(n)].payload;
    ASSERT_EQ(heard[static_cast<std::size_t>(n)].status, FrameStatus::kOk) << n;
    ASSERT_NE(after, before) << n;
    ASSERT_EQ(SlowSums(after), SlowSums(before)) << n;
    std::size_t first = 0;
    while (after[first] == before[first]) ++first;
    ++by_place.at(first);
    ++by_difference.at(static_cast<std::size_t>((after[first] + 255 - before[first] % 255) % 255) - 1);
    for (std::size_t i = first + 3; i < 64; ++i) ASSERT_EQ(after[i], before[i]);
  }
  EXPECT_TRUE(AreUniform(by_place));
  EXPECT_TRUE(AreUniform(by_difference));
}

// z_m, the third value, in the frames of a flight: n + 1.
std::vector<float> Heights(const std::string& kind, double value = 0) {
  FaultSpec spec =
      Spec("frame.semantic", {{"field", "z_m"}, {"kind", kind}, {"value", value}, {"probability", 1.0}});
  spec.start_ns = FrameTime(5);
  spec.end_ns = FrameTime(10);
  std::vector<float> heights;
  std::int64_t n = 0;
  for (const Heard& heard : Decoded(SendMessages(spec, "sensors", 15))) {
    EXPECT_EQ(heard.status, FrameStatus::kOk);
    const std::vector<float> values = ValuesOf(heard.payload);
    heights.push_back(values.at(2));
    if (n < 5 || n >= 10) {
      EXPECT_EQ(values[2], static_cast<float>(n) + 1) << n;
    }
    for (std::size_t i = 0; i < 16; ++i) {
      if (i != 2) {
        EXPECT_EQ(values[i], static_cast<float>(n) + 0.5F * static_cast<float>(i));
      }
    }
    ++n;
  }
  return heights;
}

TEST(SemanticTest, EveryKindIsWhatItSays) {
  EXPECT_TRUE(std::isnan(Heights("nan")[7]));
  EXPECT_EQ(Heights("inf")[7], std::numeric_limits<float>::infinity());
  EXPECT_EQ(Heights("denormal")[7], 0x1p-149F);
  EXPECT_EQ(Heights("sign_flip")[7], -8.0F);
  EXPECT_EQ(Heights("offset", 0.25)[7], 8.25F);
  // As in the last frame before the window.
  for (std::size_t n = 5; n < 10; ++n) EXPECT_EQ(Heights("stale")[n], 5.0F);
  const float wide = Heights("out_of_range")[7];
  const auto& field = PaperProtocol().Find("sensors")->fields.at(2);
  EXPECT_EQ(field.signal, "z_m");
  EXPECT_GT(wide, field.max);
}

TEST(SemanticTest, MessagesWithoutTheFieldPass) {
  const auto out = SendMessages(
      Spec("frame.semantic", {{"field", "z_m"}, {"kind", "nan"}, {"probability", 1.0}}), "actuators", 10);
  for (std::size_t n = 0; n < out.size(); ++n)
    EXPECT_EQ(out[n][0].bytes, MessageFrame("actuators", static_cast<std::int64_t>(n)).bytes);
}

TEST(SemanticTest, FieldsAreThoseOfTheMessagesThatPass) {
  EXPECT_EQ(FieldNames(PaperProtocol(), Target::kToPlant),
            (std::vector<std::string>{"f_r_n", "f_l_n", "tau_r_nm", "tau_l_nm"}));
  EXPECT_EQ(FieldNames(PaperProtocol(), Target::kToPlant, "request"), std::vector<std::string>());
  EXPECT_EQ(FieldNames(PaperProtocol(), Target::kToClient).size(), 16U);
  EXPECT_EQ(FieldNames(PaperProtocol(), Target::kBoth).size(), 20U);
}

}  // namespace
}  // namespace tiltproof::faults
