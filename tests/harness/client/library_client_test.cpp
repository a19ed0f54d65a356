// The host's firmware as a client: what a reset of its board does to it.
#include "harness/client/library_client.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <vector>

#include "faults/device_command.h"
#include "tests/support/control_period.h"
#include "tests/support/origins.h"

namespace tiltproof::harness {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

struct Board {
  Board() {
    client = LoadLibraryClient(TILTPROOF_FIRMWARE_LIBRARY, "paper", "paper",
                               {.transmit =
                                    [this](Uart, BootTime now, std::span<const std::uint8_t>) {
                                      sent.push_back(now);
                                      return now;
                                    },
                                .log = [](BootTime, std::string_view) {},
                                .event = [this](const DeviceEvent& event) { events.push_back(event); }});
  }
  std::vector<BootTime> sent;
  std::vector<DeviceEvent> events;
  std::unique_ptr<Client> client;
};

// A library of an earlier version gets a host of that version, and takes no parameters; one of a later version is refused.
TEST(LibraryClient, LoadsLibrariesOfEarlierVersions) {
  std::vector<std::string> log;
  const ClientHost host = {.transmit = [](Uart, BootTime now, std::span<const std::uint8_t>) { return now; },
                           .log = [&](BootTime, std::string_view text) { log.emplace_back(text); }};
  bool asked = false;
  const auto client =
      LoadLibraryClient(TILTPROOF_VERSION_1_CLIENT, "any", "paper", host, nullptr, false, [&] {
        asked = true;
        return std::string("{}");
      });
  EXPECT_EQ(client->Start(BootTime()), BootTime(7));
  EXPECT_THAT(log, ElementsAre("any"));
  EXPECT_FALSE(asked);
  EXPECT_FALSE(LibraryMistake(TILTPROOF_VERSION_1_CLIENT));
  EXPECT_FALSE(LibraryMistake(TILTPROOF_VERSION_2_CLIENT));
  EXPECT_THAT(LibraryMistake(TILTPROOF_VERSION_4_CLIENT).value_or(""),
              HasSubstr("built for client interface version 4, this tiltproof has versions 1 to 3"));
}

TEST(LibraryClient, PassesParameters) {
  const ClientHost host = {.transmit = [](Uart, BootTime now, std::span<const std::uint8_t>) { return now; },
                           .log = [](BootTime, std::string_view) {}};
  const auto load = [&](const std::string& parameters) {
    LoadLibraryClient(TILTPROOF_FIRMWARE_LIBRARY, "lqr", "paper", host, nullptr, false,
                      [&] { return parameters; });
  };
  std::string states, fields, row;
  for (const char* name : {"x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad", "vx_m_s", "vy_m_s",
                           "vz_m_s", "wx_rad_s", "wy_rad_s", "wz_rad_s"}) {
    const std::string comma = states.empty() ? "" : ", ";
    states += comma + R"({"name": ")" + name + R"(", "hover": 0})";
    fields += comma + R"({"signal": ")" + name + R"(", "type": "f32", "scale": 1, "min": -9, "max": 9})";
  }
  for (int i = 0; i < 16; ++i) row += std::string(i == 0 ? "" : ",") + " -1.5e-3";
  const auto text = [&](const std::string& gain) {
    return R"({"control_period_s": 0.012, "angular_rates": "world", "states": [)" + states +
           R"(], "inputs": [{"name": "f", "min": 0, "max": 2, "hover": 1}], "gain": )" + gain +
           R"(, "protocol": {"name": "own", "framing": {"type": "hdlc", "check": "sum8"}, "messages": [)"
           R"({"name": "reply", "role": "reply", "from": "server", "fields": [)" +
           fields +
           R"(]}, {"name": "actuators", "role": "actuators", "from": "client", "fields": [)"
           R"({"signal": "f", "type": "f32", "scale": 1, "min": 0, "max": 2}]}]}})";
  };
  load(text("[[" + row + "]]"));
  for (const std::string& wrong :
       {std::string(), std::string("{}"), text("null"), text("[]"), text("[[" + row + ", 1]]"),
        text("[[" + row + "], [" + row + "]]"), text("[[1, x]]"), text("[[1")})
    EXPECT_THROW(load(wrong), std::runtime_error) << wrong;
}

TEST(LibraryClient, IsSilentInResetAndThenBeginsAnew) {
  Board board;
  faults::FaultSpec reset;
  reset.id = "r";
  reset.type = "device.reset";
  reset.start_ns = kNsPerS;
  reset.parameters = {{"boot_ms", 30.0}};
  constexpr Origin kOrigin(BootTime{5 * kNsPerMs});
  BootTime wake = board.client->Start(BootTime());
  board.client->Command(faults::DeviceCommands({reset}, 1), kOrigin);
  const BootTime begin = kOrigin.ToBootTime(kNsPerS), end = begin + 30 * kNsPerMs;
  while (wake < begin) wake = board.client->Grant(wake, BootTime::Never());
  EXPECT_EQ(wake, begin);

  board.sent.clear();
  EXPECT_EQ(board.client->Grant(begin, BootTime::Never()), end);
  board.client->Receive(Uart::kMain, begin + 1, std::vector<std::uint8_t>{0x7E}, {});
  EXPECT_EQ(board.client->Grant(begin + 1, BootTime::Never()), end);
  EXPECT_TRUE(board.sent.empty());

  // `start`, and on a line without byte time the first request at once.
  EXPECT_EQ(board.client->Grant(end, BootTime::Never()), end + kControlPeriodNs);
  EXPECT_THAT(board.sent, ElementsAre(end, end));
  ASSERT_EQ(board.events.size(), 2U);
  EXPECT_EQ(board.events[0].fault, 0U);
  EXPECT_EQ(board.events[0].time_ns, begin);
  EXPECT_EQ(board.events[1].time_ns, end);
}

TEST(LibraryClient, AFastClockMakesItsPeriodShort) {
  Board board;
  faults::FaultSpec drift;
  drift.id = "d";
  drift.type = "clock.drift";
  drift.start_ns = kNsPerS;
  drift.end_ns = 2 * kNsPerS;
  drift.parameters = {{"ppm", 10'000.0}};
  BootTime wake = board.client->Start(BootTime());
  board.client->Command(faults::DeviceCommands({drift}, 1), kOriginAtPowerOn);
  const auto period_at = [&](TimeNs time_ns) {
    const BootTime time = kOriginAtPowerOn.ToBootTime(time_ns);
    while (wake < time) wake = board.client->Grant(wake, BootTime::Never());
    const BootTime begin = wake;
    wake = board.client->Grant(wake, BootTime::Never());
    return wake - begin;
  };
  EXPECT_EQ(period_at(kNsPerS / 2), kControlPeriodNs);
  EXPECT_NEAR(static_cast<double>(period_at(kNsPerS * 3 / 2)), static_cast<double>(kControlPeriodNs) / 1.01,
              1.0);
  EXPECT_EQ(period_at(3 * kNsPerS), kControlPeriodNs);
  // It transmits at the true time: the last request as its last period begins.
  EXPECT_EQ(board.sent.back(), wake - kControlPeriodNs);
  ASSERT_EQ(board.events.size(), 1U);
  EXPECT_EQ(board.events[0].time_ns, BootTime(kNsPerS));
  EXPECT_EQ(board.events[0].fault, 0U);
}

// When the requests are sent that are due every 12 ms of the client's clock, whose window is [1 s, 2 s).
std::vector<BootTime> RequestsWithJump(double jump_ms, std::vector<DeviceEvent>& events) {
  Board board;
  faults::FaultSpec jump;
  jump.id = "j";
  jump.type = "clock.jump";
  jump.start_ns = kNsPerS;
  jump.end_ns = 2 * kNsPerS;
  jump.parameters = {{"jump_ms", jump_ms}};
  BootTime wake = board.client->Start(BootTime());
  board.client->Command(faults::DeviceCommands({jump}, 1), kOriginAtPowerOn);
  while (wake < BootTime(3 * kNsPerS)) wake = board.client->Grant(wake, BootTime::Never());
  events = board.events;
  return board.sent;
}

// A clock that is ahead by 5 ms for a second: what was due within the 5 ms is sent at the jump, what is due
// meanwhile 5 ms sooner, and at the end the clock stands still for 5 ms.
TEST(LibraryClient, ItsClockJumpsForwardAndBack) {
  std::vector<DeviceEvent> events;
  std::vector<BootTime> expected = {BootTime(), BootTime()};
  for (TimeNs due = kControlPeriodNs; due < 3 * kNsPerS; due += kControlPeriodNs) {
    TimeNs sent = due;
    if (due >= kNsPerS && due <= 2 * kNsPerS + 5 * kNsPerMs) sent = std::max(kNsPerS, due - 5 * kNsPerMs);
    expected.emplace_back(sent);
  }
  EXPECT_EQ(RequestsWithJump(5, events), expected);
  ASSERT_EQ(events.size(), 2U);
  EXPECT_EQ(events[0].time_ns, BootTime(kNsPerS));
  EXPECT_EQ(events[0].fault, 0U);
  EXPECT_EQ(events[0].text, "the clock jumps forward by 5 ms");
  EXPECT_EQ(events[1].time_ns, BootTime(2 * kNsPerS));
  EXPECT_EQ(events[1].fault, std::nullopt);  // one activation, not two
  EXPECT_EQ(events[1].text, "the clock jumps back by 5 ms");
}

// A clock that is behind by 100 ms for a second. When it is right again, up to nine requests are overdue: the paper's
// firmware sends one, and keeps to its grid.
TEST(LibraryClient, ItsClockJumpsBackAndForward) {
  std::vector<DeviceEvent> events;
  const std::vector<BootTime> sent = RequestsWithJump(-100, events);
  std::vector<BootTime> expected = {BootTime(), BootTime()};
  for (TimeNs due = kControlPeriodNs; due <= kNsPerS; due += kControlPeriodNs) expected.emplace_back(due);
  for (TimeNs due = 1'008 * kNsPerMs; due < 1'900 * kNsPerMs; due += kControlPeriodNs)
    expected.emplace_back(due + 100 * kNsPerMs);
  ASSERT_GT(sent.size(), expected.size());
  EXPECT_EQ(std::vector(sent.begin(), sent.begin() + static_cast<std::ptrdiff_t>(expected.size())), expected);
  EXPECT_EQ(sent[expected.size()], BootTime(2 * kNsPerS));
}

TEST(LibraryClient, RunsLateWhileOtherWorkHasTheProcessor) {
  Board board;
  faults::FaultSpec work;
  work.id = "w";
  work.type = "device.task_delay";
  work.start_ns = kNsPerS;
  work.end_ns = 2 * kNsPerS;
  work.parameters = {{"delay_ms", 4.0}, {"every_ms", 100.0}};
  BootTime wake = board.client->Start(BootTime());
  board.client->Command(faults::DeviceCommands({work}, 1), kOriginAtPowerOn);
  while (wake < BootTime(3 * kNsPerS)) wake = board.client->Grant(wake, BootTime::Never());
  // A request is due every 12 ms. Those that fall into one of the ten times of 4 ms are sent at its end.
  std::vector<BootTime> expected = {BootTime(), BootTime()};
  std::size_t late_count = 0;
  for (TimeNs due = kControlPeriodNs; due < 3 * kNsPerS; due += kControlPeriodNs) {
    const TimeNs since = due % (100 * kNsPerMs);
    const bool held = due >= kNsPerS && due < 2 * kNsPerS && since < 4 * kNsPerMs;
    late_count += held ? 1 : 0;
    expected.emplace_back(held ? due - since + 4 * kNsPerMs : due);
  }
  EXPECT_EQ(board.sent, expected);
  EXPECT_GT(late_count, 2U);
  EXPECT_EQ(board.events.size(), late_count);
  for (const DeviceEvent& event : board.events) EXPECT_EQ(event.fault, 0U);
}

}  // namespace
}  // namespace tiltproof::harness
