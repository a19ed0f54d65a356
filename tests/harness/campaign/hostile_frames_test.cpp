// Contents of hostile inputs, which the same seed makes again.
#include "harness/campaign/hostile_frames.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <set>
#include <string>
#include <variant>

#include "faults/frame_words.h"
#include "faults/registry.h"
#include "harness/campaign/broken_flight.h"
#include "harness/campaign/hostile_sequence.h"
#include "harness/engine/flight_job.h"
#include "harness/scenario/shipped_protocols.h"
#include "link/cobs_framing.h"
#include "link/frame.h"
#include "link/hdlc_framing.h"
#include "link/length_framing.h"

namespace tiltproof::harness {
namespace {

using faults::Random;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

const link::Protocol& Paper() { return *FindProtocol("paper"); }
const link::Framing& Framing() { return *Paper().framing; }

TEST(HostileFrames, FramesAreThoseOfTheCodecAndLongerOnes) {
  Random random(3);
  for (std::size_t size = 0; size <= link::kPayloadBytesMax; ++size) {
    LineBytes payload(size);
    for (std::uint8_t& byte : payload) byte = static_cast<std::uint8_t>(0x7C + random.Below(4));
    std::array<std::uint8_t, link::FrameBytesMax(link::kPayloadBytesMax)> wire;
    const auto frame = link::EncodeFrame(payload, wire).bytes;
    EXPECT_EQ(Framing().Encode(payload), LineBytes(frame.begin(), frame.end())) << size;
  }
  EXPECT_THAT(Framing().Encode(LineBytes(300)), SizeIs(304));
}

TEST(HostileFrames, ADamagedChecksumIsAllThatIsWrong) {
  const LineBytes frame = Framing().Encode(LineBytes{1, 2, 3}, 0x0100);
  std::span<const std::uint8_t> rest(frame);
  link::FrameDecoder decoder;
  EXPECT_EQ(decoder.Next(rest)->status, link::FrameStatus::kBadChecksum);
}

TEST(HostileFrames, ValidOnesAreMessagesOfTheProtocol) {
  for (const link::Direction direction : {link::Direction::kToClient, link::Direction::kReference}) {
    const HostileFrames frames(Paper(), direction);
    Random random(5);
    for (int i = 0; i < 500; ++i) {
      const LineBytes frame = frames.Valid(random);
      std::span<const std::uint8_t> rest(frame);
      link::FrameDecoder decoder;
      const auto event = decoder.Next(rest);
      ASSERT_TRUE(event && event->status == link::FrameStatus::kOk);
      link::Message message;
      EXPECT_EQ(Paper().Decode(direction, event->payload, message), link::MessageStatus::kOk);
    }
  }
}

// A reader of frames hears every way in which a frame can be wrong, and every way in which a message can.
TEST(HostileFrames, EveryStatusOfTheDecoderAndOfMessagesComes) {
  const HostileFrames frames(Paper(), link::Direction::kToClient);
  std::set<link::FrameStatus> frame_statuses;
  std::set<link::MessageStatus> message_statuses;
  Random random(7);
  for (int i = 0; i < 20'000; ++i) {
    const LineBytes input = frames.Make(random);
    ASSERT_FALSE(input.empty());
    link::FrameDecoder decoder;
    std::span<const std::uint8_t> rest(input);
    const auto take = [&](const link::FrameEvent& event) {
      frame_statuses.insert(event.status);
      link::Message message;
      if (event.status == link::FrameStatus::kOk)
        message_statuses.insert(Paper().Decode(link::Direction::kToClient, event.payload, message));
    };
    while (const auto event = decoder.Next(rest)) take(*event);
    if (const auto event = decoder.Finish()) take(*event);
  }
  EXPECT_EQ(frame_statuses.size(), link::kFrameStatusCount);
  for (const auto status : {link::MessageStatus::kOk, link::MessageStatus::kBadLength,
                            link::MessageStatus::kNotFinite, link::MessageStatus::kOutOfRange})
    EXPECT_TRUE(message_statuses.contains(status)) << Name(status);
}

// A reply with a number of each type, beside one of another length.
link::Protocol AllNumbers(std::shared_ptr<const link::Framing> framing) {
  link::Protocol protocol;
  protocol.name = "numbers";
  protocol.framing = std::move(framing);
  protocol.control_period_ns = kNsPerS / 100;
  link::MessageType reply{.name = "reply",
                          .kind = link::MessageKind::kReply,
                          .direction = link::Direction::kToClient,
                          .id = link::MessageId{.type = link::NumberType::kU16, .bits = 3}};
  for (std::size_t i = 0; i < link::kNumberTypeCount; ++i)
    reply.fields.push_back({.signal = "s" + std::to_string(i),
                            .min = i % 2 == 0 ? 0.0 : -50.0,
                            .max = 50.0,
                            .type = static_cast<link::NumberType>(i),
                            .order = i % 3 == 0 ? link::ByteOrder::kBig : link::ByteOrder::kLittle,
                            .scale = i < 6 ? 0.5 : 1.0});
  protocol.messages.push_back(link::LayOut(std::move(reply)));
  protocol.messages.push_back(
      link::LayOut({.name = "empty",
                    .kind = link::MessageKind::kUnknown,
                    .direction = link::Direction::kToClient,
                    .id = link::MessageId{.type = link::NumberType::kU16, .bits = 9}}));
  return protocol;
}

struct FramingCase {
  const char* name;
  std::shared_ptr<const link::Framing> framing;
  std::set<std::string> statuses;  // all that its reader has
};
std::vector<FramingCase> FramingCases() {
  std::vector<FramingCase> cases;
  for (const auto check :
       {link::CheckKind::kFletcher16, link::CheckKind::kCrc16Ibm3740, link::CheckKind::kCrc16IbmSdlc,
        link::CheckKind::kCrc32IsoHdlc, link::CheckKind::kSum8, link::CheckKind::kNone}) {
    std::set<std::string> checked;
    if (check != link::CheckKind::kNone) checked = {"bad_checksum"};
    const auto with = [&](std::set<std::string> statuses) {
      statuses.insert(checked.begin(), checked.end());
      return statuses;
    };
    cases.push_back({"length_prefixed",
                     link::MakeLengthFraming({.sync = {0xAA, 0x55}, .length_bytes = 2}, check),
                     with({"ok", "bad_length", "no_sync", "aborted"})});
    if (check != link::CheckKind::kNone) checked.insert("too_short");
    cases.push_back({"cobs", link::MakeCobsFraming(check), with({"ok", "bad_code", "too_long", "aborted"})});
    if (check == link::CheckKind::kSum8)
      checked.erase("too_short");  // what is between two flags is a byte at least
    cases.push_back({"hdlc", link::MakeHdlcFraming(check),
                     with({"ok", "dangling_escape", "too_long", "aborted", "no_opening_flag"})});
  }
  return cases;
}

TEST(HostileFrames, EveryStatusOfEachFramingAndCheckComes) {
  for (const FramingCase& one : FramingCases()) {
    const link::Protocol protocol = AllNumbers(one.framing);
    const HostileFrames frames(protocol, link::Direction::kToClient);
    std::set<std::string> found;
    Random random(11);
    for (int i = 0; i < 20'000; ++i) {
      const LineBytes input = frames.Make(random);
      const auto reader = one.framing->MakeReader();
      std::span<const std::uint8_t> rest(input);
      while (const auto read = reader->Next(rest)) found.emplace(read->status);
      if (const auto read = reader->Finish()) found.emplace(read->status);
    }
    for (const std::string& status : one.statuses)
      EXPECT_TRUE(found.contains(status))
          << status << " of " << one.name << " with " << Name(*one.framing->check());
  }
}

// Valid frames are messages, and the values of broken ones reach the ends of each type and of each range, and beyond.
TEST(HostileFrames, NumbersOfEachTypeReachTheirEnds) {
  const link::Protocol protocol = AllNumbers(link::MakeCobsFraming(link::CheckKind::kCrc32IsoHdlc));
  const link::MessageType& reply = *protocol.Find("reply");
  const HostileFrames frames(protocol, link::Direction::kToClient);
  Random random(13);
  for (int i = 0; i < 500; ++i) {
    link::Message message;
    const auto parts = protocol.framing->Split(frames.Valid(random));
    ASSERT_EQ(protocol.Decode(link::Direction::kToClient, parts->payload, message), link::MessageStatus::kOk);
  }
  std::vector<std::set<double>> found(reply.fields.size());
  std::vector<int> nans(reply.fields.size());
  for (int i = 0; i < 60'000; ++i) {
    const auto parts = protocol.framing->Split(frames.Make(random));
    if (!parts || protocol.Classify(link::Direction::kToClient, parts->payload) != &reply) continue;
    for (std::size_t field = 0; field < found.size(); ++field) {
      const double value = link::FieldValue(reply, parts->payload, field);
      if (std::isnan(value))
        ++nans[field];
      else
        found[field].insert(value);
    }
  }
  for (std::size_t i = 0; i < found.size(); ++i) {
    const link::MessageField& field = reply.fields[i];
    if (link::IsInteger(field.type)) {
      for (const double number : {link::LeastNumber(field.type), link::LargestNumber(field.type)})
        EXPECT_TRUE(found[i].contains(field.scale * number)) << Name(field.type) << " " << number;
      EXPECT_TRUE(found[i].contains(field.max + field.scale))
          << Name(field.type) << ": just beyond its range";
    } else {
      EXPECT_GT(nans[i], 0);
      for (const double value : {std::numeric_limits<double>::infinity(), link::LeastNumber(field.type)})
        EXPECT_TRUE(found[i].contains(value)) << Name(field.type) << " " << value;
    }
  }
}

TEST(HostileFrames, CobsInputsHaveFullBlocksAndCodesBeyondTheEnd) {
  const auto framing = link::MakeCobsFraming(link::CheckKind::kCrc16Ibm3740);
  const link::Protocol protocol = AllNumbers(framing);
  const HostileFrames frames(protocol, link::Direction::kToClient);
  Random random(17);
  int full = 0, beyond = 0;
  for (int i = 0; i < 20'000; ++i) {
    const LineBytes input = frames.Make(random);
    const auto roles = framing->Roles(input);
    for (std::size_t at = 0; at < input.size(); ++at) {
      if (roles[at] != link::ByteRole::kCode) continue;
      const auto end = std::find(input.begin() + static_cast<std::ptrdiff_t>(at), input.end(), 0);
      const auto left = static_cast<std::size_t>(end - input.begin()) - at;
      if (input[at] > left)
        ++beyond;
      else if (input[at] == 0xFF)
        ++full;
    }
  }
  EXPECT_GT(full, 20);
  EXPECT_GT(beyond, 200);
}

// A number far ahead would make every receiver deaf, so hostile messages are numbered as the flight is.
TEST(HostileFrames, NumbersAndTimesAreNearThoseOfTheFlight) {
  const auto hardened = FindProtocol("hardened");
  ASSERT_NE(hardened, nullptr);
  const link::MessageType& reply = *hardened->Find("reply");
  const HostileFrames frames(*hardened, link::Direction::kToClient);
  Random random(19);
  int count = 0;
  for (std::int64_t period = 1; period < 3'000; ++period) {
    const LineBytes before = frames.Make(random);
    LineBytes input = before;
    Restamp(*hardened, link::Direction::kToClient, input, period * hardened->control_period_ns);
    const auto reader = hardened->framing->MakeReader(), unchanged = hardened->framing->MakeReader();
    std::span<const std::uint8_t> rest(input), rest_before(before);
    while (const auto read = reader->Next(rest)) {
      const auto was = unchanged->Next(rest_before);
      ASSERT_TRUE(was);
      EXPECT_EQ(read->status, was->status);
      if (!read->ok || hardened->Classify(link::Direction::kToClient, read->payload) != &reply) continue;
      for (std::size_t i = 2; i < reply.fields.size(); ++i)
        EXPECT_EQ(
            std::isnan(link::FieldValue(reply, read->payload, i)) ? 0.0
                                                                  : link::FieldValue(reply, read->payload, i),
            std::isnan(link::FieldValue(reply, was->payload, i)) ? 0.0
                                                                 : link::FieldValue(reply, was->payload, i));
      const double ahead = link::FieldValue(reply, read->payload, 0) - static_cast<double>(period);
      const double ahead_us =
          link::FieldValue(reply, read->payload, 1) - 12'000.0 * static_cast<double>(period);
      EXPECT_TRUE(ahead >= -4 && ahead <= 1) << ahead;
      EXPECT_TRUE(ahead_us >= -48'000 && ahead_us <= 12'000) << ahead_us;
      ++count;
    }
  }
  EXPECT_GT(count, 500);
}

HostileSequence SequenceOf(std::uint64_t seed, const HostileSequence& parent) {
  const HostileFrames frames(Paper(), link::Direction::kToClient);
  Random random(seed);
  return ChangeSequence(parent, parent, frames, 64, random);
}

TEST(HostileSequence, TheSameSeedMakesTheSame) {
  const HostileSequence first = SequenceOf(1, {});
  EXPECT_EQ(first, SequenceOf(1, {}));
  EXPECT_NE(first, SequenceOf(2, {}));
  const HostileSequence child = SequenceOf(3, first);
  EXPECT_EQ(child, SequenceOf(3, first));
  EXPECT_NE(child, first);
  EXPECT_THAT(child.inputs, SizeIs(64));
  EXPECT_THAT(child.inputs, Each(SizeIs(::testing::Le(kHostileBytesMax))));
}

TEST(HostileSequence, AFileOfTheCorpusReadsBack) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    HostileSequence sequence = SequenceOf(seed, {});
    if (seed % 2 == 0) sequence.target = faults::Target::kReference;
    EXPECT_EQ(ReadSequence(ToText(sequence)), sequence);
  }
  for (const char* wrong : {"", "7e", "to_client\n7e\n", "to_plant instead\n7e\n", "to_client beside\n7e\n",
                            "to_client instead\n7\n", "to_client instead\n7E\n"})
    EXPECT_THROW(ReadSequence(wrong), std::runtime_error) << wrong;
}

