// Programs as clients: small ones in Python, from their first message to their end.
#include "harness/client/program_client.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "tests/support/origins.h"

namespace tiltproof::harness {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// A program with this code in the place of a grant or a reset; `now` is the time, `until` the answer.
class ProgramBoard {
 public:
  explicit ProgramBoard(const std::string& on_grant, const std::string& on_bytes = "pass") {
    std::ofstream(file_) << "from tiltproof.program import *\n"
                            "program = Program(tells_status=True)\n"
                            "for event in program:\n"
                            "    now, until = event.now_ns, NEVER\n"
                            "    if event.kind == 'bytes':\n"
                            "        " +
                                on_bytes +
                                "\n        continue\n"
                                "    " +
                                on_grant + "\n    program.wait(until)\n";
    client = StartProgramClient(
        {.name = "program:test.py",
         .command = "PYTHONPATH='" TILTPROOF_SOURCE "/python' exec python3 -B " + file_.string()},
        {.uarts = {{}, {}}, .firmware = "paper", .dialect = "paper", .parameters = "{}"},
        {.transmit =
             [this](Uart uart, BootTime now, std::span<const std::uint8_t> bytes) {
               sent.push_back(std::to_string(static_cast<int>(uart)) + "@" + std::to_string(now.ns()) + ":" +
                              std::string(bytes.begin(), bytes.end()));
               return now + 1000;
             },
         .log =
             [this](BootTime now, std::string_view text) {
               log.push_back(std::to_string(now.ns()) + " " + std::string(text));
             },
         .event = [this](const DeviceEvent& event) { events.push_back(event.kind); }});
  }
  ~ProgramBoard() {
    client.reset();
    std::filesystem::remove(file_);
  }
  std::string Trouble() {
    try {
      client->Grant(BootTime(7), BootTime(7));
    } catch (const FirmwareTrouble& trouble) {
      place = trouble.end.place;
      return trouble.what();
    }
    return "";
  }

  std::vector<std::string> sent, log, events;
  std::string place;
  std::unique_ptr<Client> client;

 private:
  std::filesystem::path file_ = std::filesystem::path(::testing::TempDir()) / "board.py";
};

void Give(Client& client, BootTime at, std::string_view text) {
  client.Receive(Uart::kReference, at,
                 std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()), {});
}

TEST(ProgramClient, ExchangesBytesStatusAndText) {
  ProgramBoard board("program.status(2, now); program.log(now, 'at ' + str(now)); until = now + 5",
                     "program.transmit(event.uart, now, event.data)");
  EXPECT_EQ(board.client->Start(BootTime(0)), BootTime(5));
  Give(*board.client, BootTime(9), "ab");
  Give(*board.client, BootTime(9), "c");
  EXPECT_THAT(board.sent, ElementsAre()) << "with the next grant";
  EXPECT_EQ(board.client->Grant(BootTime(9), BootTime(9)), BootTime(14));
  EXPECT_THAT(board.sent, ElementsAre("1@9:ab", "1@9:c"));
  EXPECT_THAT(board.log, ElementsAre("0 at 0", "9 at 9"));
  EXPECT_EQ(board.client->Status()->supervisor_state, 2U);
  EXPECT_EQ(board.client->Status()->failsafe_count, 9U);
  EXPECT_FALSE(board.client->End().has_value());
}

TEST(ProgramClient, IsToldWhenBytesHaveLeft) {
  ProgramBoard board("until = program.sent_at(MAIN, now + 3, b'x')");
  EXPECT_EQ(board.client->Start(BootTime(0)), BootTime(1003));
  EXPECT_THAT(board.sent, ElementsAre("0@3:x"));
}

