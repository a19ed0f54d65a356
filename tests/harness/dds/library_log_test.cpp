#include "harness/dds/library_log.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "harness/dds/bus.h"
#include "harness/dds/domain_slot.h"
#include "tests/harness/dds/condition.h"
#include "tests/harness/dds/peer_process.h"

namespace tiltproof::dds {
namespace {

using testing::HasSubstr;
using testing::internal::CaptureStderr;
using testing::internal::GetCapturedStderr;

std::vector<std::string> LinesOf(const std::string& text) {
  std::vector<std::string> lines;
  for (std::size_t begin = 0; begin < text.size();) {
    const auto end = std::min(text.find('\n', begin), text.size());
    lines.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return lines;
}

// Where the first participant of a domain is asked who is there.
sockaddr_in DiscoveryPort(int domain) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<std::uint16_t>(7400 + 250 * domain + 10));
  return address;
}

TEST(LibraryLogTest, PrintsTheFirstMalformedPacketsAndCountsTheOthers) {
  const DomainSlot slot;
  CaptureStderr();
  std::optional<Bus> bus(std::in_place, BusConfig{.domain = slot.domain(), .tag = "test"});
  const int sender = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const auto address = DiscoveryPort(slot.domain());
  // A header of RTPS 2.1, and a message whose content is too short.
  std::string packet = std::string("RTPS\2\1\1\x10") + std::string(12, 'x');
  packet += std::string("\x15\1\x8\0\1\2\3\4\5\6\7\x8", 12);
  constexpr int kCount = 20;
  int sent_count = 0;
  for (int i = 0; i < kCount; ++i) {
    if (sendto(sender, packet.data(), packet.size(), 0, reinterpret_cast<const sockaddr*>(&address),
               sizeof address) == static_cast<ssize_t>(packet.size()))
      ++sent_count;
  }
  close(sender);
  // The packets that make the other process known come to the same port, after the malformed ones.
  bool known = false;
  {
    PeerProcess peer({"heartbeat", std::to_string(slot.domain()), "test", "peer"});
    Condition condition;
    const Subscriber<Heartbeat> heartbeats(*bus, condition.Waker(), condition.Waker());
    known = condition.Wait([&] { return heartbeats.MatchedCount() == 1; });
  }
  bus.reset();
  const auto text = GetCapturedStderr();
  EXPECT_EQ(sent_count, kCount);
  EXPECT_TRUE(known);
  const auto lines = LinesOf(text);
  ASSERT_EQ(lines.size(), kLibraryLinesShownMax + 1) << text;
  for (std::size_t i = 0; i < kLibraryLinesShownMax; ++i)
    EXPECT_THAT(lines[i], HasSubstr("tiltproof: the bus library reports: ")) << text;
  EXPECT_THAT(lines[0], HasSubstr("malformed packet received"));
  EXPECT_EQ(lines.back(), "tiltproof: the bus library reported 17 more lines");
}

TEST(LibraryLogTest, PrintsNothingThatCouldCommandATerminal) {
  CaptureStderr();
  OnLibraryMessage("red \033[31m\r\n\x9b\x7f two\n", false);
  PrintLibraryTotal();
  EXPECT_EQ(GetCapturedStderr(),
            "tiltproof: the bus library reports: red \\x1b[31m\\x0d\\x0a\\x9b\\x7f two\n");
}

TEST(LibraryLogTest, KeepsWhatIsSaidDuringACapture) {
  CaptureStderr();
  {
    const LibraryCapture capture;
    OnLibraryMessage("a reason\n", false);
    OnLibraryMessage("another", false);
    EXPECT_EQ(capture.text(), ": a reason: another");
    for (int i = 0; i < 10'000; ++i) OnLibraryMessage("much", false);
    EXPECT_LT(capture.text().size(), 2000U);
  }
  PrintLibraryTotal();
  EXPECT_EQ(GetCapturedStderr(), "");
}

TEST(LibraryLogTest, LosesNoLineOfManyThreadsAndPrintsAFatalOneAlways) {
  CaptureStderr();
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([] {
      for (int j = 0; j < 1000; ++j) OnLibraryMessage("line", false);
    });
  }
  for (auto& thread : threads) thread.join();
  OnLibraryMessage("the end", true);
  PrintLibraryTotal();
  OnLibraryMessage("a new bus", false);
  PrintLibraryTotal();
  for (int i = 0; i <= kLibraryLinesShownMax; ++i) OnLibraryMessage("x", false);
  PrintLibraryTotal();
  const std::string says = "tiltproof: the bus library reports: ";
  EXPECT_EQ(GetCapturedStderr(), says + "line\n" + says + "line\n" + says + "line\n" + says + "the end\n" +
                                     "tiltproof: the bus library reported 3997 more lines\n" + says +
                                     "a new bus\n" + says + "x\n" + says + "x\n" + says + "x\n" +
                                     "tiltproof: the bus library reported 1 more line\n");
}

}  // namespace
}  // namespace tiltproof::dds