TEST(HostileSequence, WhatWasSaidEndsWithItsLastInput) {
  const HostileSequence sequence{.inputs = {{1}, {}, {2}, {}, {}, {3}}};
  EXPECT_EQ(InputsUntil(sequence, 0), 0U);
  EXPECT_EQ(InputsUntil(sequence, 1), 1U);
  EXPECT_EQ(InputsUntil(sequence, 2), 3U);
  EXPECT_EQ(InputsUntil(sequence, 3), 6U);
  EXPECT_EQ(InputsUntil(sequence, 9), 6U);
}

FlightResult Ended(EndReason end, Outcome outcome, const std::string& reason) {
  FlightResult result;
  result.end_reason = end;
  result.outcome = outcome;
  result.score.verdict = Verdict::kFail;
  result.score.reason = reason;
  return result;
}

// The bytes around an input decide what the receiver sees: minimised inputs leave out flags that the neighbours have.
TEST(HostileSequence, AReceiversViewHasTheFramesAround) {
  const auto described = [](std::string place, std::vector<LineBytes> inputs) {
    return Describe(
        {.target = faults::Target::kToClient, .place = std::move(place), .inputs = std::move(inputs)},
        Paper());
  };
  LineBytes payload(64);
  std::iota(payload.begin(), payload.end(), std::uint8_t{1});
  const LineBytes whole = Framing().Encode(payload);
  const LineBytes bare(whole.begin() + 1, whole.end() - 1);
  for (const char* place : {"instead", "before", "after"}) {
    EXPECT_THAT(described(place, {bare}), ElementsAre("reply of 64 bytes")) << place;
    EXPECT_THAT(described(place, {whole}), ElementsAre("reply of 64 bytes")) << place;
    EXPECT_THAT(described(place, {{0x7D}}), ElementsAre("dangling_escape of 1 byte")) << place;
    EXPECT_THAT(described(place, {{0x7E}, {}, {0x7E, 0x7E}}), ElementsAre("1 flag", "as it is", "2 flags"));
    EXPECT_THAT(described(place, {LineBytes(600)}), ElementsAre("too_long of 259 bytes"));
  }
  const std::vector<LineBytes> halves = {{bare.begin(), bare.begin() + 30}, {bare.begin() + 30, bare.end()}};
  EXPECT_THAT(described("instead", halves),
              ElementsAre("reply of 64 bytes (it ends in frame 2)", "the rest of frame 1"));
  EXPECT_THAT(described("before", halves),
              ElementsAre("bad_checksum of 30 bytes", "bad_checksum of 36 bytes"));
  EXPECT_THAT(described("instead", {LineBytes(600), {}, {1}}),
              ElementsAre("too_long of 259 bytes", "as it is", "too_short of 1 byte"));
}

