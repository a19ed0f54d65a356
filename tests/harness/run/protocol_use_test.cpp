// A client's use of its protocol, from logs put together by hand and counted by hand.
#include "harness/run/protocol_use.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <initializer_list>
#include <limits>
#include <utility>
#include <vector>

#include "firmware/messages.h"
#include "harness/scenario/shipped_protocols.h"
#include "tests/harness/run/by_hand.h"

namespace tiltproof::harness {
namespace {

using link::Direction;

// The use of the protocol by a sound client.
ProtocolUse Sound() {
  return {
      .refused_commands = 0, .replies_ignored = CountedMistake(), .commands_without_reply = CountedMistake()};
}

// A line without byte time: what is sent at an instant is there at that instant.
class Exchange {
 public:
  Exchange& Request(double time_ms) { return Sends(time_ms, link::EncodeReadSensors(dialect_)); }
  Exchange& Actuators(double time_ms) { return Sends(time_ms, link::EncodeActuators(dialect_, {})); }
  Exchange& Start(double time_ms) { return Sends(time_ms, link::EncodeStart(dialect_, {})); }
  Exchange& Sends(double time_ms, const link::MessageBytes& message) {
    return Puts(time_ms, FrameOf(message), Direction::kToPlant, false);
  }
  Exchange& Reply(double time_ms) {
    return Puts(time_ms, FrameOf(link::EncodeSensors({})), Direction::kToClient, true);
  }
  // The server's own: as it is sent, and as it arrives.
  Exchange& OwnReply(double time_ms) {
    return Puts(time_ms, FrameOf(link::EncodeSensors({})), Direction::kToClient, false).Reply(time_ms);
  }
  Exchange& Puts(double time_ms, std::span<const std::uint8_t> bytes, Direction direction, bool delivered) {
    link::LogChunk chunk;
    chunk.begin_ns = static_cast<TimeNs>(time_ms * 1e6);
    chunk.bytes.assign(bytes.begin(), bytes.end());
    log_.link.Append(chunk, {0, direction}, delivered);
    return *this;
  }
  ProtocolUse Use(std::int64_t baud = 0) {
    AddProtocolUse(log_, 0, *FindProtocol("paper"), {.baud = baud});
    return *log_.clients[0].protocol;
  }
  std::vector<LineMistake> Mistakes(double end_ms, EndReason ended = EndReason::kCompleted,
                                    std::int64_t baud = 0) {
    log_.end_ns = static_cast<TimeNs>(end_ms * 1e6);
    log_.end_reason = ended;
    log_.clients[0].starts_accepted_count = 1;
    Use(baud);
    return log_.clients[0].line_mistakes.value();
  }
  // Events that Use() has added.
  const std::vector<RunEvent>& events() const { return log_.events; }

 private:
  static RunLog LogOfOneClient() {
    RunLog log;
    log.clients.resize(1);
    return log;
  }

