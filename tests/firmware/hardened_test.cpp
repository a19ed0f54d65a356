// The dialect `hardened` of the firmware against the harness's protocols and framings, which share no code with it.
// Before the codec: its kFlag would be shadowed by the role of that name.
#include "link/framing.h"
//
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "firmware/frame_sender.h"
#include "firmware/messages.h"
#include "firmware/reference_receiver.h"
#include "firmware/sensor_reader.h"
#include "harness/scenario/shipped_protocols.h"
#include "link/checksum.h"
#include "link/crc32.h"
#include "link/frame.h"
#include "link/hdlc_framing.h"
#include "link/protocol.h"
#include "tests/fuzz/differential.h"

namespace tiltproof::link::hardened_test {
namespace {

using firmware::FrameSender;
using firmware::ReferenceReceiver;
using firmware::SensorReader;
using ::testing::ElementsAre;
using tiltproof::testing::Bytes;
using tiltproof::testing::FromHex;
using tiltproof::testing::Hex;

constexpr Dialect kDialect = Dialect::kHardened;
constexpr Actuators kActuators = {10.2751F, 10.2799F, -0.015625F, 0.5F};

const Protocol& Hardened() { return *harness::FindProtocol("hardened"); }

// A message of the harness: stamp and values.
std::vector<double> RowOf(Stamp stamp) { return {double(stamp.sequence), double(stamp.time_us)}; }
template <class Group, class Fields>
std::vector<double> RowOf(Stamp stamp, const Group& group, const Fields& fields) {
  std::vector<double> row = RowOf(stamp);
  for (const auto& field : fields) row.push_back(double(group.*field.in_float));
  return row;
}
Bytes FrameOf(const char* message, const std::vector<double>& row) {
  return Hardened().framing->Encode(Hardened().Encode(*Hardened().Find(message), row).span());
}
template <class Group, class Fields>
Group RandomGroup(const Fields& fields) {
  Group group;
  for (const auto& field : fields)
    group.*field.in_float = static_cast<float>(*rc::gen::inRange(-99999, 100000)) * 1e-3F;
  return group;
}
Stamp RandomStamp() { return {*rc::gen::arbitrary<std::uint16_t>(), *rc::gen::arbitrary<std::uint32_t>()}; }

Bytes Framed(MessageBytes message, Stamp stamp) {
  SetStamp(kDialect, stamp, message);
  Bytes wire(FrameBytesMax(message.size, FrameCheck::kCrc32));
  const EncodedFrame frame = EncodeFrame(message.span(), wire, FrameCheck::kCrc32);
  return {frame.bytes.begin(), frame.bytes.end()};
}

// --- CRC-32.

TEST(Crc32, IsThatOfTheCatalogue) {
  constexpr std::string_view kCheckText = "123456789";  // its column `check`: cbf43926
  EXPECT_EQ(Crc32({reinterpret_cast<const std::uint8_t*>(kCheckText.data()), kCheckText.size()}),
            0xCBF43926U);
  EXPECT_EQ(Crc32({}), 0U);
}

RC_GTEST_PROP(Crc32Property, IsThatOfTheHarness, (const Bytes& bytes)) {
  RC_ASSERT(Crc32(bytes) == Checksum(CheckKind::kCrc32IsoHdlc, bytes));
}

// --- Frames.

RC_GTEST_PROP(HardenedFrame, IsThatOfTheHarness, (const Bytes& bytes)) {
  Bytes payload = bytes;
  for (const auto at : *rc::gen::container<std::vector<std::size_t>>(rc::gen::inRange<std::size_t>(0, 300)))
    if (at < payload.size()) payload[at] = *rc::gen::element(std::uint8_t{kFlag}, std::uint8_t{kEscape});
  const Bytes expected = Hardened().framing->Encode(payload);
  Bytes wire(FrameBytesMax(payload.size(), FrameCheck::kCrc32));
  const auto frame = EncodeFrame(payload, wire, FrameCheck::kCrc32).bytes;
  RC_ASSERT(Bytes(frame.begin(), frame.end()) == expected);
  // It fits exactly, and into nothing shorter.
  Bytes exact(expected.size()), shorter(expected.size() - 1, 0xAB);
  RC_ASSERT(EncodeFrame(payload, exact, FrameCheck::kCrc32).ok());
  RC_ASSERT(exact == expected);
  RC_ASSERT(!EncodeFrame(payload, shorter, FrameCheck::kCrc32).ok());
  RC_ASSERT(shorter == Bytes(shorter.size(), 0xAB));
}

struct Event {
  std::string status;
  Bytes payload;
  std::uint64_t begin, end;
  friend bool operator==(const Event&, const Event&) = default;
};

std::vector<Event> ByCodec(const Bytes& stream, std::size_t piece_bytes) {
  FrameDecoder decoder(FrameCheck::kCrc32);
  std::vector<Event> events;
  const auto note = [&](const FrameEvent& event) {
    events.push_back({std::string(Name(event.status)),
                      {event.payload.begin(), event.payload.end()},
                      event.begin,
                      event.end});
  };
  for (std::span<const std::uint8_t> rest(stream); !rest.empty();) {
    auto piece = rest.first(std::min(piece_bytes, rest.size()));
    rest = rest.subspan(piece.size());
    while (const auto event = decoder.Next(piece)) note(*event);
  }
  if (const auto event = decoder.Finish()) note(*event);
  return events;
}

std::vector<Event> ByFraming(const Bytes& stream) {
  const auto reader = Hardened().framing->MakeReader();
  std::vector<Event> events;
  const auto note = [&](const FrameReading& read) {
    events.push_back(
        {std::string(read.status), {read.payload.begin(), read.payload.end()}, read.begin, read.end});
  };
  std::span<const std::uint8_t> rest(stream);
  while (const auto read = reader->Next(rest)) note(*read);
  if (const auto read = reader->Finish()) note(*read);
  return events;
}

// Frames of all lengths up to one too long, some damaged, some cut, with noise between them.
Bytes RandomStream() {
  Bytes stream;
  const int frame_count = *rc::gen::inRange(0, 8);
  for (int i = 0; i < frame_count; ++i) {
    const auto size = *rc::gen::element<std::size_t>(0, 1, 23, 71, 255, 256, 257, 261);
    Bytes frame = Hardened().framing->Encode(*rc::gen::container<Bytes>(
        size,
        rc::gen::weightedElement<std::uint8_t>({{4, 0x11}, {2, 0x7D}, {2, 0x7E}, {1, 0x00}, {1, 0xFF}})));
    switch (*rc::gen::inRange(0, 4)) {
      case 0:
        frame[*rc::gen::inRange<std::size_t>(0, frame.size())] ^=
            *rc::gen::element<std::uint8_t>(1, 0x20, 0x80);
        break;
      case 1:
        frame.resize(*rc::gen::inRange<std::size_t>(0, frame.size()));
        break;
      default:
        break;
    }
    stream.insert(stream.end(), frame.begin(), frame.end());
  }
  return stream;
}

RC_GTEST_PROP(HardenedFrame, AnyStreamIsReadAsTheHarnessReadsIt, ()) {
  const Bytes stream = RandomStream();
  const auto expected = ByFraming(stream);
  RC_ASSERT(ByCodec(stream, stream.size() + 1) == expected);
  RC_ASSERT(ByCodec(stream, *rc::gen::inRange<std::size_t>(1, 20)) == expected);
}

TEST(HardenedFrame, ReadsEveryStatus) {
  const std::array<const char*, 7> streams = {
      "7e7e117e", "117e", "7e1122337e", "7e000000007e", "7e11227d7e", "7e1122", "7e01000000000000000000007e"};
  for (const char* hex : streams) EXPECT_EQ(ByCodec(FromHex(hex), 100), ByFraming(FromHex(hex))) << hex;
  const auto statuses = [](const char* hex) {
    std::vector<std::string> names;
    for (const Event& event : ByCodec(FromHex(hex), 100)) names.push_back(event.status);
    return names;
  };
  EXPECT_THAT(statuses("7e1122337e"), ElementsAre("too_short"));
  EXPECT_THAT(statuses("7e000000007e"), ElementsAre("empty"));
  EXPECT_THAT(statuses("7e01000000000000000000007e"), ElementsAre("bad_checksum"));
}

// --- Messages.

TEST(HardenedMessages, OnTheWire) {
  // The checks are zlib's.
  EXPECT_EQ(Hex(Framed(EncodeStart(kDialect, kActuators), {0x0102, 0x7E030405})),
            "7e0102010504037d5e670bf4e77e");
  EXPECT_EQ(Hex(Framed(EncodeReadSensors(kDialect), {})), "7e0200000000000057cef30a7e");
  EXPECT_EQ(Hex(Framed(EncodeActuators(kDialect, kActuators), {0xFFFF, 0xFFFFFFFF})),
            "7e03ffffffffffffcf662441787a2441000080bc0000003f22745e3e7e");
  EXPECT_EQ(
      Hex(Framed(EncodeReference({2.0F, 0.5F, 1.25F, -3.0F, 0.1F, 0.0F, -0.25F}, kDialect), {1, 12000})),
      "7e050100e02e0000000000400000003f0000a03f000040c0cdcccc3d00000000000080be3475892d7e");
}

RC_GTEST_PROP(HardenedMessages, AreThoseOfTheHarness, ()) {
  const Stamp stamp = RandomStamp();
  const auto actuators = RandomGroup<Actuators>(kActuatorFields);
  const std::vector<double> none = RowOf(stamp);
  RC_ASSERT(Framed(EncodeStart(kDialect, actuators), stamp) == FrameOf("start", none));
  RC_ASSERT(Framed(EncodeReadSensors(kDialect), stamp) == FrameOf("request", none));
  RC_ASSERT(Framed(EncodeActuators(kDialect, actuators), stamp) ==
            FrameOf("actuators", RowOf(stamp, actuators, kActuatorFields)));
  const auto sensors = RandomGroup<Sensors>(kSensorFields);
  RC_ASSERT(Framed(EncodeSensors(sensors, kDialect), stamp) ==
            FrameOf("reply", RowOf(stamp, sensors, kSensorFields)));
  const auto reference = RandomGroup<Reference>(kReferenceFields);
  RC_ASSERT(Framed(EncodeReference(reference, kDialect), stamp) ==
            FrameOf("reference", RowOf(stamp, reference, kReferenceFields)));
}

// Any payload, most of them near a message: the status is that of the harness's table, and so is the content.
RC_GTEST_PROP(HardenedMessages, AnyPayloadIsJudgedAsTheHarnessJudgesIt, ()) {
  const auto size = *rc::gen::element<std::size_t>(0, 1, 6, 7, 8, 22, 23, 24, 35, 71);
  Bytes payload = *rc::gen::container<Bytes>(size, rc::gen::arbitrary<std::uint8_t>());
  if (!payload.empty()) payload[0] = static_cast<std::uint8_t>(*rc::gen::inRange(0, 7));
  // Floats of a usual size.
  for (std::size_t at = 7; at + 4 <= size && *rc::gen::inRange(0, 20) > 0; at += 4)
    StoreNumber(NumberType::kF32, ByteOrder::kLittle, *rc::gen::inRange(-90, 90),
                std::span(payload).subspan(at));

  Message expected;
  const MessageStatus status = Hardened().Decode(Direction::kToPlant, payload, expected);
  ClientMessage message;
  RC_ASSERT(DecodeClientMessage(kDialect, payload, message) == status);
  if (status == MessageStatus::kOk) {
    RC_ASSERT(message.start == (expected.type->name == "start"));
    RC_ASSERT(message.read_sensors == (expected.type->name == "request"));
    const auto row = message.has_actuators ? RowOf(message.stamp, message.actuators, kActuatorFields)
                                           : RowOf(message.stamp);
    RC_ASSERT(row == expected.values);
  }
  HeaderFilter replies(kDialect, MessageKind::kReply), references(kDialect, MessageKind::kReference);
  const auto as_reply = replies.Values(payload), as_reference = references.Values(payload);
  Sensors sensors;
  Reference reference;
  const bool is_reply = as_reply && DecodeSensors(*as_reply, sensors) == MessageStatus::kOk;
  const bool is_reference = as_reference && DecodeReference(*as_reference, reference) == MessageStatus::kOk;
  RC_ASSERT(is_reply == (Hardened().Decode(Direction::kToClient, payload, expected) == MessageStatus::kOk));
  if (is_reply)
    for (std::size_t i = 0; i < kSensorCount; ++i)
      RC_ASSERT(double(sensors.*kSensorFields[i].in_float) == expected.values[2 + i]);
  RC_ASSERT(is_reference ==
            (Hardened().Decode(Direction::kReference, payload, expected) == MessageStatus::kOk));
}

// --- Numbers and times.

Bytes Header(std::uint8_t id, std::uint64_t number, std::uint64_t time_us) {
  Bytes bytes = {id, static_cast<std::uint8_t>(number), static_cast<std::uint8_t>(number >> 8)};
  for (unsigned shift = 0; shift < 32; shift += 8)
    bytes.push_back(static_cast<std::uint8_t>(time_us >> shift));
  return bytes;
}

// Numbers that do not wrap tell which message is newer.
RC_GTEST_PROP(HeaderFilter, TakesWhatIsNewerOnly, ()) {
  HeaderFilter filter(kDialect, MessageKind::kReply);
  std::uint64_t number = *rc::gen::inRange<std::uint64_t>(0, 70'000),
                time_us = *rc::gen::element(0ULL, 0xFFFF'FF00ULL);
  std::optional<std::pair<std::uint64_t, std::uint64_t>> last;
  for (int i = 0; i < 30; ++i) {
    number += static_cast<std::uint64_t>(*rc::gen::inRange(0, 4));
    time_us += static_cast<std::uint64_t>(*rc::gen::inRange(0, 3));
    const auto back =
        static_cast<std::uint64_t>(*rc::gen::weightedElement<int>({{6, 0}, {1, 1}, {1, 3}, {1, 300}}));
    const std::uint64_t sent_number = number - std::min(back, number);
    const std::uint64_t sent_us =
        time_us - (*rc::gen::inRange(0, 9) == 0 ? std::min<std::uint64_t>(time_us, 5) : 0);
    const bool is_newer = !last || (sent_number > last->first && sent_us >= last->second);
    const Bytes payload = Header(4, sent_number, sent_us);
    RC_ASSERT(filter.Values(payload).has_value() == is_newer);
    if (!is_newer || *rc::gen::inRange(0, 4) == 0) continue;  // a message may be refused for its values
    filter.Accept();
    last = {sent_number, sent_us};
  }
}

TEST(HeaderFilter, HalfOfAllNumbersIsNewer) {
  for (const std::uint32_t ahead : {0U, 1U, 0x7FFFU, 0x8000U, 0xFFFFU}) {
    HeaderFilter filter(kDialect, MessageKind::kReference);
    ASSERT_TRUE(filter.Values(Header(5, 0xFFF0, 0xFFFF'FFF0)));
    filter.Accept();
    EXPECT_EQ(filter.Values(Header(5, 0xFFF0 + ahead, 0xFFFF'FFF0)).has_value(), 0 < ahead && ahead < 0x8000)
        << ahead;
  }
  for (const std::uint64_t later_us : {0ULL, 1ULL, 0x7FFF'FFFFULL, 0x8000'0000ULL, 0xFFFF'FFFFULL}) {
    HeaderFilter filter(kDialect, MessageKind::kReference);
    ASSERT_TRUE(filter.Values(Header(5, 7, 0xFFFF'FFF0)));
    filter.Accept();
    EXPECT_EQ(filter.Values(Header(5, 8, 0xFFFF'FFF0 + later_us)).has_value(), later_us < 0x8000'0000);
  }
}

TEST(HeaderFilter, OtherDialectsHaveNoHeader) {
  HeaderFilter filter(Dialect::kPaper, MessageKind::kReply);
  const Bytes payload(64, 7);
  for (int i = 0; i < 3; ++i) {
    const auto values = filter.Values(payload);
    ASSERT_TRUE(values);
    EXPECT_EQ(values->size(), 64U);
    filter.Accept();
  }
}

// --- In the firmware.

struct Line final : firmware::Port {
  TimeNs Transmit(firmware::Uart, TimeNs now, std::span<const std::uint8_t> bytes) override {
    sent.emplace_back(bytes.begin(), bytes.end());
    return now;
  }
  void Log(TimeNs, const char*) override {}
  std::vector<Bytes> sent;
};

TEST(FrameSender, NumbersEachMessageAndNoTwoHaveOneTime) {
  Line line;
  FrameSender sender(kDialect, line);
  const std::array<TimeNs, 7> times = {5 * kNsPerMs,
                                       5 * kNsPerMs,
                                       5 * kNsPerMs,
                                       6 * kNsPerMs,
                                       3'000'000'000 * kNsPerUs,
                                       4'294'967'295 * kNsPerUs,
                                       4'294'967'296 * kNsPerUs};
  for (const TimeNs now : times) sender.Send(now, EncodeReadSensors(kDialect));
  const std::array<std::uint32_t, 7> expected_us = {5000, 5001, 5002, 6000, 3'000'000'000, 0xFFFF'FFFF, 0};
  std::vector<Bytes> expected;
  for (std::uint16_t i = 0; i < expected_us.size(); ++i)
    expected.push_back(FrameOf("request", {double(i), double(expected_us[i])}));
  EXPECT_EQ(line.sent, expected);
  for (std::uint32_t i = expected_us.size(); i < 65'537; ++i) {
    line.sent.clear();
    sender.Send(4'300'000'000 * kNsPerUs + i * kNsPerMs, EncodeReadSensors(kDialect));
  }
  EXPECT_EQ(ByFraming(line.sent[0])[0].payload[1], 0);  // 65536 wraps
}

TEST(SensorReader, RefusesARepeatedReplyAndAnOlderOne) {
  for (const auto late : {firmware::LateReplies::kDropped, firmware::LateReplies::kKept}) {
    Line line;
    SensorReader reader(kDialect, firmware::ValueChecks::kFiniteAndRange, late, line);
    const auto answer = [&](std::uint16_t number, std::uint32_t time_us, float x_m) {
      reader.Receive(FrameOf("reply", RowOf({number, time_us}, Sensors{.x_m = x_m}, kSensorFields)));
      const auto reply = reader.TakeReply();
      return reply ? std::optional<float>(reply->x_m) : std::nullopt;
    };
    TimeNs now = 0;
    const auto request = [&] { reader.Request(now += 12 * kNsPerMs); };
    request();
    EXPECT_EQ(answer(10, 1000, 1), 1.0F);
    request();
    EXPECT_EQ(answer(10, 1000, 1), std::nullopt) << "repeated";
    EXPECT_EQ(answer(9, 900, 2), std::nullopt) << "older";
    EXPECT_EQ(answer(11, 999, 2), std::nullopt) << "of an earlier time";
    EXPECT_TRUE(reader.waiting());
    request();
    EXPECT_EQ(answer(13, 25'000, 3), 3.0F);
    request();
    reader.Receive(HdlcFraming()->Encode(EncodeSensors({.x_m = 4}).span()));
    EXPECT_FALSE(reader.TakeReply()) << "the paper's";
  }
}

TEST(ReferenceReceiver, RefusesARepeatedReferenceAndAnOlderOne) {
  ReferenceReceiver receiver(kDialect, firmware::ValueChecks::kNone);
  const auto take = [&](std::uint16_t number, std::uint32_t time_us, float x_m) {
    receiver.Receive(FrameOf("reference", RowOf({number, time_us}, Reference{.x_m = x_m}, kReferenceFields)));
    const auto reference = receiver.TakeReference();
    return reference ? std::optional<float>(reference->x_m) : std::nullopt;
  };
  EXPECT_EQ(take(65535, 7, 1), 1.0F);
  EXPECT_EQ(take(0, 19, 2), 2.0F);
  EXPECT_EQ(take(65535, 7, 1), std::nullopt);
  EXPECT_EQ(take(0, 19, 2), std::nullopt);
  EXPECT_EQ(take(1, 18, 2), std::nullopt);
  EXPECT_EQ(take(1, 31, 3), 3.0F);
}

}  // namespace
}  // namespace tiltproof::link::hardened_test