TEST(BrokenFlight, TheSameDefectHasOneKeyWhereverItIsMet) {
  const auto key = [](const std::string& reason) {
    return BrokenBy(Ended(EndReason::kFirmwareCrashed, Outcome::kCrashed, reason))->key;
  };
  EXPECT_EQ(key("crashed at 0.168 s: heap-buffer-overflow on 0x60200001 in Decode mine.c:12"),
            key("crashed at 12 s: heap-buffer-overflow on 0x7fff0abc in Decode mine.c:12"));
  EXPECT_NE(key("crashed at 1 s: SEGV in Decode mine.c:12"), key("crashed at 1 s: SEGV in Decode mine.c:15"));
  EXPECT_NE(key("crashed at 1 s in Decode"), key("crashed at 1 s in Decode2"));
  EXPECT_NE(key("crashed at 1 s in Decode"),
            BrokenBy(Ended(EndReason::kFirmwareHung, Outcome::kHung, "crashed at 1 s in Decode"))->key);
  // Where the limit on processor time finds an image is chance.
  const auto key_of_cost = [](const std::string& place) {
    FlightResult costly =
        Ended(EndReason::kFirmwareHung, Outcome::kHung, "10.1 s of processor time; in " + place);
    costly.firmware_end = {.kind = FirmwareEndKind::kTooCostly};
    return BrokenBy(costly)->key;
  };
  EXPECT_EQ(key_of_cost("main (a.c:7)"), key_of_cost("Tick (a.c:9)"));
  EXPECT_EQ(KeyOfReason("x1 of 0.5 s, 3."), "x1 of # s, #.");
  EXPECT_EQ(KeyOfReason("3 at a.so+0x1f, b.c:33", true), "# at a.so+0x1f, b.c:33");
}

