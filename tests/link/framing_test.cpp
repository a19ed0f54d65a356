// All framings keep the promises of their interface, and a wire carries each of them: the product's, and two slow
// references.

#include "link/framing.h"

#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "link/cobs_framing.h"
#include "link/length_framing.h"
#include "link/wire.h"
#include "tests/support/frame_readings.h"
#include "tests/support/tiny_framings.h"

namespace tiltproof::link {
namespace {

using Bytes = std::vector<std::uint8_t>;
using testing::Read;

std::shared_ptr<const Framing> FramingNamed(const std::string& name) {
  if (name == "cobs_reference") return std::make_shared<CobsFraming>();
  if (name == "length_reference") return std::make_shared<LengthFraming>();
  if (name == "cobs") return MakeCobsFraming(CheckKind::kCrc16Ibm3740);
  if (name == "cobs_sum8") return MakeCobsFraming(CheckKind::kSum8);
  if (name == "length_prefixed")
    return MakeLengthFraming({.sync = {0xAA, 0x55}, .length_bytes = 2}, CheckKind::kCrc16IbmSdlc);
  if (name == "hdlc_crc32") return MakeHdlcFraming(CheckKind::kCrc32IsoHdlc);
  return HdlcFraming();
}

class FramingTest : public ::testing::TestWithParam<const char*> {
 protected:
  std::shared_ptr<const Framing> framing_ = FramingNamed(GetParam());
  std::mt19937 generator_{7};

