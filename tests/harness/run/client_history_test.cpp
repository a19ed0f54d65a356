// Restarts and requests of the client, from a log put together by hand.
#include "harness/run/client_history.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "firmware/messages.h"
#include "harness/client/client.h"
#include "harness/scenario/shipped_protocols.h"
#include "tests/harness/run/by_hand.h"

namespace tiltproof::harness {
namespace {

using link::Direction;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

const link::Protocol& kPaperProtocol = *FindProtocol("paper");

void Sends(RunLog& log, TimeNs begin_ns, std::span<const std::uint8_t> frame,
           Direction direction = Direction::kToPlant, bool delivered = false) {
  link::LogChunk chunk;
  chunk.begin_ns = begin_ns;
  chunk.bytes.assign(frame.begin(), frame.end());
  log.link.Append(chunk, {0, direction}, delivered);
}
std::vector<std::uint8_t> Start(link::Dialect dialect = link::Dialect::kPaper) {
  return FrameOf(link::EncodeStart(dialect, {}));
}
std::vector<std::uint8_t> SomeActuators() {
  return FrameOf(link::EncodeActuators(link::Dialect::kPaper, {.f_r_n = 10, .f_l_n = 10}));
}
std::vector<std::uint8_t> Request() { return FrameOf(link::EncodeReadSensors(link::Dialect::kPaper)); }

void AddHistory(RunLog& log, const link::Protocol& protocol) {
  ClientHistory history(protocol);
  std::size_t offset = 0;
  while (const auto record = log.link.Next(offset))
    if (!record->delivered && record->wire == WireId{0, Direction::kToPlant})
      history.Receive(record->begin_ns, record->bytes);
  history.AddTo(log, 0);
}

TEST(ClientHistory, RequestsAreTakenAsTheClientSentThem) {
  RunLog log;
  const std::vector<std::uint8_t> request = Request(), start = Start();
  Sends(log, 0, start);
  Sends(log, 10, request);
  Sends(log, 11, request, Direction::kToPlant, true);  // as it came out of the faults, twice
  Sends(log, 12, request, Direction::kToPlant, true);
  Sends(log, 15, request, Direction::kToClient);
  // In two chunks: it counts when it is whole.
  Sends(log, 20, std::span(request).first(4));
  Sends(log, 30, std::span(request).subspan(4));
  const std::vector<std::uint8_t> noise = {0x7E, 1, 2, 3, 0x7E};
  Sends(log, 40, noise);
  AddHistory(log, kPaperProtocol);
  EXPECT_THAT(log.clients[0].sent_request_times_ns, ElementsAre(10, 30));
  EXPECT_THAT(log.clients[0].restarts, IsEmpty());
}

TEST(ClientHistory, AStartAfterTheFirstActuatorsIsARestart) {
  RunLog log;
  const std::vector<std::uint8_t> start = Start();
  Sends(log, 0, start);
  Sends(log, 50, start);  // repeated: it may not know that it was heard
  Sends(log, 90, SomeActuators());
  log.clients[0].actuator_times_ns = {100, 200};
  Sends(log, 150, start);
  Sends(log, 160, start, Direction::kToPlant, true);  // a copy that a fault has made
  AddHistory(log, kPaperProtocol);
  EXPECT_THAT(log.clients[0].restarts, ElementsAre(Restart{150, "it sent `start` again"}));
}

// One that flies: it has started, and its first actuators were accepted.
RunLog Flying() {
  RunLog log;
  log.clients[0].starts_accepted_count = 1;
  Sends(log, 0, Start());
  Sends(log, 50, SomeActuators());
  log.clients[0].actuator_times_ns = {100};
  return log;
}

TEST(ClientHistory, EachRestartInSoftwareCountsOnce) {
  RunLog log = Flying();
  for (const TimeNs boot : {200, 500}) {
    Sends(log, boot, Start());
    Sends(log, boot + 20, Start());  // a retry
    Sends(log, boot + 50, SomeActuators());
  }
  AddHistory(log, kPaperProtocol);
  EXPECT_THAT(log.clients[0].restarts,
              ElementsAre(Restart{200, "it sent `start` again"}, Restart{500, "it sent `start` again"}));
}

TEST(ClientHistory, AResetAndTheStartAfterItAreOneRestart) {
  RunLog log = Flying();
  log.events = {{200, kResetEvent, "reset by pin"}};
  Sends(log, 201, SomeActuators());  // was under way
  Sends(log, 260, Start());
  Sends(log, 270, Start());
  Sends(log, 300, SomeActuators());
  AddHistory(log, kPaperProtocol);
  EXPECT_THAT(log.clients[0].restarts, ElementsAre(Restart{200, "reset by pin"}));
  // And what it does by itself after that is its own.
  Sends(log, 400, Start());
  AddHistory(log, kPaperProtocol);
  EXPECT_THAT(log.clients[0].restarts,
              ElementsAre(Restart{200, "reset by pin"}, Restart{400, "it sent `start` again"}));
}

TEST(ClientHistory, AResetThatIsReportedLateIsTheRestartThatItsStartTold) {
  RunLog log = Flying();
  Sends(log, 200, Start());
  Sends(log, 300, SomeActuators());
  log.events = {{200 + 50 * kNsPerMs, kResetEvent, "reset by pin"},
                {900 * kNsPerMs, kResetEvent, "reset by watchdog"}};
  AddHistory(log, kPaperProtocol);
  EXPECT_THAT(log.clients[0].restarts,
              ElementsAre(Restart{200, "reset by pin"}, Restart{900 * kNsPerMs, "reset by watchdog"}));
}

TEST(ClientHistory, InTheAuthorsDialectEveryStartIsAnActuatorMessage) {
  RunLog log;
  const std::vector<std::uint8_t> start = Start(link::Dialect::kProvant);
  log.clients[0].actuator_times_ns = {100};
  Sends(log, 150, start);
  AddHistory(log, *FindProtocol("provant"));
  EXPECT_THAT(log.clients[0].restarts, IsEmpty());
}

TEST(ClientHistory, ResetsCountFromTheStartOfTheFlight) {
  RunLog log;
  log.events = {{-5, kResetEvent, "reset by pin"},
                {10, kResetEvent, "reset by watchdog"},
                {11, "device_runs", "the processor runs again"}};
  AddHistory(log, kPaperProtocol);
  EXPECT_THAT(log.clients[0].restarts, IsEmpty()) << "it never started";
  log.clients[0].starts_accepted_count = 1;
  AddHistory(log, kPaperProtocol);
  EXPECT_THAT(log.clients[0].restarts, ElementsAre(Restart{10, "reset by watchdog"}));
}

std::string Explained(RunLog& log) {
  log.end_reason = EndReason::kNeverStarted;
  log.end_text = "why";
  ExplainNeverStarted(log, kPaperProtocol);
  return log.end_text;
}

TEST(ClientHistory, AFlightThatNeverStartedSaysWhatArrived) {
  RunLog silent;
  const std::vector<std::uint8_t> start = Start(), request = Request();
  Sends(silent, 0, start);  // and it was lost
  EXPECT_EQ(Explained(silent), "why; not a byte arrived from the firmware");

  RunLog running;
  for (TimeNs t = 0; t < 3; ++t) Sends(running, t, request, Direction::kToPlant, true);
  EXPECT_EQ(Explained(running),
            "why; 24 bytes arrived, 3 x `request`; if it was running already, reset it: a flight starts with "
            "`start`");

  RunLog damaged;
  std::vector<std::uint8_t> wrong(start.begin(), start.end());
  wrong[2] ^= 1;
  Sends(damaged, 0, wrong, Direction::kToPlant, true);
  EXPECT_THAT(Explained(damaged), testing::HasSubstr("1 frame refused (bad_checksum)"));

  RunLog other;
  const std::vector<std::uint8_t> text(40, 'x');
  Sends(other, 0, text, Direction::kToPlant, true);
  EXPECT_EQ(Explained(other), "why; 40 bytes arrived, and no frame among them");
}

}  // namespace
}  // namespace tiltproof::harness