  link::Dialect dialect_ = link::Dialect::kPaper;
  RunLog log_ = LogOfOneClient();
};

TEST(UseOfProtocol, NothingSaidIsNothingCounted) { EXPECT_EQ(Exchange().Use(921'600), Sound()); }

TEST(UseOfProtocol, OneOfEachPerPeriod) {
  Exchange exchange;
  exchange.Start(-1);
  for (const double at : {0.0, 12.0, 24.0, 36.0}) exchange.Request(at).Reply(at + 1).Actuators(at + 1);
  ProtocolUse expected = Sound();
  expected.requests_per_period_max = expected.actuators_per_request_max = 1;
  EXPECT_EQ(exchange.Use(), expected);
}

TEST(UseOfProtocol, RequestsAreCountedInNineTenthsOfAPeriod) {
  EXPECT_EQ(Exchange().Request(0).Request(10.8).Use().requests_per_period_max, 1);
  EXPECT_EQ(Exchange().Request(0).Request(10.7).Use().requests_per_period_max, 2);
  EXPECT_EQ(
      Exchange().Request(0).Request(12).Request(13).Request(14).Request(24).Use().requests_per_period_max, 3);
}

TEST(UseOfProtocol, ActuatorsAreCountedFromRequestToRequest) {
  EXPECT_EQ(Exchange()
                .Request(0)
                .Reply(1)
                .Actuators(1)
                .Actuators(2)
                .Actuators(3)
                .Request(12)
                .Use()
                .actuators_per_request_max,
            3);
  EXPECT_EQ(Exchange().Request(0).Reply(1).Actuators(1).Actuators(2).Use().actuators_per_request_max, 0)
      << "an exchange that has not ended";
}

TEST(UseOfProtocol, ActuatorsBeforeTheReplyAreTheClientsOwn) {
  const ProtocolUse use =
      Exchange().Request(0).Actuators(2).Reply(3).Actuators(3).Request(12).Actuators(14).Request(24).Use();
  EXPECT_EQ(use.actuators_before_reply, 2);
  EXPECT_EQ(use.replies_unanswered, 0);
}

TEST(UseOfProtocol, AReplyIsAnsweredAfterItHasCome) {
  EXPECT_EQ(Exchange().Request(0).Reply(1).Request(12).Use().replies_unanswered, 1);
  EXPECT_EQ(Exchange().Request(0).Actuators(1).Reply(2).Request(12).Use().replies_unanswered, 1);
  EXPECT_EQ(Exchange().Request(0).Reply(1).Reply(2).Actuators(2).Request(12).Use().replies_unanswered, 0)
      << "one command for both";
  EXPECT_EQ(Exchange().Reply(-2).Request(0).Reply(1).Use().replies_unanswered, 0)
      << "nobody asked; not ended";
}

TEST(UseOfProtocol, AReplyHasComeWithItsLastByte) {
  // A thousand bytes a second: the frame of 68 bytes and more begins at 1 ms, and ends after the request at 50 ms.
  const ProtocolUse use =
      Exchange().Request(0).Reply(1).Actuators(40).Request(50).Actuators(90).Request(100).Use(10'000);
  EXPECT_EQ(use.actuators_before_reply, 1);
  EXPECT_EQ(use.replies_unanswered, 0);
}

TEST(UseOfProtocol, OnlyWhatIsNoMessageIsMalformed) {
  const std::vector<std::uint8_t> noise = {0x7E, 1, 2, 3, 0x7E};
  link::MessageBytes unknown = link::EncodeActuators(link::Dialect::kPaper, {});
  unknown.bytes[3] ^= 0x01;
  link::MessageBytes short_one = link::EncodeActuators(link::Dialect::kPaper, {});
  short_one.size -= 4;
  Exchange exchange;
  exchange.Start(0)
      .Request(1)
      .Puts(2, noise, Direction::kToPlant, false)
      .Sends(3, unknown)
      .Sends(4, short_one);
  exchange.Puts(5, noise, Direction::kToPlant, true);   // what the faults made of it
  exchange.Puts(6, noise, Direction::kToClient, true);  // not the client's
  EXPECT_EQ(exchange.Use().malformed_sent, 3);
}

TEST(UseOfProtocol, CommandsThatNoServerTakesAreCounted) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr auto kPaper = link::Dialect::kPaper;
  link::MessageBytes broken = link::EncodeActuators(kPaper, {.f_r_n = kNan});
  broken.size -= 4;
  Exchange exchange;
  exchange.Request(0).Actuators(1);
  exchange.Sends(13, link::EncodeActuators(kPaper, {.f_r_n = 10, .f_l_n = 10, .tau_r_nm = kNan}));
  exchange.Sends(25, link::EncodeActuators(kPaper, {.f_r_n = 1e30F}));
  exchange.Sends(37, broken);  // not a command
  exchange.Puts(49, FrameOf(link::EncodeActuators(kPaper, {.f_r_n = kNan})), Direction::kToPlant,
                true);  // what the faults made of it
  const ProtocolUse use = exchange.Use();
  EXPECT_EQ(use.refused_commands, 2);
  EXPECT_EQ(use.malformed_sent, 3);
  ASSERT_EQ(exchange.events().size(), 2U) << "the first of each tells enough";
  EXPECT_EQ(exchange.events()[1].kind, "malformed_sent");
  EXPECT_EQ(exchange.events()[1].time_ns, 37'000'000);
  EXPECT_THAT(exchange.events()[1].text, ::testing::HasSubstr("that is not a message: bad_length"));
  EXPECT_EQ(exchange.events()[0].kind, "command_refused");
  EXPECT_EQ(exchange.events()[0].time_ns, 13'000'000);
  EXPECT_THAT(exchange.events()[0].text, ::testing::HasSubstr("tau_r_nm = nan"));
}

TEST(UseOfProtocol, DamagedRepliesAreNone) {
  const std::vector<std::uint8_t> noise = {0x7E, 1, 2, 3, 0x7E};
  const ProtocolUse use =
      Exchange().Request(0).Puts(1, noise, Direction::kToClient, true).Actuators(2).Request(12).Use();
  EXPECT_EQ(use.actuators_before_reply, 1);
  EXPECT_EQ(use.replies_unanswered, 0);
}

const std::vector<std::uint8_t> kNoise = {0x7E, 1, 2, 3, 0x7E};

// Exchanges of a sound client up to that time, its `start` included.
Exchange SoundUntil(double end_ms) {
  Exchange exchange;
  exchange.Start(-1);
  for (double at = 0; at < end_ms; at += 12) exchange.Request(at).OwnReply(at + 1).Actuators(at + 1);
  return exchange;
}

TEST(IgnoredReplies, AWholeReplyWantsACommandBeforeTheNextRequest) {
  const ProtocolUse use = SoundUntil(24).Request(24).OwnReply(25).Request(36).OwnReply(37).Request(48).Use();
  EXPECT_EQ(use.replies_ignored->count, 2);
  EXPECT_EQ(use.replies_ignored->first_ns, 25'000'000);
  EXPECT_EQ(use.replies_ignored->text, "no command followed a whole reply that came at 0.0250 s");
  EXPECT_EQ(SoundUntil(24).Request(24).OwnReply(25).Actuators(35).Request(36).Use().replies_ignored->count,
            0);
  EXPECT_EQ(SoundUntil(24).Request(24).OwnReply(25).Use().replies_ignored->count, 0) << "nothing is over";
}

TEST(IgnoredReplies, SomeRepliesMayBeIgnored) {
  const auto ignored = [](Exchange exchange) { return exchange.Use().replies_ignored->count; };
  EXPECT_EQ(ignored(SoundUntil(24).Request(24).Reply(25).Request(36)), 0) << "of another server";
  EXPECT_EQ(ignored(SoundUntil(24).Request(24).OwnReply(27.5).Request(36)), 0) << "it is late";
  EXPECT_EQ(
      ignored(SoundUntil(24).Request(24).OwnReply(25).Request(29).OwnReply(30).Actuators(30).Request(41)), 0)
      << "asked again at once";
  EXPECT_EQ(ignored(SoundUntil(24).Start(24).Request(25).OwnReply(26).Request(37)), 0)
      << "it has just started";
  EXPECT_EQ(ignored(Exchange().Start(-1).Request(0).OwnReply(1).Request(12)), 0)
      << "it has not commanded yet";
  EXPECT_EQ(ignored(SoundUntil(24).Request(24).Reply(25).OwnReply(25).Actuators(25).Request(36)), 0)
      << "one command for two";
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(ignored(SoundUntil(24)
                        .Request(24)
                        .OwnReply(25)
                        .Sends(25, link::EncodeActuators(link::Dialect::kPaper, {.f_r_n = kNan}))
                        .Request(36)),
            0)
      << "a command that is refused is one";
}

TEST(IgnoredReplies, TheFrameBeforeIsNamed) {
  const ProtocolUse use = SoundUntil(24)
                              .Request(24)
                              .Puts(25, kNoise, Direction::kToClient, true)
                              .Request(36)
                              .OwnReply(37)
                              .Request(48)
                              .Use();
  EXPECT_EQ(use.replies_ignored->text,
            "no command followed a whole reply that came at 0.0370 s; the last frame before it that is not "
            "a message: bad_checksum at 0.0250 s");
}

TEST(CommandsWithoutReply, EachCommandWantsAReplyOfItsOwn) {
  const ProtocolUse use =
      SoundUntil(24).Request(24).Puts(25, kNoise, Direction::kToClient, true).Actuators(25).Request(36).Use();
  EXPECT_EQ(use.commands_without_reply->count, 1);
  EXPECT_EQ(use.commands_without_reply->first_ns, 25'000'000);
  EXPECT_THAT(use.commands_without_reply->text,
              ::testing::HasSubstr("at 0.0250 s; the last frame before it"));
  EXPECT_EQ(
      SoundUntil(24).Request(24).OwnReply(25).Actuators(25).Actuators(26).Use().commands_without_reply->count,
      1);
}

TEST(CommandsWithoutReply, AnyReplyThatSomeReceiverTakesCounts) {
  const auto unfounded = [](Exchange exchange) { return exchange.Use().commands_without_reply->count; };
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  const auto absurd = FrameOf(link::EncodeSensors({.x_m = kNan}));
  const auto own = FrameOf(link::EncodeSensors({}));
  EXPECT_EQ(unfounded(SoundUntil(24).Request(24).Puts(25, absurd, Direction::kToClient, true).Actuators(25)),
            0)
      << "its values are not looked at";
  EXPECT_EQ(unfounded(SoundUntil(24).Request(24).Reply(25).Reply(25).Actuators(25).Actuators(25)), 0);
  EXPECT_EQ(
      unfounded(SoundUntil(24).Request(24).OwnReply(25).Request(36).Actuators(36).OwnReply(37).Actuators(37)),
      0)
      << "a little late";
  // Behind half a frame, and without its opening flag: after a pause some receivers want none.
  EXPECT_EQ(unfounded(SoundUntil(24)
                          .Request(24)
                          .Puts(25, std::vector<std::uint8_t>{0x7E, 1, 2}, Direction::kToClient, true)
                          .Request(36)
                          .Puts(37, std::span(own).subspan(1), Direction::kToClient, true)
                          .Actuators(37)),
            0);
  // 7D 7D 5D: an escaped 5D and a 5D, or a 7D.
  link::MessageBytes escaped = link::EncodeSensors({});
  escaped.bytes[0] = 0x7D;
  std::vector<std::uint8_t> twice = FrameOf(escaped);
  twice.insert(std::ranges::find(twice, 0x7D), 0x7D);
  EXPECT_EQ(unfounded(SoundUntil(24).Request(24).Puts(25, twice, Direction::kToClient, true).Actuators(25)),
            0);
  EXPECT_EQ(unfounded(Exchange().Start(-1).Actuators(0).Request(0).OwnReply(1).Actuators(1)), 0)
      << "the first command may hold the vehicle";
}

// Mistakes of one kind, as pairs of the begin in ms and the count.
std::vector<std::pair<double, std::int64_t>> MistakesOf(Exchange& exchange, LineMistakeKind kind,
                                                        double end_ms,
                                                        EndReason ended = EndReason::kCompleted,
                                                        std::int64_t baud = 0) {
  std::vector<std::pair<double, std::int64_t>> found;
  for (const LineMistake& mistake : exchange.Mistakes(end_ms, ended, baud))
    if (mistake.kind == kind) found.emplace_back(static_cast<double>(mistake.time_ns) / 1e6, mistake.count);
  return found;
}

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

TEST(LineMistakes, ASoundClientMakesNone) {
  Exchange exchange;
  exchange.Start(-1);
  for (double at = 12; at < 1000; at += 12) exchange.Request(at).Reply(at + 1).Actuators(at + 2);
  EXPECT_THAT(exchange.Mistakes(1000), IsEmpty());
}

TEST(LineMistakes, NothingIsJudgedBeforeTheFirstStart) {
  Exchange exchange;
  exchange.Request(0).Reply(1).Request(100).Puts(200, std::vector<std::uint8_t>{0x7E, 1, 2, 3, 0x7E},
                                                 Direction::kToPlant, false);
  EXPECT_THAT(exchange.Mistakes(1000), IsEmpty());
}

TEST(LineMistakes, GapsOfMoreThanOneAndAHalfPeriodsAreMissingRequests) {
  for (const auto& [next_ms, count] : std::vector<std::pair<double, std::int64_t>>{
           {30, 0}, {30.1, 1}, {36, 1}, {41.9, 1}, {42.1, 2}, {132, 9}}) {
    Exchange exchange;
    exchange.Start(0).Request(12).Request(next_ms);
    const auto missing = MistakesOf(exchange, LineMistakeKind::kMissing, next_ms);
    if (count == 0)
      EXPECT_THAT(missing, IsEmpty()) << next_ms;
    else
      EXPECT_THAT(missing, ElementsAre(Pair(24, count))) << next_ms;
  }
}

TEST(LineMistakes, SilenceToTheEndIsCountedButNotOfAFirmwareThatWentAway) {
  const auto missing = [](double end_ms, EndReason ended) {
    Exchange exchange;
    exchange.Start(0).Request(12);
    return MistakesOf(exchange, LineMistakeKind::kMissing, end_ms, ended);
  };
  EXPECT_THAT(missing(30, EndReason::kCompleted), IsEmpty());
  EXPECT_THAT(missing(612, EndReason::kCompleted), ElementsAre(Pair(24, 49)));
  EXPECT_THAT(missing(612, EndReason::kGroundStrike), ElementsAre(Pair(24, 49)));
  EXPECT_THAT(missing(612, EndReason::kFirmwareHung), IsEmpty());
}

TEST(LineMistakes, TheFirstRequestMayTakeTwoSeconds) {
  const auto missing = [](double first_ms) {
    Exchange exchange;
    exchange.Start(0).Request(first_ms);
    return MistakesOf(exchange, LineMistakeKind::kMissing, first_ms);
  };
  EXPECT_THAT(missing(2000), IsEmpty());
  EXPECT_THAT(missing(2400), ElementsAre(Pair(12, 199)));
  Exchange never;
  never.Start(0);
  EXPECT_THAT(MistakesOf(never, LineMistakeKind::kMissing, 1200), ElementsAre(Pair(12, 99)));
}

TEST(LineMistakes, TwoRequestsWithinHalfAPeriodAreDoubled) {
  Exchange exchange;
  exchange.Start(0).Request(12).Request(17.9).Request(24).Request(30);
  EXPECT_THAT(MistakesOf(exchange, LineMistakeKind::kDoubled, 30), ElementsAre(Pair(17.9, 1)));
}

TEST(LineMistakes, AReplyIsAnsweredWithinAPeriod) {
  Exchange exchange;
  exchange.Start(0).Request(12).Reply(13).Actuators(25).Request(24).Reply(26).Request(36).Reply(37).Actuators(
      49.5);
  EXPECT_THAT(MistakesOf(exchange, LineMistakeKind::kUnanswered, 60), ElementsAre(Pair(26, 1), Pair(37, 1)));
  // The flight ends before the period does.
  Exchange ends;
  ends.Start(0).Request(12).Reply(13);
  EXPECT_THAT(MistakesOf(ends, LineMistakeKind::kUnanswered, 25), IsEmpty());
  EXPECT_THAT(MistakesOf(ends, LineMistakeKind::kUnanswered, 26), ElementsAre(Pair(13, 1)));
}

TEST(LineMistakes, ACommandAnswersTheNewestReply) {
  // The next command comes within the period of a lost reply, to the bit where no byte takes time, and does not answer it.
  for (const double later_ms : {-0.01, 0.0, 0.01}) {
    Exchange exchange;
    exchange.Start(0);
    for (double at = 12; at < 120; at += 12) {
      exchange.Request(at);
      exchange.Reply(at + 1);
      if (at != 48) exchange.Actuators(at + 1 + (at == 60 ? later_ms + 0.01 : 0.01));
    }
    EXPECT_THAT(MistakesOf(exchange, LineMistakeKind::kUnanswered, 120), ElementsAre(Pair(49, 1)))
        << later_ms;
  }
}

TEST(LineMistakes, OneCommandMayAnswerRepliesOfOnePeriod) {
  Exchange exchange;
  exchange.Start(0);
  for (double at = 12; at < 120; at += 12)
    exchange.Request(at).Reply(at + 1).Request(at + 7).Reply(at + 8).Actuators(at + 9);
  EXPECT_THAT(MistakesOf(exchange, LineMistakeKind::kUnanswered, 120), IsEmpty());
}

TEST(LineMistakes, ACommandMayComeBeforeTheLastByteOfItsReply) {
  // The 70 bytes take 0.76 ms. Some commands come early, and those after them do not answer the same replies again.
  Exchange exchange;
  exchange.Start(0);
  for (double at = 12; at < 240; at += 12) {
    exchange.Request(at).Reply(at + 1);
    if (at != 120) exchange.Actuators(at + (static_cast<int>(at) % 24 == 0 ? 1.75 : 2.5));
  }
  EXPECT_THAT(MistakesOf(exchange, LineMistakeKind::kUnanswered, 240, EndReason::kCompleted, 921'600),
              ElementsAre(Pair(::testing::AllOf(::testing::Gt(121.7), ::testing::Lt(121.8)), 1)));
}

TEST(LineMistakes, WhatIsNoMessageIsMalformedAndNoAnswer) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  Exchange exchange;
  exchange.Start(0).Request(12).Reply(13);
  exchange.Sends(14, link::EncodeActuators(link::Dialect::kPaper, {.f_r_n = kNan}));
  EXPECT_THAT(MistakesOf(exchange, LineMistakeKind::kMalformed, 30), ElementsAre(Pair(14, 1)));
  EXPECT_THAT(exchange.Mistakes(30)[0].text, ::testing::StartsWith("not_finite, bytes 7e 00 00 40 40"));
  EXPECT_THAT(MistakesOf(exchange, LineMistakeKind::kUnanswered, 30), ElementsAre(Pair(13, 1)));
}

}  // namespace
}  // namespace tiltproof::harness
