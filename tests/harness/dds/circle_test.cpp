// Who is heard: a process outside the circle that says the same under the same name changes nothing.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>

#include "harness/dds/bus.h"
#include "harness/dds/domain_slot.h"
#include "tests/harness/dds/condition.h"
#include "tests/harness/dds/peer_process.h"

namespace tiltproof::dds {
namespace {

using testing::Each;
using testing::Field;
using testing::IsEmpty;
using testing::SizeIs;

class CircleTest : public testing::Test {
 protected:
  CircleTest()
      : bus_(Config(slot_.domain())),
        heartbeats_(bus_, condition_.Waker(), condition_.Waker()),
        acks_(bus_, circle_, condition_.Waker()),
        states_(bus_, circle_, condition_.Waker()),
        events_(bus_, circle_, condition_.Waker()),
        all_acks_(bus_, condition_.Waker()) {}

  static BusConfig Config(int domain) {
    BusConfig config;
    config.domain = domain;
    config.tag = "test";
    return config;
  }
  // A process that speaks under that name, and is heard by who hears everybody.
  struct Speaker {
    std::unique_ptr<PeerProcess> process;
    std::string text;
    Participant participant;
  };
  Speaker Start(const std::string& node_id) {
    const auto domain = std::to_string(slot_.domain());
    Speaker speaker;
    speaker.process.reset(new PeerProcess({"speak", domain, "test", node_id}));
    speaker.text = speaker.process->ReadLine();
    speaker.participant = ParticipantNamed(speaker.text).value();
    return speaker;
  }
  void Tell(Speaker& speaker, const std::string& line) {
    speaker.process->WriteLine(line);
    ASSERT_EQ(speaker.process->ReadLine(), "done");
  }
  // Says it, until it arrives where all are heard; everything else that it said has then arrived, too, or soon does.
  void Say(Speaker& speaker) {
    ASSERT_TRUE(condition_.Wait([&] { return all_acks_.Hears(speaker.participant); }));
    Tell(speaker, "speak");
    bool came = false;
    ASSERT_TRUE(condition_.Wait([&] {
      for (const auto& [sender, ack] : all_acks_.TakeWithSenders())
        came = came || (sender == speaker.participant && ack.text == speaker.text);
      return came;
    }));
  }

  DomainSlot slot_;
  Condition condition_;
  Circle circle_;
  Bus bus_;
  Subscriber<Heartbeat> heartbeats_;
  Subscriber<RunAck> acks_;
  Subscriber<RunState> states_;
  Subscriber<RunEvent> events_;
  Subscriber<RunAck> all_acks_;
};

TEST_F(CircleTest, AParticipantHasOneNameForAll) {
  auto plant = Start("plant");
  EXPECT_NE(plant.participant, bus_.participant());
  EXPECT_EQ(ParticipantNamed(ToText(bus_.participant())), bus_.participant());
  ASSERT_TRUE(condition_.Wait([&] {
    Tell(plant, "speak");
    return heartbeats_.Nodes().size() == 1;
  }));
  EXPECT_EQ(heartbeats_.Nodes()[0].participant, plant.participant);
  EXPECT_EQ(ParticipantNamed("0123"), std::nullopt);
  EXPECT_EQ(ParticipantNamed(std::string(32, 'x')), std::nullopt);
}

TEST_F(CircleTest, WhoIsOutsideIsNotHeardAndDisplacesNothing) {
  auto plant = Start("plant"), impostor = Start("plant");
  circle_.Admit(plant.participant, "plant");
  Say(plant);
  // All of these topics but the events keep one message of an instance, and the impostor's comes later.
  Say(impostor);
  Tell(impostor, "dispose");
  std::vector<RunAck> acks;
  std::vector<RunState> states;
  std::vector<RunEvent> events;
  ASSERT_TRUE(condition_.Wait([&] {
    for (auto& ack : acks_.Take()) acks.push_back(ack);
    for (auto& state : states_.Take()) states.push_back(state);
    for (auto& event : events_.Take()) events.push_back(event);
    return !acks.empty() && !states.empty() && !events.empty();
  }));
  EXPECT_THAT(acks, SizeIs(1));
  EXPECT_THAT(acks, Each(Field(&RunAck::text, plant.text)));
  EXPECT_THAT(states, Each(Field(&RunState::text, plant.text)));
  EXPECT_THAT(events, Each(Field(&RunEvent::text, plant.text)));
  EXPECT_EQ(events_.CompleteUpTo("run", "plant"), 1);

  // Expelled, it is not heard any more, and the other, admitted, is.
  circle_.Expel(plant.participant);
  circle_.Admit(impostor.participant, "plant");
  Say(plant);
  Say(impostor);
  acks.clear();
  ASSERT_TRUE(condition_.Wait([&] {
    for (auto& ack : acks_.Take()) acks.push_back(ack);
    return !acks.empty();
  }));
  EXPECT_THAT(acks, Each(Field(&RunAck::text, impostor.text)));
}

TEST_F(CircleTest, AMemberSpeaksForItselfAlone) {
  auto plant = Start("plant");
  circle_.Admit(plant.participant, "link");
  Say(plant);
  // The link's message arrives after the plant's, which would already be here if it were heard.
  auto link = Start("link");
  circle_.Admit(link.participant, "link");
  Say(link);
  std::vector<RunAck> acks;
  ASSERT_TRUE(condition_.Wait([&] {
    for (auto& ack : acks_.Take()) acks.push_back(ack);
    return !acks.empty();
  }));
  EXPECT_THAT(acks, Each(Field(&RunAck::text, link.text)));
}

TEST_F(CircleTest, TwoOfOneNameLiveTheirOwnLives) {
  auto plant = Start("plant"), impostor = Start("plant");
  const auto alive = [&](const Speaker& speaker) {
    for (const auto& node : heartbeats_.Nodes())
      if (node.participant == speaker.participant) return node.alive ? "alive" : "dead";
    return "unknown";
  };
  ASSERT_TRUE(condition_.Wait([&] {
    Tell(plant, "speak");
    Tell(impostor, "speak");
    return heartbeats_.Nodes().size() == 2;
  }));
  // They do not beat any more: both miss their leases. Then one beats again.
  ASSERT_TRUE(condition_.Wait([&] { return alive(plant) == std::string("dead"); }));
  ASSERT_TRUE(condition_.Wait([&] { return alive(impostor) == std::string("dead"); }));
  ASSERT_TRUE(condition_.Wait([&] {
    Tell(plant, "speak");
    return alive(plant) == std::string("alive") && alive(impostor) == std::string("dead");
  }));
}

TEST_F(CircleTest, KnowsWhichParticipantListens) {
  Publisher<RunCommand> commands(bus_, condition_.Waker());
  auto plant = Start("plant");
  ASSERT_TRUE(condition_.Wait([&] { return acks_.Hears(plant.participant); }));
  EXPECT_FALSE(commands.IsHeardBy(plant.participant));
  EXPECT_FALSE(acks_.Hears(bus_.participant()));
  const Subscriber<RunCommand> of_ours(bus_);
  EXPECT_TRUE(condition_.Wait([&] { return commands.IsHeardBy(bus_.participant()); }));
  plant.process->WriteLine("");
  EXPECT_TRUE(condition_.Wait([&] { return !acks_.Hears(plant.participant); }));
}

}  // namespace
}  // namespace tiltproof::dds
