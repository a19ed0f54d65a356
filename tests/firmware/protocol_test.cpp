// The firmware's half of the protocol, played against a scripted server: which bytes leave, and when.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>

#include "firmware/builds.h"
#include "firmware/flight_application.h"
#include "tests/firmware/fake_board.h"

namespace tiltproof::firmware {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr TimeNs kMs = kNsPerMs;
constexpr int kMain = TILTPROOF_UART_MAIN;
constexpr int kReferenceLine = TILTPROOF_UART_REFERENCE;

const ClientLibrary& Library() {
  static const ClientLibrary library(TILTPROOF_FIRMWARE_LIBRARY);
  return library;
}

// Worked out by hand: 1.0f = 0000803F, sums BF and 40; 2.0f = 00000040, sums 40 and 40.
const Bytes kStart = {0x7E, 0x00, 0x00, 0x80, 0x3F, 0xBF, 0x40, 0x7E};
const Bytes kRequest = {0x7E, 0x00, 0x00, 0x00, 0x40, 0x40, 0x40, 0x7E};

Sent At(TimeNs time_ns, const Bytes& bytes) { return {time_ns, kMain, bytes}; }

// A vehicle at rest at that height, everything else zero.
Bytes Reply(float z_m, float yaw_rad = 0) {
  std::array<float, 16> values{};
  values[2] = z_m;
  values[5] = yaw_rad;
  return Frame(values);
}

Bytes WithFlippedBit(Bytes frame) {
  frame[20] ^= 0x10;
  return frame;
}

// Runs the firmware from `now` whenever it asks for it, up to before `end`, and returns when it asks next.
TimeNs RunUntil(FakeBoard& board, TimeNs now, TimeNs end) {
  TimeNs wake = board.Grant(now);
  while (wake < end) wake = board.Grant(wake);
  return wake;
}

// The actuators' frame that `build` must send for these sensors and this reference as its first.
Bytes FirstCommand(const char* build_name, const Sensors& sensors, const Reference& reference,
                   float service = 3) {
  const Build& build = *FindBuild(build_name);
  const Actuators u = ControlLaw(*build.gain, build.feed_forward).Step(sensors, reference);
  return Frame({service, u.f_r_n, u.f_l_n, u.tau_r_nm, u.tau_l_nm});
}

// Both builds, for what they have in common.
class EveryBuildTest : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Builds, EveryBuildTest, ::testing::Values("paper", "paper_published", "tolerant"));

TEST_P(EveryBuildTest, OnAnIdealLineEverythingHappensAtOnce) {
  FakeBoard board(Library(), GetParam(), "paper");
  board.Start(0);
  EXPECT_THAT(board.TakeSent(), ElementsAre(At(0, kStart), At(0, kRequest)));
  board.Receive(0, Reply(1));
  EXPECT_THAT(board.TakeSent(), ElementsAre(At(0, FirstCommand(GetParam(), {.z_m = 1}, {.z_m = 1}))));
  EXPECT_EQ(RunUntil(board, 0, 12 * kMs), 12 * kMs);
  EXPECT_THAT(board.TakeSent(), IsEmpty());
  board.Grant(12 * kMs);
  EXPECT_THAT(board.TakeSent(), ElementsAre(At(12 * kMs, kRequest)));
}