  std::size_t Below(std::size_t limit) { return generator_() % limit; }
  // Many of its bytes are special ones.
  Bytes Payload(std::size_t size) {
    const auto special = framing_->special_bytes();
    Bytes payload(size);
    for (std::uint8_t& byte : payload)
      byte = Below(2) == 0 ? special[Below(special.size())] : static_cast<std::uint8_t>(Below(256));
    return payload;
  }
};

TEST_P(FramingTest, ReadsWhatItEncodesInAnyChunks) {
  Bytes stream;
  std::vector<Bytes> payloads;
  std::vector<std::size_t> ends;
  for (std::size_t size = 1; size <= kPayloadBytesMax; ++size) {
    payloads.push_back(Payload(size));
    const Bytes frame = framing_->Encode(payloads.back());
    stream.insert(stream.end(), frame.begin(), frame.end());
    ends.push_back(stream.size());
  }
  const auto reader = framing_->MakeReader();
  std::size_t count = 0;
  for (std::size_t at = 0; at < stream.size();) {
    const std::size_t size = std::min(stream.size() - at, 1 + Below(200));
    auto bytes = std::span<const std::uint8_t>(stream).subspan(at, size);
    at += size;
    while (const auto read = reader->Next(bytes)) {
      ASSERT_LT(count, payloads.size());
      EXPECT_EQ(read->status, "ok");
      EXPECT_TRUE(read->ok);
      EXPECT_EQ(Bytes(read->payload.begin(), read->payload.end()), payloads[count]);
      EXPECT_EQ(read->end, ends[count]);
      // Its part of the stream is such a frame again.
      const auto part = std::span<const std::uint8_t>(stream).subspan(read->begin, read->end - read->begin);
      EXPECT_EQ(framing_->Split(part)->payload, payloads[count]);
      EXPECT_GE(read->content_begin, read->begin);
      EXPECT_LE(read->content_end, read->end);
      ++count;
    }
  }
  EXPECT_EQ(count, payloads.size());
  EXPECT_FALSE(reader->Finish());
}

TEST_P(FramingTest, CutsAtTheEndOfEachFrameInAnyChunks) {
  const auto cutter = framing_->MakeCutter();
  std::size_t size = 0;
  for (int i = 0; i < 500; ++i) {
    const Bytes frame = framing_->Encode(Payload(1 + Below(100)));
    for (std::size_t at = 0; at < frame.size(); at += size) {
      size = std::min(frame.size() - at, 1 + Below(60));
      const auto end = cutter->FindEnd(std::span(frame).subspan(at, size));
      ASSERT_EQ(end.has_value(), at + size == frame.size());
      if (end) {
        ASSERT_EQ(*end, size);
      }
    }
    // After a reset the rest of a frame is forgotten.
    if (i % 10 == 0) {
      EXPECT_FALSE(cutter->FindEnd(std::span(frame).first(frame.size() - 1)));
      cutter->Reset();
    }
  }
}

TEST_P(FramingTest, AFrameTakenApartIsPutTogetherAgain) {
  for (int i = 0; i < 500; ++i) {
    const Bytes payload = Payload(Below(300));
    const std::size_t last = (std::size_t{1} << 8 * framing_->check_bytes()) - 1;
    const auto damage = i % 2 == 0 ? 0 : static_cast<std::uint32_t>(1 + Below(last));
    const Bytes frame = framing_->Encode(payload, damage);
    const auto parts = framing_->Split(frame);
    ASSERT_TRUE(parts);
    EXPECT_EQ(parts->payload, payload);
    EXPECT_EQ(parts->damage, damage);
    Bytes again(frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(parts->opening_bytes));
    framing_->AppendBehindOpening(parts->payload, parts->damage, again);
    EXPECT_EQ(again, frame);
    if (payload.empty() || payload.size() > kPayloadBytesMax) continue;
    std::span<const std::uint8_t> bytes(frame);
    const auto reader = framing_->MakeReader();
    EXPECT_EQ(reader->Next(bytes)->ok, damage == 0);
  }
}

TEST_P(FramingTest, TheFlagStandsNowhereInAFrame) {
  const auto flag = framing_->flag();
  if (!flag) return;
  for (int i = 0; i < 200; ++i) {
    const Bytes frame = framing_->Encode(Payload(100));
    const std::size_t opening = framing_->opening().size();
    EXPECT_EQ(std::count(frame.begin() + static_cast<std::ptrdiff_t>(opening), frame.end(), *flag), 1);
    EXPECT_EQ(frame.back(), *flag);
    EXPECT_EQ(CountFlags(*framing_, frame), opening);
  }
}

// A filter that notes what it gets.
struct Noting : ChunkFilter {
  std::vector<Chunk> chunks;
  void Apply(std::vector<Chunk>& passing) override {
    chunks.insert(chunks.end(), passing.begin(), passing.end());
  }
};

TEST_P(FramingTest, AWireCutsItsFramesAndKnowsTheirMessages) {
  const auto protocol = PaperOver(framing_);
  for (const std::size_t split : {std::size_t{1}, std::size_t{7}, std::size_t{1000}}) {
    Noting filter;
    Wire wire({.baud = 921'600}, Direction::kToPlant, *protocol, &filter);
    std::vector<Bytes> frames;
    std::vector<std::ptrdiff_t> places;
    BootTime now;
    for (int i = 0; i < 50; ++i) {
      const char* name = i % 3 == 0 ? "start" : i % 3 == 1 ? "request" : "actuators";
      const MessageType& type = *protocol->Find(name);
      const std::vector<double> values(type.fields.size(), 0.1 * static_cast<double>(i));
      frames.push_back(framing_->Encode(protocol->Encode(type, values).span()));
      places.push_back(&type - protocol->messages.data());
      const Bytes& frame = frames.back();
      for (std::size_t at = 0; at < frame.size(); at += split)
        now = wire.Transmit(now, std::span(frame).subspan(at, std::min(split, frame.size() - at)));
    }
    ASSERT_EQ(filter.chunks.size(), frames.size());
    std::int64_t bytes_count = 0;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      EXPECT_EQ(filter.chunks[i].bytes, frames[i]);
      EXPECT_EQ(filter.chunks[i].message, places[i]);
      EXPECT_EQ(filter.chunks[i].number, i);
      // A piece ends where a frame does, so that its receiver is woken there.
      bytes_count += static_cast<std::int64_t>(frames[i].size());
      const BootTime arrival = wire.NextArrival();
      EXPECT_LT(std::abs(arrival.ns() - bytes_count * 10 * kNsPerS / 921'600), 2);
      const auto piece = wire.TakePiece(arrival);
      ASSERT_TRUE(piece);
      EXPECT_EQ(Bytes(piece->bytes.begin(), piece->bytes.end()), frames[i]);
    }
  }
}

TEST_P(FramingTest, AFrameThatDoesNotEndGoesOnWhenTheSenderIsSilent) {
  const auto protocol = PaperOver(framing_);
  Noting filter;
  Wire wire({.baud = 921'600}, Direction::kToPlant, *protocol, &filter);
  const Bytes frame = framing_->Encode(Bytes{1, 2, 3, 4});
  const Bytes half(frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(frame.size() / 2));
  const BootTime sent = wire.Transmit(BootTime(), half);
  EXPECT_EQ(wire.NextArrival(), sent + wire.IdleTime());
  EXPECT_EQ(wire.TakePiece(sent + wire.IdleTime())->bytes.size(), half.size());
  // The frame behind it is cut as if nothing had been.
  wire.Transmit(sent + 2 * wire.IdleTime(), frame);
  ASSERT_EQ(filter.chunks.size(), 2U);
  EXPECT_EQ(filter.chunks[0].bytes, half);
  EXPECT_EQ(filter.chunks[1].bytes, frame);
  // Its receiver may find an end in it, of the frame that it has begun to read.
  Bytes arrived;
  wire.Take(sent + kNsPerS, [&](BootTime /*arrival*/, std::span<const std::uint8_t> bytes) {
    arrived.insert(arrived.end(), bytes.begin(), bytes.end());
  });
  EXPECT_EQ(arrived, frame);
}

// The role of a byte says what its damage does.
TEST_P(FramingTest, RolesSayWhatADamagedByteChanges) {
  for (std::size_t size = 1; size < 300; ++size) {
    const Bytes payload = Payload(size % kPayloadBytesMax + 1);
    const Bytes frame = framing_->Encode(payload);
    const std::vector<ByteRole> roles = framing_->Roles(frame);
    ASSERT_EQ(roles.size(), frame.size());
    const std::size_t at = Below(frame.size());
    Bytes damaged = frame;
    damaged[at] ^= 1;
    const auto parts = framing_->Split(damaged);
    switch (roles[at]) {
      case ByteRole::kFlagByte:
        EXPECT_EQ(frame[at], framing_->flag());
        break;
      case ByteRole::kEscapeByte:
        EXPECT_EQ(frame[at], framing_->escape());
        break;
      case ByteRole::kSync:
      case ByteRole::kLength:
        EXPECT_FALSE(parts);
        break;
      case ByteRole::kPayload:
        if (parts && parts->payload.size() == payload.size()) {
          EXPECT_NE(parts->payload, payload);
        }
        break;
      case ByteRole::kCheck:
        if (parts && parts->payload.size() == payload.size()) {
          EXPECT_EQ(parts->payload, payload);
          EXPECT_NE(parts->damage, 0U);
        }
        break;
      case ByteRole::kCode:
        EXPECT_FALSE(parts && parts->payload == payload && parts->damage == 0);
        break;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, FramingTest,
                         ::testing::Values("hdlc", "hdlc_crc32", "cobs", "cobs_sum8", "length_prefixed",
                                           "cobs_reference", "length_reference"),
                         [](const auto& tested) { return std::string(tested.param); });

// Frames, and what damage and noise make of them.
Bytes DamagedStream(const Framing& framing, std::mt19937& generator) {
  Bytes stream;
  for (int i = 0; i < 200; ++i) {
    Bytes payload(generator() % 40);
    const auto special = framing.special_bytes();
    for (std::uint8_t& byte : payload)
      byte = generator() % 2 == 0 ? special[generator() % special.size()]
                                  : static_cast<std::uint8_t>(generator());
    if (generator() % 40 == 0) payload.resize(kPayloadBytesMax + generator() % 8);
    Bytes frame = framing.Encode(payload);
    for (std::uint8_t& byte : frame)
      if (generator() % 100 == 0) byte = special[generator() % special.size()];
    if (generator() % 10 == 0)
      frame.erase(frame.begin() + static_cast<std::ptrdiff_t>(generator() % frame.size()));
    if (generator() % 10 == 0) frame.push_back(static_cast<std::uint8_t>(generator()));
    stream.insert(stream.end(), frame.begin(), frame.end());
  }
  return stream;
}

std::vector<Read> ReadAll(const Framing& framing, std::span<const std::uint8_t> stream, std::size_t piece) {
  return testing::ReadAll(framing, stream, piece, [](const FrameReading& /*reading*/) {});
}

std::vector<Bytes> Accepted(const std::vector<Read>& readings) {
  std::vector<Bytes> payloads;
  for (const Read& read : readings)
    if (read.status == "ok") payloads.push_back(read.payload);
  return payloads;
}

TEST_P(FramingTest, DamagedBytesGiveTheSameReadingsInAnyChunks) {
  for (int round = 0; round < 20; ++round) {
    const Bytes stream = DamagedStream(*framing_, generator_);
    const std::vector<Read> whole = ReadAll(*framing_, stream, stream.size());
    if (!std::string(GetParam()).ends_with("reference")) {
      EXPECT_GT(Accepted(whole).size(), 50U);
    }
    EXPECT_EQ(ReadAll(*framing_, stream, 1), whole);
    EXPECT_EQ(ReadAll(*framing_, stream, 7), whole);
    for (std::size_t i = 1; i < whole.size(); ++i)
      EXPECT_LE(whole[i - 1].content_end, whole[i].content_begin);
  }
}

TEST(Framings, CobsEqualsItsSlowReference) {
  const CobsFraming reference;
  const auto framing = MakeCobsFraming(CheckKind::kCrc16Ibm3740);
  std::mt19937 generator(11);
  for (int round = 0; round < 100; ++round) {
    Bytes payload(generator() % 600);
    for (std::uint8_t& byte : payload)
      byte = static_cast<std::uint8_t>(generator() % 3 == 0 ? 0 : generator());
    ASSERT_EQ(framing->Encode(payload), reference.Encode(payload));
    const Bytes stream = DamagedStream(reference, generator);
    std::vector<Bytes> expected = Accepted(ReadAll(reference, stream, 1));
    std::erase_if(expected,
                  [](const Bytes& bytes) { return bytes.empty() || bytes.size() > kPayloadBytesMax; });
    ASSERT_EQ(Accepted(ReadAll(*framing, stream, 5)), expected);
  }
}

TEST(Framings, RolesOfCobsEqualThoseOfItsSlowReference) {
  const CobsFraming reference;
  const auto framing = MakeCobsFraming(CheckKind::kCrc16Ibm3740);
  std::mt19937 generator(12);
  for (std::size_t size = 1; size < 600; ++size) {
    Bytes payload(size);
    for (std::uint8_t& byte : payload)
      byte =
          static_cast<std::uint8_t>(generator() % (size % 2 == 0 ? 3 : 300) == 0 ? 0 : 1 + generator() % 255);
    const Bytes frame = reference.Encode(payload);
    ASSERT_EQ(framing->Roles(frame), reference.Roles(frame)) << size;
  }
}

TEST(Framings, RolesOfWrittenFrames) {
  const auto roles = [](const Framing& framing, const Bytes& frame) {
    std::string text;
    for (const ByteRole role : framing.Roles(frame)) text += Name(role)[0];
    return text;
  };
  // "p" is payload, "f" a flag, "e" an escape, "c" a code or check, "s" a mark, "l" a length.
  EXPECT_EQ(roles(*HdlcFraming(), {0x7E, 0x7D, 0x5E, 0x01, 0x11, 0x7D, 0x5D, 0x7E}), "feppcecf");
  EXPECT_EQ(roles(*MakeCobsFraming(CheckKind::kSum8), {0x02, 0x05, 0x02, 0x05, 0x00}), "cpccf");
  EXPECT_EQ(roles(*MakeLengthFraming({.sync = {0xAA, 0x55}, .length_bytes = 2}, CheckKind::kCrc16Ibm3740),
                  {0xAA, 0x55, 0x01, 0x00, 0x07, 0x01, 0x02}),
            "ssllpcc");
  EXPECT_TRUE(HdlcFraming()->Has(ByteRole::kEscapeByte));
  EXPECT_FALSE(HdlcFraming()->Has(ByteRole::kLength));
}

// The worked examples of the paper (Cheshire and Baker, section IV) in bytes.
TEST(Framings, CobsStuffsAsPublished) {
  const auto framing = MakeCobsFraming(CheckKind::kNone);
  EXPECT_EQ(framing->Encode(Bytes{0x00}), (Bytes{0x01, 0x01, 0x00}));
  EXPECT_EQ(framing->Encode(Bytes{0x11, 0x22, 0x00, 0x33}), (Bytes{0x03, 0x11, 0x22, 0x02, 0x33, 0x00}));
  Bytes full(254), expected = {0xFF};
  for (std::size_t i = 0; i < full.size(); ++i) full[i] = static_cast<std::uint8_t>(1 + i);
  expected.insert(expected.end(), full.begin(), full.end());
  expected.push_back(0x00);
  EXPECT_EQ(framing->Encode(full), expected);
}

// With a check of the same length, all but the check's own verdict is that of the firmware's codec.
TEST(Framings, HdlcWithAnotherCheckReadsAsTheCodecDoes) {
  const auto framing = MakeHdlcFraming(CheckKind::kCrc16IbmSdlc);
  std::mt19937 generator(13);
  const auto without_verdict = [](std::vector<Read> readings) {
    for (Read& read : readings)
      if (read.status == "ok" || read.status == "empty") read.status = "bad_checksum";
    return readings;
  };
  for (int round = 0; round < 100; ++round) {
    const Bytes stream = DamagedStream(*HdlcFraming(), generator);
    const std::size_t piece = 1 + generator() % 50;
    ASSERT_EQ(without_verdict(ReadAll(*framing, stream, piece)),
              without_verdict(ReadAll(*HdlcFraming(), stream, piece)));
  }
}

TEST(Framings, ADamagedLengthTakesTheFramesThatFollow) {
  const auto framing = MakeLengthFraming({.sync = {0xAA, 0x55}}, CheckKind::kCrc16Ibm3740);
  const Bytes first = framing->Encode(Bytes{1, 2, 3}), second = framing->Encode(Bytes{4, 5, 6}),
              third = framing->Encode(Bytes{7});
  Bytes stream = first;
  stream[2] = 3 + 8;  // the length now reaches to the end of the second frame
  stream.insert(stream.end(), second.begin(), second.end());
  stream.insert(stream.end(), third.begin(), third.end());
  const std::vector<Read> readings = ReadAll(*framing, stream, 4);
  ASSERT_EQ(readings.size(), 2U);
  EXPECT_EQ(readings[0].status, "bad_checksum");
  EXPECT_EQ(readings[0].end, first.size() + second.size());
  EXPECT_EQ(readings[1].status, "ok");
  EXPECT_EQ(readings[1].payload, Bytes{7});
}

TEST(Framings, StrayBytesInFrontOfTheMarksAreNoFrame) {
  const auto framing = MakeLengthFraming({.sync = {0xAA, 0xAA, 0x55}}, CheckKind::kSum8);
  Bytes stream = {0x01, 0xAA};  // one mark more than a frame has
  const Bytes frame = framing->Encode(Bytes{9, 8});
  stream.insert(stream.end(), frame.begin(), frame.end());
  stream.push_back(0xAA);
  const std::vector<Read> readings = ReadAll(*framing, stream, 1);
  ASSERT_EQ(readings.size(), 3U);
  EXPECT_EQ(readings[0].status, "no_sync");
  EXPECT_EQ(readings[0].content_end, 2U);
  EXPECT_EQ(readings[1].status, "ok");
  EXPECT_EQ(readings[1].begin, 2U);
  EXPECT_EQ(readings[2].status, "no_sync");
  // A length that no frame has.
  EXPECT_EQ(ReadAll(*MakeLengthFraming({.sync = {0xAA}, .length_bytes = 2}, CheckKind::kSum8),
                    Bytes{0xAA, 0x01, 0x01, 0xAA}, 2)[0]
                .status,
            "bad_length");
}

// The rule in the header, byte by byte.
RC_GTEST_PROP(FlagCutter, EndsAFrameAtAFlagBehindAnotherByte, (const std::vector<bool>& is_flag)) {
  Bytes bytes;
  std::vector<std::size_t> expected;
  for (std::size_t i = 0; i < is_flag.size(); ++i) {
    bytes.push_back(is_flag[i] ? 0x7E : 0x11);
    if (i > 0 && is_flag[i] && !is_flag[i - 1]) expected.push_back(i + 1);
  }
  FlagCutter whole(0x7E), single(0x7E);
  std::vector<std::size_t> found, found_singly;
  std::size_t at = 0;
  while (const auto end = whole.FindEnd(std::span(bytes).subspan(at))) found.push_back(at += *end);
  for (std::size_t i = 0; i < bytes.size(); ++i)
    if (single.FindEnd({&bytes[i], 1})) found_singly.push_back(i + 1);
  RC_ASSERT(found == expected);
  RC_ASSERT(found_singly == expected);
}

}  // namespace
}  // namespace tiltproof::link