TEST(ProgramClient, StatesItsComputing) {
  ProgramBoard board("until = program.compute(now, 1000000, now + 2000000)");
  const std::vector<faults::DeviceCommand> commands = {
      {.at_ns = 0, .until_ns = 10'500'000, .fault = 0, .action = faults::SlowProcessor{.factor = 3}}};
  board.client->Command(commands, kOriginAtPowerOn);
  EXPECT_EQ(board.client->Start(BootTime(0)), BootTime(3'000'000));
  EXPECT_THAT(board.events, ElementsAre(kComputesEvent, "computing_stretched", kDeadlineMissedEvent));
  board.events.clear();
  // Half a millisecond at a third of the speed, and the rest.
  EXPECT_EQ(board.client->Grant(BootTime(9'900'000), BootTime(0)), BootTime(11'300'000));
  EXPECT_EQ(board.client->Grant(BootTime(20'000'000), BootTime(0)), BootTime(21'000'000));
  EXPECT_THAT(board.events, ElementsAre("computing_stretched"));
}

// Whatever times a program states.
TEST(ProgramClient, AnyComputingEnds) {
  ProgramBoard board(
      "until = max(program.compute(a, b, c) for a in (-2**63, 0, 2**63 - 1) for b in (1, 2**63 - 1) "
      "for c in (-2**63, 2**63 - 1))");
  EXPECT_EQ(board.client->Start(BootTime(0)), BootTime(3601 * kNsPerS));
}

TEST(ProgramClient, ResetsAndRunsOnAClockThatIsWrong) {
  ProgramBoard board("program.transmit(MAIN, now, event.kind.encode()); until = now + 1000000");
  board.client->Start(BootTime(0));
  const std::vector<faults::DeviceCommand> commands = {
      {.at_ns = 1'000'000, .until_ns = 2'000'000, .fault = 0, .action = faults::ResetProcessor{}},
      {.at_ns = 0, .until_ns = kNever, .fault = 1, .action = faults::DriftClock{.ppm = 10'000}}};
  board.client->Command(commands, kOriginAtPowerOn);
  EXPECT_EQ(board.client->Grant(BootTime(1'000'000), BootTime(0)), BootTime(2'000'000)) << "held";
  board.client->Grant(BootTime(2'000'000), BootTime(0));
  // Its clock shows 2.02 ms, and 2.02 ms on its clock are 2 ms.
  EXPECT_THAT(board.sent, ElementsAre("0@0:grant", "0@2000000:reset"));
  EXPECT_THAT(board.events, ElementsAre("clock_drift", kResetEvent, "device_runs"));
}

TEST(ProgramClient, NamesThePlaceOfAnException) {
  ProgramBoard board("print('before'); until = 1 // now");
  const std::string trouble = [&] {
    try {
      board.client->Start(BootTime(0));
    } catch (const FirmwareTrouble& caught) {
      board.place = caught.end.place;
      return std::string(caught.what());
    }
    return std::string();
  }();
  EXPECT_THAT(
      trouble,
      HasSubstr("the firmware exited with code 1 in grant: ZeroDivisionError: integer division or modulo "
                "by zero at "));
  EXPECT_THAT(board.place, HasSubstr("board.py:8"));
  EXPECT_EQ(board.log.front(), "0 before");
}

TEST(ProgramClient, SendsNothingBehindItsAnswer) {
  ProgramBoard board("program._send(0x82, 0, 0, (1).to_bytes(8, 'little'))");
  EXPECT_EQ(board.Trouble(),
            "the firmware broke the protocol of docs/program.md in grant: it sent more behind `waiting`");
}

TEST(ProgramClient, FailsByGarbageWithItsBytes) {
  ProgramBoard board("program._out += b'\\x01\\x00\\x00\\x00\\x99\\x00\\x00\\x00!'");
  EXPECT_EQ(board.Trouble(),
            "the firmware broke the protocol of docs/program.md in grant: kind 153, which no program sends, "
            "at byte 12 of "
            "what it sent (01 00 00 00 99 00 00 00)");
}

TEST(ProgramClient, ReportsHowItFailedToEnd) {
  ProgramBoard board("pass");
  board.client->Start(BootTime(0));
  EXPECT_FALSE(board.client->End().has_value());
  ProgramBoard other("pass; sys = __import__('sys'); sys.exit(5) if now else None");
  other.client->Start(BootTime(0));
  EXPECT_EQ(other.Trouble(), "the firmware exited with code 5 in grant");
}

}  // namespace
}  // namespace tiltproof::harness