TEST_P(EveryBuildTest, TheFirstRequestLeavesWhenStartHasLeft) {
  constexpr TimeNs kStartNs = 8 * 10 * kNsPerS / 921'600;
  FakeBoard board(Library(), GetParam(), "paper", 921'600);
  EXPECT_EQ(board.Start(5 * kMs), 5 * kMs + kStartNs);
  EXPECT_THAT(board.TakeSent(), ElementsAre(At(5 * kMs, kStart)));
  const TimeNs first = 5 * kMs + kStartNs;
  board.Grant(first);
  EXPECT_THAT(board.TakeSent(), ElementsAre(At(first, kRequest)));
  for (int k = 1; k < 4; ++k) {
    board.Receive(first + (k - 1) * 12 * kMs + kMs, Reply(1));
    EXPECT_EQ(RunUntil(board, first + (k - 1) * 12 * kMs + kMs, first + k * 12 * kMs), first + k * 12 * kMs);
    board.TakeSent();
    board.Grant(first + k * 12 * kMs);
    EXPECT_THAT(board.TakeSent(), ElementsAre(At(first + k * 12 * kMs, kRequest)));
  }
}

TEST_P(EveryBuildTest, DoesNothingBeforeItsTime) {
  FakeBoard board(Library(), GetParam(), "paper");
  board.Start(0);
  board.Receive(kMs, Reply(1));
  board.TakeSent();
  EXPECT_EQ(RunUntil(board, kMs, 12 * kMs), 12 * kMs);
  EXPECT_EQ(board.Grant(12 * kMs - 1), 12 * kMs);
  EXPECT_THAT(board.TakeSent(), IsEmpty());
}

TEST_P(EveryBuildTest, APeriodThatBeginsLateKeepsTheGrid) {
  FakeBoard board(Library(), GetParam(), "paper");
  board.Start(0);
  board.Receive(kMs, Reply(1));
  board.TakeSent();
  board.Grant(40 * kMs);
  EXPECT_THAT(board.TakeSent(), ElementsAre(At(40 * kMs, kRequest)));
  board.Receive(41 * kMs, Reply(1));
  EXPECT_EQ(RunUntil(board, 41 * kMs, 48 * kMs), 48 * kMs);
}

TEST_P(EveryBuildTest, AnswersARequestOnce) {
  FakeBoard board(Library(), GetParam(), "paper");
  board.Start(0);
  board.Receive(kMs, Reply(1));
  board.TakeSent();
  board.Receive(2 * kMs, Reply(1));
  board.Receive(3 * kMs, Reply(5));
  EXPECT_THAT(board.TakeSent(), IsEmpty());
  board.Grant(12 * kMs);
  EXPECT_THAT(board.TakeSent(), ElementsAre(At(12 * kMs, kRequest)));
}

TEST_P(EveryBuildTest, TwoRepliesAtOnceMakeOneStepOnTheFirst) {
  FakeBoard board(Library(), GetParam(), "paper");
  board.Start(0);
  board.TakeSent();
  Bytes both = Reply(1);
  const Bytes second = Reply(5);
  both.insert(both.end(), second.begin(), second.end());
  board.Receive(kMs, both);
  EXPECT_THAT(board.TakeSent(), ElementsAre(At(kMs, FirstCommand(GetParam(), {.z_m = 1}, {.z_m = 1}))));
}

TEST_P(EveryBuildTest, AReplyMayComeByteByByte) {
  FakeBoard board(Library(), GetParam(), "paper");
  board.Start(0);
  board.TakeSent();
  const Bytes reply = Reply(1);
  for (std::size_t i = 0; i + 1 < reply.size(); ++i) board.Receive(kMs, {reply[i]});
  EXPECT_THAT(board.TakeSent(), IsEmpty());
  board.Receive(2 * kMs, {reply.back()});
  EXPECT_THAT(board.TakeSent(), ElementsAre(At(2 * kMs, FirstCommand(GetParam(), {.z_m = 1}, {.z_m = 1}))));
}

TEST_P(EveryBuildTest, AReplyInTheInstantOfTheTickIsInTime) {
  FakeBoard board(Library(), GetParam(), "paper");
  board.Start(0);
  board.TakeSent();
  EXPECT_EQ(RunUntil(board, 0, 12 * kMs), 12 * kMs);
  board.Receive(12 * kMs, Reply(1));
  const std::vector<Sent> sent = board.TakeSent();
  ASSERT_EQ(sent.size(), 2U);
  EXPECT_EQ(FrameValues(sent[0].bytes).at(0), 3);  // a command
  EXPECT_EQ(sent[1], At(12 * kMs, kRequest));
}

TEST(PaperTest, ALateReplyAnswersThePresentRequest) {
  FakeBoard board(Library(), "paper", "paper");
  board.Start(0);
  board.Receive(kMs, Reply(1));
  board.Grant(12 * kMs);  // this request's reply comes after the next tick
  board.Grant(18 * kMs);
  board.Grant(24 * kMs);
  board.TakeSent();
  board.Receive(25 * kMs, Reply(2));
  EXPECT_EQ(board.TakeSent().size(), 1U);
  board.Receive(26 * kMs, Reply(3));  // the present request's own
  EXPECT_THAT(board.TakeSent(), IsEmpty());
}

TEST(PaperTest, DropsAHalfReceivedFrameBeforeAsking) {
  FakeBoard board(Library(), "paper", "paper");
  board.Start(0);
  board.Receive(kMs, Reply(1));
  board.Grant(12 * kMs);
  board.Grant(18 * kMs);
  const Bytes reply = Reply(2);
  board.Receive(23 * kMs, Bytes(reply.begin(), reply.begin() + 30));
  board.Grant(24 * kMs);
  board.TakeSent();
  board.Receive(25 * kMs, Bytes(reply.begin() + 30, reply.end()));
  EXPECT_THAT(board.TakeSent(), IsEmpty());
  board.Receive(26 * kMs, Reply(3));
  EXPECT_EQ(board.TakeSent().size(), 1U);
}

TEST_P(EveryBuildTest, IgnoresFramesThatAreNoReply) {
  FakeBoard board(Library(), GetParam(), "paper");
  board.Start(0);
  board.TakeSent();
  board.Receive(kMs, WithFlippedBit(Reply(1)));
  board.Receive(kMs, Frame(std::array<float, 15>{}));
  board.Receive(kMs, Frame(std::array<float, 17>{}));
  board.Receive(kMs, testing::SlowEncode(Bytes(63)));
  board.Receive(kMs, Bytes{0x7E, 0x55, 0x7E, 0x00, 0x00, 0x7E, 0x7D, 0x7E});
  EXPECT_THAT(board.TakeSent(), IsEmpty());
  board.Receive(2 * kMs, Reply(1));
  EXPECT_EQ(board.TakeSent().size(), 1U);
}

TEST_P(EveryBuildTest, FollowsTheLastReference) {
  const Reference last{1, 2, 3, 0.25F, 0.5F, -0.5F, 0.125F};
  FakeBoard board(Library(), GetParam(), "paper");
  board.Start(0);
  board.Receive(0, Frame({9, 9, 9, 9, 9, 9, 9}), kReferenceLine);
  board.Receive(0, Frame({1, 2, 3, 0.25F, 0.5F, -0.5F, 0.125F}), kReferenceLine);
  board.Receive(0, WithFlippedBit(Frame({7, 7, 7, 7, 7, 7, 7})), kReferenceLine);
  board.Receive(0, Frame({8, 8, 8, 8, 8, 8}), kReferenceLine);
  board.Receive(0, Frame({8, 8, 8, 8, 8, 8, 8, 8}), kReferenceLine);
  board.TakeSent();
  board.Receive(kMs, Reply(2));
  EXPECT_THAT(board.TakeSent(), ElementsAre(At(kMs, FirstCommand(GetParam(), {.z_m = 2}, last))));
}

TEST_P(EveryBuildTest, HoldsTheFirstSensedPlaceUntilAReferenceComes) {
  const Build& build = *FindBuild(GetParam());
  ControlLaw law(*build.gain, build.feed_forward);
  law.Step({.z_m = 2, .yaw_rad = 0.5F}, {.z_m = 2, .yaw_rad = 0.5F});
  const Actuators second = law.Step({.z_m = 2.01F, .yaw_rad = 0.49F}, {.z_m = 2, .yaw_rad = 0.5F});
  FakeBoard board(Library(), GetParam(), "paper");
  board.Start(0);
  board.Receive(kMs, Reply(2, 0.5F));
  board.Grant(12 * kMs);
  board.TakeSent();
  board.Receive(13 * kMs, Reply(2.01F, 0.49F));
  EXPECT_THAT(
      board.TakeSent(),
      ElementsAre(At(13 * kMs, Frame({3, second.f_r_n, second.f_l_n, second.tau_r_nm, second.tau_l_nm}))));
}

TEST_P(EveryBuildTest, SpeaksTheDialectOfTheAuthorsServer) {
  const Actuators hover = FindBuild(GetParam())->feed_forward;
  FakeBoard board(Library(), GetParam(), "provant");
  board.Start(0);
  EXPECT_THAT(board.TakeSent(),
              ElementsAre(At(0, Frame({3, hover.f_r_n, hover.f_l_n, hover.tau_r_nm, hover.tau_l_nm})),
                          At(0, Frame({1}))));
  board.Receive(kMs, Reply(1));
  EXPECT_THAT(board.TakeSent(), ElementsAre(At(kMs, FirstCommand(GetParam(), {.z_m = 1}, {.z_m = 1}, 0))));
}

TEST_P(EveryBuildTest, AResetForgetsAllButTheClock) {
  FakeBoard board(Library(), GetParam(), "paper");
  board.Start(0);
  board.Receive(0, Frame({9, 9, 9, 9, 9, 9, 9}), kReferenceLine);
  board.Receive(kMs, Reply(5));
  board.TakeSent();
  board.Reset(7 * kMs);
  EXPECT_THAT(board.TakeSent(), ElementsAre(At(7 * kMs, kStart), At(7 * kMs, kRequest)));
  board.Receive(8 * kMs, Reply(1));
  EXPECT_THAT(board.TakeSent(), ElementsAre(At(8 * kMs, FirstCommand(GetParam(), {.z_m = 1}, {.z_m = 1}))));
  EXPECT_EQ(RunUntil(board, 8 * kMs, 19 * kMs), 19 * kMs);
}

TEST_P(EveryBuildTest, BoardsDoNotShareState) {
  FakeBoard first(Library(), GetParam(), "paper");
  FakeBoard second(Library(), GetParam(), "paper");
  first.Start(0);
  second.Start(0);
  first.Receive(kMs, Reply(5));
  second.TakeSent();
  second.Receive(kMs, Reply(1));
  EXPECT_THAT(second.TakeSent(), ElementsAre(At(kMs, FirstCommand(GetParam(), {.z_m = 1}, {.z_m = 1}))));
}

// Differences between the builds.

TEST(PaperTest, AMissingReplyMeansNoActuators) {
  FakeBoard board(Library(), "paper", "paper");
  board.Start(0);
  EXPECT_EQ(board.Receive(kMs, Reply(1)), 12 * kMs);
  board.TakeSent();
  for (int k = 1; k < 20; ++k) EXPECT_EQ(board.Grant(k * 12 * kMs), (k + 1) * 12 * kMs);
  const std::vector<Sent> sent = board.TakeSent();
  ASSERT_EQ(sent.size(), 19U);
  for (std::size_t k = 0; k < sent.size(); ++k)
    EXPECT_EQ(sent[k], At(static_cast<TimeNs>(k + 1) * 12 * kMs, kRequest));
  EXPECT_EQ(board.Status().failsafe_count, 0U);
}

TEST(PaperTest, SendsStartOnce) {
  FakeBoard board(Library(), "paper", "paper");
  board.Start(0);
  board.TakeSent();
  board.Grant(12 * kMs);
  EXPECT_THAT(board.TakeSent(), ElementsAre(At(12 * kMs, kRequest)));
}

TEST(PaperTest, AppliesNumbersThatAreNotFinite) {
  FakeBoard board(Library(), "paper", "paper");
  board.Start(0);
  board.TakeSent();
  board.Receive(kMs, Reply(std::numeric_limits<float>::quiet_NaN()));
  const std::vector<Sent> sent = board.TakeSent();
  ASSERT_EQ(sent.size(), 1U);
  EXPECT_TRUE(std::isnan(FrameValues(sent[0].bytes).at(1)));
}

TEST(PaperTest, AppliesAReferenceThatIsNotFinite) {
  FakeBoard board(Library(), "paper", "paper");
  board.Start(0);
  board.Receive(0, Frame({0, 0, std::numeric_limits<float>::infinity(), 0, 0, 0, 0}), kReferenceLine);
  board.TakeSent();
  board.Receive(kMs, Reply(1));
  EXPECT_TRUE(std::isinf(FrameValues(board.TakeSent().at(0).bytes).at(1)));
}

// At rest in hover the model predicts rest, whatever time passes.
TEST(TolerantTest, ActsOnThePredictionAtTheTimeOut) {
  const Build& build = *FindBuild("tolerant");
  const Sensors hover = {
      .z_m = 1, .pitch_rad = -0.011689F, .alpha_r_rad = 0.011673F, .alpha_l_rad = 0.011615F};
  std::vector<float> values;
  for (const auto& field : kSensorFields) values.push_back(hover.*field.in_float);
  FakeBoard board(Library(), "tolerant", "paper");
  board.Start(0);
  board.Receive(kMs, Frame(values));
  RunUntil(board, kMs, 12 * kMs);
  EXPECT_EQ(board.Grant(12 * kMs), 14 * kMs);
  board.TakeSent();
  EXPECT_EQ(board.Grant(14 * kMs), 18 * kMs);
  const std::vector<Sent> sent = board.TakeSent();
  ASSERT_EQ(sent.size(), 1U);
  EXPECT_EQ(sent[0].time_ns, 14 * kMs);
  const std::vector<float> command = FrameValues(sent[0].bytes);
  EXPECT_NEAR(command.at(1), build.feed_forward.f_r_n, 0.05);
  EXPECT_NEAR(command.at(2), build.feed_forward.f_l_n, 0.05);
  EXPECT_NEAR(command.at(3), 0, 0.01);
  EXPECT_NEAR(command.at(4), 0, 0.01);
}

// The line is not trusted for a while after a missed reply: if one command is lost, the next comes 4 ms later.
TEST(TolerantTest, SendsThreeCommandsAPeriodAfterAFault) {
  FakeBoard board(Library(), "tolerant", "paper");
  board.Start(0);
  board.Receive(kMs, Reply(1));
  RunUntil(board, kMs, 12 * kMs);
  RunUntil(board, 12 * kMs, 24 * kMs);  // without a reply
  board.Grant(24 * kMs);
  board.Receive(25 * kMs, Reply(1));
  RunUntil(board, 25 * kMs, 36 * kMs);
  std::vector<TimeNs> times;
  for (const Sent& sent : board.TakeSent()) times.push_back(sent.time_ns / kMs);
  EXPECT_THAT(times, ElementsAre(0, 0, 1, 12, 14, 18, 22, 24, 25, 26, 30, 34));
}

TEST(TolerantTest, RejectsValuesThatNoVehicleHas) {
  FakeBoard board(Library(), "tolerant", "paper");
  board.Start(0);
  board.TakeSent();
  board.Receive(kMs, Reply(std::numeric_limits<float>::quiet_NaN()));
  board.Receive(kMs, Reply(std::numeric_limits<float>::infinity()));
  board.Receive(kMs, Reply(1e30F));
  EXPECT_THAT(board.TakeSent(), IsEmpty());
  board.Receive(kMs, Reply(1));
  EXPECT_EQ(board.TakeSent().size(), 1U);
}

TEST(TolerantTest, RejectsReferencesThatNoVehicleCanFollow) {
  FakeBoard board(Library(), "tolerant", "paper");
  board.Start(0);
  board.Receive(0, Frame({1, 2, 3, 0, 0, 0, 0}), kReferenceLine);
  board.Receive(0, Frame({0, 0, std::numeric_limits<float>::quiet_NaN(), 0, 0, 0, 0}), kReferenceLine);
  board.Receive(0, Frame({1e30F, 0, 0, 0, 0, 0, 0}), kReferenceLine);
  board.TakeSent();
  board.Receive(kMs, Reply(1));
  EXPECT_THAT(board.TakeSent(),
              ElementsAre(At(kMs, FirstCommand("tolerant", {.z_m = 1}, {1, 2, 3, 0, 0, 0, 0}))));
}

TEST(TolerantTest, RetriesStartUntilTheServerAnswers) {
  constexpr TimeNs kStartNs = 8 * 10 * kNsPerS / 921'600;
  FakeBoard board(Library(), "tolerant", "paper", 921'600);
  TimeNs wake = board.Start(0);
  EXPECT_EQ(wake, kStartNs);
  for (int attempt = 1; attempt < 4; ++attempt) {
    board.TakeSent();
    const TimeNs request = wake;
    EXPECT_EQ(board.Grant(request), request + 2 * kMs);
    EXPECT_EQ(RunUntil(board, request + 2 * kMs, request + 12 * kMs),
              request + 12 * kMs);  // without a command
    EXPECT_EQ(board.Grant(request + 12 * kMs), request + 12 * kMs + kStartNs);
    EXPECT_THAT(board.TakeSent(), ElementsAre(At(request, kRequest), At(request + 12 * kMs, kStart)));
    wake = request + 12 * kMs + kStartNs;
  }
  board.Grant(wake);
  board.Receive(wake + kMs, Reply(1));
  board.TakeSent();
  board.Grant(wake + 12 * kMs);
  EXPECT_THAT(board.TakeSent(), ElementsAre(At(wake + 12 * kMs, kRequest)));
}

TEST(TolerantTest, IsBlindAfterFivePeriodsAndRecovers) {
  FakeBoard board(Library(), "tolerant", "paper");
  board.Start(0);
  board.Receive(kMs, Reply(1));
  for (int round = 1; round <= 2; ++round) {
    const TimeNs origin = (round - 1) * 120 * kMs;
    for (int k = 1; k <= 5; ++k) {
      board.Grant(origin + k * 12 * kMs);
      board.Grant(origin + k * 12 * kMs + 6 * kMs);
    }
    EXPECT_EQ(board.Status().failsafe_count, static_cast<std::uint32_t>(round - 1));
    for (int k = 6; k <= 9; ++k) board.Grant(origin + k * 12 * kMs);
    EXPECT_EQ(board.Status().failsafe_count, static_cast<std::uint32_t>(round));
    EXPECT_EQ(board.Status().supervisor_state, static_cast<std::uint32_t>(SupervisorState::kFailsafe));
    board.Grant(origin + 120 * kMs);
    board.Receive(origin + 121 * kMs, Reply(1));
    EXPECT_EQ(board.Status().supervisor_state, static_cast<std::uint32_t>(SupervisorState::kDegraded));
  }
}

TEST(TolerantTest, WaitingForTheServerIsNotBlindness) {
  FakeBoard board(Library(), "tolerant", "paper");
  TimeNs wake = board.Start(0);
  while (wake < 1000 * kMs) wake = board.Grant(wake);
  EXPECT_EQ(board.Status().failsafe_count, 0U);
}

}  // namespace
}  // namespace tiltproof::firmware
