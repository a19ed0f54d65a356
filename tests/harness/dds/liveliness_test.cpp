#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdio>

#include "harness/dds/bus.h"
#include "harness/dds/domain_slot.h"
#include "tests/harness/dds/condition.h"
#include "tests/harness/dds/peer_process.h"

namespace tiltproof::dds {
namespace {

// The lease is 200 ms; the rest is for a busy machine.
constexpr double kSeenWithin_ms = 2000;

class LivelinessTest : public testing::Test {
 protected:
  LivelinessTest()
      : bus_(Config(slot_.domain())), heartbeats_(bus_, condition_.Waker(), condition_.Waker()) {}

  static BusConfig Config(int domain) {
    BusConfig config;
    config.domain = domain;
    config.tag = "test";
    return config;
  }
  PeerProcess Peer(const std::string& node) {
    return PeerProcess({"heartbeat", std::to_string(slot_.domain()), "test", node});
  }
  std::string State(const std::string& node) {
    for (const auto& life : heartbeats_.Nodes()) {
      if (life.last.node_id == node) return life.alive ? "alive" : "dead";
    }
    return "unknown";
  }
  bool Becomes(const std::string& node, const std::string& state) {
    return condition_.Wait([&] { return State(node) == state; });
  }
  // Waits for it, and prints how long that took.
  void ExpectSeenDead(const std::string& node, const char* how) {
    const auto begin = std::chrono::steady_clock::now();
    ASSERT_TRUE(Becomes(node, "dead"));
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - begin;
    std::printf("%s: seen after %.0f ms\n", how, took.count());
    EXPECT_LT(took.count(), kSeenWithin_ms);
  }

  DomainSlot slot_;
  Condition condition_;
  Bus bus_;
  Subscriber<Heartbeat> heartbeats_;
};

TEST_F(LivelinessTest, AKilledNodeIsSeen) {
  auto plant = Peer("plant");
  auto link = Peer("link");
  ASSERT_TRUE(Becomes("plant", "alive"));
  ASSERT_TRUE(Becomes("link", "alive"));
  plant.Signal(SIGKILL);
  ExpectSeenDead("plant", "kill -9");
  EXPECT_TRUE(Becomes("link", "alive"));  // it never left, unless the machine kept it from running
  EXPECT_EQ(heartbeats_.Nodes().size(), 2u);
}

TEST_F(LivelinessTest, AStoppedNodeIsSeenAndComesBack) {
  auto plant = Peer("plant");
  ASSERT_TRUE(Becomes("plant", "alive"));
  plant.Signal(SIGSTOP);
  ExpectSeenDead("plant", "SIGSTOP");
  plant.Signal(SIGCONT);
  EXPECT_TRUE(Becomes("plant", "alive"));
}

TEST_F(LivelinessTest, AHungThreadInALivingProcessIsSeen) {
  auto plant = Peer("plant");
  ASSERT_TRUE(Becomes("plant", "alive"));
  plant.WriteLine("hang");
  ASSERT_EQ(plant.ReadLine(), "ready");
  ASSERT_EQ(plant.ReadLine(), "hanging");
  ExpectSeenDead("plant", "hung thread");
  plant.WriteLine("go on");
  EXPECT_TRUE(Becomes("plant", "alive"));
}

TEST_F(LivelinessTest, ANodeThatLeavesIsSeen) {
  auto plant = Peer("plant");
  ASSERT_TRUE(Becomes("plant", "alive"));
  plant.WriteLine("leave");
  ExpectSeenDead("plant", "left");
  EXPECT_EQ(plant.Wait(), 0);
}

TEST_F(LivelinessTest, HeartbeatsAreTakenBesidesTheStates) {
  auto plant = Peer("plant");
  std::vector<Heartbeat> taken;
  ASSERT_TRUE(condition_.Wait([&] {
    heartbeats_.Nodes();
    for (auto& heartbeat : heartbeats_.Take()) taken.push_back(heartbeat);
    return taken.size() >= 3;
  }));
  for (std::size_t i = 0; i < taken.size(); ++i) {
    EXPECT_EQ(taken[i].node_id, "plant");
    EXPECT_EQ(taken[i].kind, NodeKind::kClient);
    EXPECT_GT(taken[i].sequence, i == 0 ? 0 : taken[i - 1].sequence);
  }
  EXPECT_EQ(heartbeats_.Nodes().at(0).last.pid, taken[0].pid);
}

}  // namespace
}  // namespace tiltproof::dds
