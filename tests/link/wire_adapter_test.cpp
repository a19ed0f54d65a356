// The buffer of a USB-serial adapter at the end of a wire.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "harness/scenario/shipped_protocols.h"
#include "link/wire.h"
#include "tests/link/taken.h"

namespace tiltproof::link {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

using Bytes = std::vector<std::uint8_t>;

constexpr BootTime kStart(5 * kNsPerMs);
// 10 bits at 921600 baud are 10850.694444... ns.
constexpr TimeNs kByteTimes[] = {0, 10850, 21701, 32552, 43402, 54253, 65104, 75954, 86805, 97656, 108506};

const Protocol& kPaper = *harness::FindProtocol("paper");

TEST(WireAdapterTest, AnAdaptersBufferIsPassedOnWhenItIsFullAndAfterItsTime) {
  Wire wire({.baud = 921'600, .adapter_latency_ns = kNsPerMs, .adapter_bytes_count = 3}, Direction::kToPlant,
            kPaper, nullptr);
  std::vector<Taken> passed_on;
  wire.SetTaps(
      {.sent = {}, .delivered = {}, .passed_on = [&](BootTime at, std::span<const std::uint8_t> bytes) {
         passed_on.push_back({at, {bytes.begin(), bytes.end()}});
       }});
  const Bytes frame = {0x7E, 1, 2, 3, 0x7E};
  wire.Transmit(kStart, frame);
  const BootTime full = kStart + kByteTimes[3], late = kStart + kByteTimes[4] + kNsPerMs;
  EXPECT_EQ(wire.NextArrival(), late) << "a frame is worth waking for when its last byte has arrived";
  EXPECT_THAT(TakeAll(wire, full - 1), IsEmpty());
  EXPECT_THAT(TakeAll(wire, full), ElementsAre(Taken{full, {0x7E, 1, 2}}));
  // One more byte fills the buffer before its time.
  const BootTime again = kStart + kByteTimes[10];
  wire.Transmit(again, {{0x7E, 4, 0x7E}});
  EXPECT_EQ(wire.NextArrival(), again + kByteTimes[1]);
  EXPECT_THAT(TakeAll(wire), ElementsAre(Taken{again + kByteTimes[1], {3, 0x7E}},
                                         Taken{again + kByteTimes[2] + kNsPerMs, {0x7E, 4, 0x7E}}));
  EXPECT_THAT(passed_on, ElementsAre(Taken{full, {0x7E, 1, 2}}, Taken{again + kByteTimes[1], {3, 0x7E}},
                                     Taken{again + kByteTimes[1], {0x7E}},
                                     Taken{again + kByteTimes[2] + kNsPerMs, {4, 0x7E}}));
  EXPECT_EQ(wire.NextArrival(), BootTime::Never());
}

// Beside a buffer that is filled byte by byte.
RC_GTEST_PROP(WireAdapterPropertyTest, AnAdaptersBufferEqualsItsModel, ()) {
  const WireConfig config{.baud = *rc::gen::element<std::int64_t>(921'600, 115'200, 0),
                          .adapter_latency_ns = *rc::gen::element<TimeNs>(0, 20'000, 1'000'000),
                          .adapter_bytes_count = *rc::gen::inRange<std::int64_t>(1, 8)};
  Wire wire(config, Direction::kToPlant, kPaper, nullptr);
  // Times at which the bytes come to the adapter, in order.
  std::vector<BootTime> line;
  Bytes sent, received;
  std::size_t transmitted = 0;
  std::vector<BootTime> passed_on;
  wire.SetTaps({.sent = {},
                .delivered =
                    [&](const Chunk& chunk) {
                      for (std::size_t i = 0; i < chunk.bytes.size(); ++i) {
                        line.push_back(chunk.begin_ns + wire.BytesTime(static_cast<std::int64_t>(i) + 1));
                        sent.push_back(chunk.bytes[i]);
                      }
                    },
                .passed_on =
                    [&](BootTime at, std::span<const std::uint8_t> bytes) {
                      passed_on.insert(passed_on.end(), bytes.size(), at);
                    }});
  struct Look {
    BootTime at;
    std::size_t received, transmitted;  // by then
  };
  std::vector<Look> looks;
  std::vector<std::pair<std::size_t, BootTime>> pieces;
  const auto take = [&](BootTime until) {
    wire.Take(until, [&](BootTime arrival, std::span<const std::uint8_t> piece) {
      received.insert(received.end(), piece.begin(), piece.end());
      pieces.emplace_back(received.size(), arrival);
    });
    looks.push_back({until, received.size(), transmitted});
  };
  BootTime now = kStart;
  for (int op = *rc::gen::inRange(1, 25); op > 0; --op) {
    now += *rc::gen::weightedOneOf<TimeNs>(
        {{2, rc::gen::inRange<TimeNs>(0, 50'000)}, {1, rc::gen::inRange<TimeNs>(0, 3'000'000)}});
    if (*rc::gen::arbitrary<bool>()) {
      Bytes frame = *rc::gen::container<Bytes>(rc::gen::element<std::uint8_t>(1, 2));
      frame.insert(frame.begin(), {0x7E, 3});
      frame.push_back(0x7E);
      wire.Transmit(now, frame);
      transmitted += frame.size();
    } else {
      // Never beyond what it says that there is, as those who wait for it do.
      take(std::max(now, std::min(wire.NextArrival(), now + 10'000)));
      now = looks.back().at;
    }
  }
  take(BootTime::Never());

  std::vector<BootTime> expected(line.size());
  for (std::size_t first = 0; first < line.size();) {
    std::size_t end = first;
    while (end < line.size() && end - first < static_cast<std::size_t>(config.adapter_bytes_count) &&
           line[end] <= line[first] + config.adapter_latency_ns)
      ++end;
    const bool full = end - first == static_cast<std::size_t>(config.adapter_bytes_count);
    for (std::size_t i = first; i < end; ++i)
      expected[i] = full ? line[end - 1] : line[first] + config.adapter_latency_ns;
    first = end;
  }
  RC_ASSERT(received == sent);
  RC_ASSERT(passed_on == expected);
  for (const auto& [count, arrival] : pieces) RC_ASSERT(arrival == expected[count - 1]);
  for (const Look& look : looks) {
    const auto end = expected.begin() + static_cast<std::ptrdiff_t>(look.transmitted);
    RC_ASSERT(static_cast<std::size_t>(std::count_if(
                  expected.begin(), end, [&](BootTime at) { return at <= look.at; })) == look.received);
  }
}

}  // namespace
}  // namespace tiltproof::link
