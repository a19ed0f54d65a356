// The host's firmware as a client: what a reset of its board does to it.
#include "harness/client/library_client.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "faults/device_command.h"

namespace tiltproof::harness {
namespace {

using ::testing::ElementsAre;

struct Board {
  Board() {
    client = LoadLibraryClient(TILTPROOF_FIRMWARE_LIBRARY, "paper", link::Dialect::kPaper,
                               {.transmit =
                                    [this](Uart, TimeNs now, std::span<const std::uint8_t>) {
                                      sent.push_back(now);
                                      return now;
                                    },
                                .log = [](TimeNs, std::string_view) {},
                                .event = [this](const DeviceEvent& event) { events.push_back(event); }});
  }
  std::vector<TimeNs> sent;
  std::vector<DeviceEvent> events;
  std::unique_ptr<Client> client;
};

TEST(LibraryClient, IsSilentInResetAndThenBeginsAnew) {
  Board board;
  faults::FaultSpec reset;
  reset.id = "r";
  reset.type = "device.reset";
  reset.start_ns = kNsPerS;
  reset.parameters = {{"boot_ms", 30.0}};
  TimeNs wake = board.client->Start(0);
  board.client->Command(faults::DeviceCommands({reset}, 1), 5 * kNsPerMs);
  const TimeNs begin = kNsPerS + 5 * kNsPerMs, end = begin + 30 * kNsPerMs;
  while (wake < begin) wake = board.client->Grant(wake, kNever);
  EXPECT_EQ(wake, begin);

  board.sent.clear();
  EXPECT_EQ(board.client->Grant(begin, kNever), end);
  board.client->Receive(Uart::kMain, begin + 1, std::vector<std::uint8_t>{0x7E}, {});
  EXPECT_EQ(board.client->Grant(begin + 1, kNever), end);
  EXPECT_TRUE(board.sent.empty());

  // `start`, and on a line without byte time the first request at once.
  EXPECT_EQ(board.client->Grant(end, kNever), end + kControlPeriodNs);
  EXPECT_THAT(board.sent, ElementsAre(end, end));
  ASSERT_EQ(board.events.size(), 2U);
  EXPECT_EQ(board.events[0].fault, 0U);
  EXPECT_EQ(board.events[0].time_ns, begin);
  EXPECT_EQ(board.events[1].time_ns, end);
}

}  // namespace
}  // namespace tiltproof::harness