TEST(BrokenFlight, TwoTextsOfOnePlaceInALibraryAreOneDefect) {
  const auto crash = [](const std::string& how, const std::string& place) {
    FlightResult result = Ended(EndReason::kFirmwareCrashed, Outcome::kCrashed, how);
    result.firmware_end = {.kind = FirmwareEndKind::kInOwnCode, .place = place};
    return BrokenBy(result)->key;
  };
  EXPECT_EQ(crash("Aborted (free(): invalid next size (fast))", "mine.so+0x1a2b"), "crash: mine.so+0x1a2b");
  EXPECT_EQ(crash("Aborted", "mine.so+0x1a2b"), crash("Segmentation fault", "mine.so+0x1a2b"));
  EXPECT_NE(crash("Segmentation fault", "mine.so+0x1a2b"), crash("Segmentation fault", "mine.so+0x1a2c"));
  EXPECT_NE(crash("called exit(3) in receive", ""), crash("called exit(3) in grant", ""));
}

TEST(BrokenFlight, MemoryThatACallBackFindsDamagedIsOneDefectWhereverItIsFound) {
  const auto found = [](const std::string& call) {
    FlightResult result =
        Ended(EndReason::kCompleted, Outcome::kCrashed, "was killed by signal 6 in " + call);
    result.end_reason = std::nullopt;
    result.firmware_end = {.kind = FirmwareEndKind::kInCallBack};
    return *BrokenBy(result);
  };
  EXPECT_EQ(found("receive").key, found("grant").key);
  EXPECT_NE(found("receive").may_pass, "");
}

