// Faults on frames do to the messages of a line what they do, whatever its framing.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "faults/frame_edit.h"
#include "harness/scenario/shipped_protocols.h"
#include "tests/faults/faulty_line.h"
#include "tests/support/tiny_framings.h"

namespace tiltproof::faults {
namespace {

using link::CobsFraming;
using link::LengthFraming;
using link::PaperOver;
using link::Protocol;

std::shared_ptr<const Protocol> Paper() { return harness::FindProtocol("paper"); }
std::shared_ptr<const Protocol> Cobs() { return PaperOver(std::make_shared<CobsFraming>()); }
std::shared_ptr<const Protocol> Length() { return PaperOver(std::make_shared<LengthFraming>()); }

// Frames of sensors, every 12 ms, behind the fault; as bytes.
std::vector<std::vector<Bytes>> Send(const FaultSpec& spec, const std::shared_ptr<const Protocol>& protocol,
                                     int count = 300) {
  FaultSchedule schedule({spec}, 1, {.protocol = protocol});
  schedule.SetOrigin(kOriginAtPowerOn);
  const link::MessageType& type = *protocol->Find("reply");
  std::vector<std::vector<Bytes>> out;
  for (int n = 0; n < count; ++n) {
    std::vector<double> values;
    for (std::size_t i = 0; i < type.fields.size(); ++i)
      values.push_back(static_cast<double>(n) + 0.5 * static_cast<double>(i));
    std::vector<link::Chunk> chunks = {
        {.begin_ns = kOriginAtPowerOn.ToBootTime(FrameTime(n)),
         .bytes = protocol->framing->Encode(protocol->Encode(type, values).span()),
         .message = static_cast<std::uint8_t>(&type - protocol->messages.data()),
         .number = static_cast<std::uint64_t>(n)}};
    if (auto* filter = schedule.Filter(link::Direction::kToClient)) filter->Apply(chunks);
    auto& bytes = out.emplace_back();
    for (const link::Chunk& chunk : chunks) bytes.push_back(chunk.bytes);
  }
  return out;
}

struct Read {
  std::vector<Bytes> payloads;  // of those that are whole
  std::size_t rejected_count = 0;
};
Read Decode(const std::vector<std::vector<Bytes>>& sent, const Protocol& protocol) {
  const auto reader = protocol.framing->MakeReader();
  Read all;
  for (const auto& chunks : sent) {
    for (const Bytes& chunk : chunks) {
      std::span<const std::uint8_t> bytes(chunk);
      while (const auto read = reader->Next(bytes)) {
        if (read->ok)
          all.payloads.emplace_back(read->payload.begin(), read->payload.end());
        else
          ++all.rejected_count;
      }
    }
  }
  return all;
}

TEST(Framings, PayloadsChangeInTheSameWay) {
  for (const FaultSpec& spec :
       {Spec("frame.short", {{"bytes_count", 3.0}, {"probability", 0.5}}),
        Spec("frame.long", {{"bytes_count", 5.0}, {"probability", 0.5}}),
        Spec("frame.wrong_id", {{"id", 9.0}, {"probability", 0.5}}),
        Spec("frame.semantic",
             {{"field", "z_m"}, {"kind", "sign_flip"}, {"probability", 0.5}, {"value", 0.0}}),
        Spec("frame.unsolicited", {{"rate_hz", 50.0}}), Spec("frame.drop", {{"probability", 0.3}}),
        Spec("frame.duplicate", {{"probability", 0.3}}),
        Spec("frame.reorder", {{"probability", 0.3}, {"depth_count", 2.0}}),
        Spec("frame.replay_stale", {{"probability", 0.3}, {"age_count", 3.0}})}) {
    const Read expected = Decode(Send(spec, Paper()), *Paper());
    EXPECT_EQ(expected.rejected_count, 0U) << spec.type;
    for (const auto& protocol : {Cobs(), Length()}) {
      const Read found = Decode(Send(spec, protocol), *protocol);
      EXPECT_EQ(found.payloads, expected.payloads) << spec.type << " over " << protocol->framing->name();
      EXPECT_EQ(found.rejected_count, 0U) << spec.type << " over " << protocol->framing->name();
    }
  }
}

TEST(Framings, ADamagedFrameStaysDamaged) {
  for (const auto& protocol : {Paper(), Cobs(), Length()}) {
    const link::Framing& framing = *protocol->framing;
    Bytes frame = framing.Encode(Bytes{1, 2, 3, 4, 5, 6, 7, 8});
    frame[4] ^= 8;
    FrameEdit edit(framing, frame);
    ASSERT_TRUE(edit.ok());
    edit.payload().pop_back();
    edit.WriteTo(frame);
    const auto parts = framing.Split(frame);
    EXPECT_EQ(parts->payload.size(), 7U);
    EXPECT_NE(parts->damage, 0U);
  }
}

TEST(Framings, ChecksumPreservingPassesEachCheckThatHasABlindSpot) {
  const FaultSpec spec = Spec("frame.checksum_preserving", {{"probability", 1.0}});
  const Read honest = Decode(Send(Spec("harness.null"), Cobs()), *Cobs());
  const Read found = Decode(Send(spec, Cobs()), *Cobs());
  EXPECT_EQ(found.rejected_count, 0U);
  ASSERT_EQ(found.payloads.size(), honest.payloads.size());
  for (std::size_t i = 0; i < honest.payloads.size(); ++i) {
    EXPECT_NE(found.payloads[i], honest.payloads[i]);
    EXPECT_EQ(found.payloads[i].size(), honest.payloads[i].size());
  }
  EXPECT_EQ(Send(spec, Length()), Send(Spec("harness.null"), Length())) << "no change is known";
}

TEST(Framings, AFlagMayBeLostOrForgedWhereThereIsOne) {
  const auto honest = Send(Spec("harness.null"), Cobs());
  const auto lost = Send(Spec("frame.flag_loss", {{"probability", 1.0}}), Cobs());
  const auto forged = Send(Spec("frame.flag_forgery", {{"probability", 1.0}}), Cobs());
  for (std::size_t n = 0; n < honest.size(); ++n) {
    Bytes expected = honest[n][0];
    ASSERT_EQ(std::count(forged[n][0].begin(), forged[n][0].end(), 0), 2);
    const auto place = std::find(forged[n][0].begin(), forged[n][0].end(), 0) - forged[n][0].begin();
    Bytes split = expected;
    split[static_cast<std::size_t>(place)] = 0;
    EXPECT_EQ(forged[n][0], split);
    expected.pop_back();
    EXPECT_EQ(lost[n][0], expected);
  }
  EXPECT_TRUE(Decode(lost, *Cobs()).payloads.empty());
  EXPECT_TRUE(Decode(forged, *Cobs()).payloads.empty());
}

TEST(Framings, NoiseHasTheFlagAtItsEnds) {
  const FaultSpec spec = Spec("frame.babble", {{"rate_hz", 100.0}});
  const auto paper = Send(spec, Paper()), cobs = Send(spec, Cobs()), length = Send(spec, Length());
  std::size_t noises = 0;
  for (std::size_t n = 0; n < paper.size(); ++n) {
    ASSERT_EQ(cobs[n].size(), paper[n].size());
    ASSERT_EQ(length[n].size(), paper[n].size());
    for (std::size_t i = 1; i < paper[n].size(); ++i, ++noises) {
      Bytes expected = paper[n][i];
      EXPECT_EQ(expected.front(), 0x7E);
      EXPECT_EQ(expected.back(), 0x7E);
      expected.front() = expected.back() = 0;
      EXPECT_EQ(cobs[n][i], expected);
      EXPECT_EQ(length[n][i].size(), expected.size());
    }
  }
  EXPECT_GT(noises, 100U);
}

TEST(Framings, AFaultThatNeedsAFlagOrAnEscapeSaysSo) {
  const auto problem = [](const char* type, const std::shared_ptr<const Protocol>& protocol) {
    const auto found = ProtocolProblem(ExampleSpec(*FindFaultType(type)), *protocol);
    return found ? found->key + ": " + found->message : "";
  };
  EXPECT_EQ(
      problem("frame.dangling_escape", Cobs()),
      "type: frame.dangling_escape needs frames with escaped bytes; the protocol 'paper' has the framing "
      "'cobs' without: use one of frame.flag_loss, frame.flag_forgery, frame.truncate");
  EXPECT_EQ(
      problem("frame.flag_loss", Length()),
      "type: frame.flag_loss needs frames with a flag at their end; the protocol 'paper' has the framing "
      "'length' without: use one of frame.length_error, frame.truncate");
  EXPECT_NE(problem("frame.flag_forgery", Length()), "");
  EXPECT_EQ(
      problem("frame.length_error", Paper()),
      "type: frame.length_error needs frames with a length in front; the protocol 'paper' has the framing "
      "'hdlc' without: use one of frame.flag_loss, frame.flag_forgery, frame.dangling_escape, "
      "frame.truncate");
  EXPECT_EQ(problem("frame.length_error", Length()), "");
  EXPECT_EQ(problem("frame.flag_loss", Cobs()), "");
  EXPECT_EQ(problem("frame.drop", Length()), "");
  EXPECT_EQ(problem("sensor.bias", Length()), "");
  for (const FaultType& type : FaultTypes()) {
    if (type.name == "frame.length_error") continue;
    EXPECT_EQ(problem(std::string(type.name).c_str(), Paper()), "");
  }
}

// A protocol whose messages have ids of one byte and integers.
std::shared_ptr<const Protocol> Integers() {
  auto protocol = std::make_shared<Protocol>(*Paper());
  protocol->name = "integers";
  protocol->messages.clear();
  const auto add = [&](link::MessageKind kind, link::Direction direction, std::uint32_t id,
                       std::vector<link::MessageField> fields) {
    protocol->messages.push_back(
        link::LayOut({.name = std::string(link::Name(kind)),
                      .kind = kind,
                      .direction = direction,
                      .id = link::MessageId{.type = link::NumberType::kU8, .bits = id},
                      .fields = std::move(fields)}));
  };
  add(link::MessageKind::kRequest, link::Direction::kToPlant, 1, {});
  add(link::MessageKind::kReply, link::Direction::kToClient, 2,
      {{.signal = "z_m", .min = -20, .max = 20, .type = link::NumberType::kI16, .scale = 0.001},
       {.signal = "count", .min = 0, .max = 255, .type = link::NumberType::kU8},
       {.signal = "x_m",
        .min = -1e3,
        .max = 1e3,
        .type = link::NumberType::kF64,
        .order = link::ByteOrder::kBig}});
  return protocol;
}

TEST(Framings, ValuesThatAFieldCannotHoldAreRefused) {
  const auto problem = [](const char* field, const char* kind) {
    const auto found = ProtocolProblem(
        Spec("frame.semantic", {{"field", field}, {"kind", kind}, {"probability", 1.0}}), *Integers());
    return found ? found->key + ": " + found->message : "";
  };
  EXPECT_EQ(problem("z_m", "nan"),
            "parameters.kind: 'nan' is no value of z_m, which is sent as i16 in the protocol 'integers': use "
            "offset, sign_flip or stale");
  EXPECT_EQ(
      problem("count", "out_of_range"),
      "parameters.kind: 'out_of_range' is no value of count, which is sent as u8 with all its numbers in "
      "range in the protocol 'integers': use offset, sign_flip or stale");
  for (const char* kind : {"out_of_range", "sign_flip", "offset", "stale"})
    EXPECT_EQ(problem("z_m", kind), "");
  for (const char* kind : {"nan", "inf", "denormal", "out_of_range"}) EXPECT_EQ(problem("x_m", kind), "");
  const auto wrong_id = [](double id, const std::shared_ptr<const Protocol>& protocol) {
    const auto found = ProtocolProblem(Spec("frame.wrong_id", {{"id", id}, {"probability", 1.0}}), *protocol);
    return found ? found->key + ": " + found->message : "";
  };
  EXPECT_EQ(wrong_id(256, Integers()),
            "parameters.id: the ids of the protocol 'integers' are u8: must be a whole number from 0 to 255");
  EXPECT_NE(wrong_id(1.5, Integers()), "");
  EXPECT_EQ(wrong_id(255, Integers()), "");
  EXPECT_EQ(wrong_id(1.5, Paper()), "");
}

TEST(Framings, ValuesAndIdsAreWrittenAsTheProtocolSendsThem) {
  const auto protocol = Integers();
  const auto payload_of = [&](const FaultSpec& spec, const std::vector<double>& values) {
    FaultSchedule schedule({spec}, 1, {.protocol = protocol});
    schedule.SetOrigin(kOriginAtPowerOn);
    const link::MessageType& type = *protocol->Find("reply");
    std::vector<link::Chunk> chunks = {
        {.begin_ns = kOriginAtPowerOn.ToBootTime(0),
         .bytes = protocol->framing->Encode(protocol->Encode(type, values).span()),
         .message = static_cast<std::uint8_t>(&type - protocol->messages.data()),
         .number = 0}};
    schedule.Filter(link::Direction::kToClient)->Apply(chunks);
    return protocol->framing->Split(chunks.at(0).bytes)->payload;
  };
  // 3.5 m is 3500 mm: 0DAC, the low byte first. 1.0 is 3FF0... , the high byte first.
  EXPECT_EQ(payload_of(Spec("frame.wrong_id", {{"id", 9.0}, {"probability", 1.0}}), {3.5, 7, 1}),
            (Bytes{9, 0xAC, 0x0D, 7, 0x3F, 0xF0, 0, 0, 0, 0, 0, 0}));
  const auto semantic = [](const char* field, const char* kind, double value) {
    return Spec("frame.semantic", {{"field", field}, {"kind", kind}, {"probability", 1.0}, {"value", value}});
  };
  EXPECT_EQ(payload_of(semantic("z_m", "sign_flip", 0), {3.5, 7, 1}),
            (Bytes{2, 0x54, 0xF2, 7, 0x3F, 0xF0, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(payload_of(semantic("z_m", "out_of_range", 0), {3.5, 7, 1}),
            (Bytes{2, 0xFF, 0x7F, 7, 0x3F, 0xF0, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(payload_of(semantic("count", "offset", 250), {3.5, 7, 1}),
            (Bytes{2, 0xAC, 0x0D, 255, 0x3F, 0xF0, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(payload_of(semantic("x_m", "inf", 0), {3.5, 7, 1}),
            (Bytes{2, 0xAC, 0x0D, 7, 0x7F, 0xF0, 0, 0, 0, 0, 0, 0}));
}

// The receiver is the tiny reader, which shares no code with the fault.
TEST(Framings, AWrongLengthEatsItsNeighbours) {
  const auto honest = Send(Spec("harness.null"), Length());
  FaultSpec spec = Spec("frame.length_error", {{"probability", 1.0}});
  spec.every_nth_count = 10;
  const auto hit = Send(spec, Length());
  std::size_t changed = 0;
  for (std::size_t n = 0; n < honest.size(); ++n) {
    const Bytes &before = honest[n].at(0), &after = hit[n].at(0);
    ASSERT_EQ(after.size(), before.size());
    for (std::size_t i = 0; i < before.size(); ++i)
      if (after[i] != before[i]) {
        EXPECT_TRUE(i == 1 || i == 2) << "byte " << i << " is no length";
        ++changed;
      }
  }
  EXPECT_EQ(changed, 30U);
  const Read read = Decode(hit, *Length());
  EXPECT_LT(read.payloads.size(), honest.size() - 30) << "a length that is too large takes other frames";
}

TEST(Framings, AFrameThatLosesItsEndTakesTheNextOne) {
  FaultSpec spec = Spec("frame.truncate", {{"probability", 1.0}});
  spec.every_nth_count = 10;
  const std::size_t sent = 300;
  // The opening flag of the next frame ends it in HDLC alone.
  EXPECT_EQ(Decode(Send(spec, Paper()), *Paper()).payloads.size(), sent - 30);
  EXPECT_EQ(Decode(Send(spec, Cobs()), *Cobs()).payloads.size(), sent - 60 + 1) << "the last one has no next";
  EXPECT_LT(Decode(Send(spec, Length()), *Length()).payloads.size(), sent - 30);
}

}  // namespace
}  // namespace tiltproof::faults
