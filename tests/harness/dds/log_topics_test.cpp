#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdio>

#include "harness/dds/bus.h"
#include "harness/dds/domain_slot.h"
#include "harness/dds/qos.h"
#include "tests/harness/dds/condition.h"
#include "tests/harness/dds/peer_process.h"

namespace tiltproof::dds {
namespace {

struct Trouble {
  int loss_percent;
  int cut_ms;
};

class LogTroublesTest : public testing::TestWithParam<Trouble> {};

// Everything of every log, in order, once.
template <class T>
struct Received {
  explicit Received(Bus& bus, Condition& condition) : subscriber(bus, condition.Waker()) {}
  std::int64_t Last() {
    for (const auto& message : subscriber.Take()) sequences.push_back(message.sequence);
    return sequences.empty() ? 0 : sequences.back();
  }
  void ExpectComplete(std::int64_t count) {
    std::vector<std::int64_t> expected;
    for (std::int64_t i = 1; i <= count; ++i) expected.push_back(i);
    EXPECT_EQ(sequences, expected) << QosOf<T>().type;
    EXPECT_TRUE(subscriber.Gaps().empty());
    EXPECT_EQ(subscriber.CompleteUpTo("run", "plant"), count);
  }
  Subscriber<T> subscriber;
  std::vector<std::int64_t> sequences;
};

TEST_P(LogTroublesTest, NothingIsLostAndNothingComesTwice) {
  constexpr int kCount = 400;
  const DomainSlot slot;
  BusConfig config;
  config.domain = slot.domain();
  config.tag = "test";
  config.xmit_loss = GetParam().loss_percent / 100.0;  // acknowledgements get lost as well
  Bus bus(config);
  Condition condition;
  Received<SerialTap> taps(bus, condition);
  Received<FaultActivation> activations(bus, condition);
  Received<RunEvent> events(bus, condition);
  Received<Records> records(bus, condition);
  PeerProcess peer({"send_logs", std::to_string(slot.domain()), "test", std::to_string(kCount),
                    std::to_string(GetParam().loss_percent), std::to_string(GetParam().cut_ms)});
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_TRUE(condition.Wait(
      [&] {
        return taps.Last() >= kCount && activations.Last() >= kCount && events.Last() >= kCount &&
               records.Last() >= kCount;
      },
      std::chrono::seconds(40)));
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  taps.ExpectComplete(kCount);
  activations.ExpectComplete(kCount);
  events.ExpectComplete(kCount);
  records.ExpectComplete(kCount);
  EXPECT_EQ(peer.ReadLine(), "refused 0 acked 1");
  std::printf("loss %d %%, cut %d ms: all there after %.1f s, %s\n", GetParam().loss_percent,
              GetParam().cut_ms, took.count(), peer.ReadLine().c_str());
}

INSTANTIATE_TEST_SUITE_P(Troubles, LogTroublesTest,
                         testing::Values(Trouble{0, 0}, Trouble{10, 0}, Trouble{10, 1500}, Trouble{0, 3000}),
                         [](const auto& trouble) {
                           return "Loss" + std::to_string(trouble.param.loss_percent) + "Cut" +
                                  std::to_string(trouble.param.cut_ms);
                         });

// A publisher that starts again repeats its history; subscribers pass each message on once.
TEST(LogTopicsTest, AHistoryToldAgainPassesOnce) {
  const DomainSlot slot;
  BusConfig config;
  config.domain = slot.domain();
  config.tag = "test";
  Bus bus(config);
  Condition condition;
  Received<RunEvent> events(bus, condition);
  const auto publish = [&](Publisher<RunEvent>& publisher, std::int64_t first, std::int64_t last) {
    RunEvent event;
    event.run_id = "run";
    event.node_id = "plant";
    for (event.sequence = first; event.sequence <= last; ++event.sequence) publisher.Write(event);
  };
  {
    Publisher<RunEvent> publisher(bus);
    publish(publisher, 1, 5);
    ASSERT_TRUE(condition.Wait([&] { return events.Last() == 5; }));
  }
  Publisher<RunEvent> publisher(bus);
  publish(publisher, 1, 7);
  publish(publisher, 9, 10);
  ASSERT_TRUE(condition.Wait([&] { return events.Last() == 10; }));
  EXPECT_EQ(events.sequences, (std::vector<std::int64_t>{1, 2, 3, 4, 5, 6, 7, 9, 10}));
  EXPECT_EQ(events.subscriber.CompleteUpTo("run", "plant"), 7);
  EXPECT_EQ(events.subscriber.Gaps(), (std::vector<SequenceGap>{{"run", "plant", 8, 8}}));
}

TEST(LogTopicsTest, AWriterRefusesRatherThanWaitsForAStuckReader) {
  const DomainSlot slot;
  BusConfig config;
  config.domain = slot.domain();
  config.tag = "test";
  Bus bus(config);
  Condition condition;
  Publisher<SerialTap> taps(bus, condition.Waker());
  PeerProcess peer({"take_taps", std::to_string(slot.domain()), "test"});
  ASSERT_EQ(peer.ReadLine(), "ready");
  ASSERT_TRUE(condition.Wait([&] { return taps.MatchedCount() == 1; }));
  peer.Signal(SIGSTOP);

  SerialTap tap{"run", "plant", 1, std::vector<TapFrame>(1), {}, {}};
  tap.frames[0].bytes.assign(60'000, 7);
  std::chrono::duration<double, std::milli> slowest{0};
  const auto write = [&] {
    const auto begin = std::chrono::steady_clock::now();
    const bool written = taps.Write(tap);
    slowest = std::max<std::chrono::duration<double, std::milli>>(slowest,
                                                                  std::chrono::steady_clock::now() - begin);
    return written;
  };
  while (tap.sequence < 3000 && write()) ++tap.sequence;
  std::printf("refused after %.0f MB, slowest write %.1f ms\n", static_cast<double>(tap.sequence) * 0.06,
              slowest.count());
  EXPECT_GT(tap.sequence, 1000);
  EXPECT_LT(tap.sequence, 1500);
  // Had each waited for the reader, as long as DDS does by default, that would be 5 s.
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < 50; ++i) EXPECT_FALSE(taps.Write(tap));
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(2));

  // A refused message may be written again, and in the end no message is missing.
  peer.Signal(SIGCONT);
  ASSERT_TRUE(condition.Wait([&] { return taps.Write(tap); }));
  ASSERT_TRUE(taps.WaitForAcks(30 * kNsPerS));
  const auto expected = std::to_string(tap.sequence) + " of " + std::to_string(tap.sequence);
  EXPECT_TRUE(condition.Wait([&] {
    peer.WriteLine("?");
    return peer.ReadLine() == expected;
  }));
}

}  // namespace
}  // namespace tiltproof::dds