TEST(BrokenFlight, ACrashInAThreadMayComeTooLate) {
  FlightResult result = Ended(EndReason::kCompleted, Outcome::kCrashed, "a thread crashed");
  result.end_reason = std::nullopt;
  result.firmware_end = {.kind = FirmwareEndKind::kInThread, .place = "mine.so+0x12"};
  EXPECT_EQ(BrokenBy(result)->key, "crash: mine.so+0x12");
  EXPECT_THAT(BrokenBy(result)->may_pass, HasSubstr("thread"));
}

TEST(BrokenFlight, TheLastPlaceOfAnImageCountsToo) {
  const auto key = [](const std::string& where) {
    return BrokenBy(
               Ended(
                   EndReason::kFirmwareCrashed, Outcome::kCrashed,
                   "survival: firmware crashed at 0.1 s: the firmware crashed at 0.1 s: the processor locked "
                   "up at Handler (startup.c:12), in HardFault: a fault by Decode (" +
                       where + ")"))
        ->key;
  };
  EXPECT_NE(key("main.c:12"), key("main.c:13"));
}

FlightResult Breaks(const char* criterion) {
  FlightResult result = Ended(EndReason::kCompleted, Outcome::kUnaffected, "");
  CriterionResult& broken = result.score.criteria.emplace_back();
  broken.name = criterion;
  broken.verdict = Verdict::kFail;
  return result;
}

TEST(BrokenFlight, AMissingCheckIsOneDefectWhicheverFieldsItLetsThrough) {
  const auto key = [](const std::string& refused) {
    FlightResult result = Breaks("sends-only-messages");
    if (!refused.empty()) result.events.push_back({0.1, kCommandRefusedEvent, std::nullopt, refused});
    return BrokenBy(result)->key;
  };
  const std::string one = key("the server refused a command: f_r_n = nan, plausible is -1000 to 1000");
  EXPECT_EQ(one, key("the server refused a command: tau_l_nm = -inf, plausible is -100 to 100"));
  EXPECT_NE(one, key("")) << "a frame that is no message";
}

TEST(BrokenFlight, SilenceIsNamedBeforeIgnoredReplies) {
  FlightResult result = Breaks("answers-whole-replies");
  EXPECT_EQ(BrokenBy(result)->kind, "ignored");
  EXPECT_EQ(BrokenBy(Breaks("commands-once-a-reply"))->kind, "stale");
  result.score.criteria.push_back(Breaks("talks-again").score.criteria[0]);
  EXPECT_EQ(BrokenBy(result)->kind, "silence");
}

TEST(BrokenFlight, WhatAFirmwareDoesWithoutABrokenFrameIsItsDesign) {
  for (const CriterionSpec& criterion : FuzzCriteria(Paper())) {
    const bool depends =
        criterion.name == "answers-whole-replies" || criterion.name == "commands-once-a-reply";
    EXPECT_EQ(DependsOnDesign(criterion), depends) << criterion.name;
    EXPECT_EQ(WhyByDesign(criterion, Breaks(criterion.name.c_str())).has_value(), depends) << criterion.name;
    EXPECT_FALSE(WhyByDesign(criterion, Breaks("another"))) << criterion.name;
  }
}

TEST(BrokenFlight, ASignalOfOthersCountsOnlyAfterHostileBytes) {
  const link::Protocol& paper = Paper();
  FlightResult result;
  result.score.verdict = Verdict::kError;
  result.events.push_back({0.001, std::string(kEndedBySignalEvent), std::nullopt, "killed by signal 9"});
  EXPECT_FALSE(BrokenBy(result));
  EXPECT_FALSE(BrokenOutsideCalls(result, paper));
  result.events[0].time_s = 0.1;
  EXPECT_EQ(BrokenOutsideCalls(result, paper)->kind, "crash");
}

// Each fault acts, and no frame that comes is broken.
TEST(HostileSequence, AWellFormedFlightHasFaultsThatAreValid) {
  Scenario base;
  base.link.protocol = FindProtocol("paper");
  const Scenario scenario = WellFormedFlight(base);
  ASSERT_GE(scenario.faults.size(), 12U);
  for (std::size_t i = 0; i < scenario.faults.size(); ++i) {
    const faults::FaultSpec& fault = scenario.faults[i];
    EXPECT_NE(faults::FindFaultType(fault.type), nullptr) << fault.type;
    EXPECT_LT(fault.end_ns, scenario.duration_ns);
    if (i > 0) {
      EXPECT_GT(fault.start_ns, scenario.faults[i - 1].end_ns);
    }
    if (fault.type != "frame.script") continue;
    const auto words = faults::ReadFrameWords(std::get<std::string>(fault.parameters.at("frames")));
    ASSERT_EQ(words.problem, "");
    for (const LineBytes& frame : words.frames) {
      link::FrameDecoder decoder;
      std::span<const std::uint8_t> rest(frame);
      const auto event = decoder.Next(rest);
      EXPECT_TRUE(frame.empty() || (event && event->status == link::FrameStatus::kOk && rest.empty()));
    }
  }
}

TEST(BrokenFlight, ALostVehicleIsNoFinding) {
  EXPECT_FALSE(BrokenBy(Ended(EndReason::kGroundStrike, Outcome::kFailed, "it struck the ground")));
  FlightResult passed = Ended(EndReason::kCompleted, Outcome::kUnaffected, "");
  EXPECT_FALSE(BrokenBy(passed));
  passed = Breaks("talks-again");
  EXPECT_EQ(BrokenBy(passed)->kind, "silence");
  passed.score.restarts = 1;
  EXPECT_EQ(BrokenBy(passed)->kind, "restart");
}

}  // namespace
}  // namespace tiltproof::harness
