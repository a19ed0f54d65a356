// Who takes part in a run, and who is lost, by what is heard of them.
#include "harness/run/realtime/members.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tiltproof::harness {
namespace {

using dds::NodeKind;
using dds::NodeLife;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

NodeLife Node(const std::string& id, NodeKind kind) {
  NodeLife node;
  node.last.version = TILTPROOF_VERSION;
  node.last.node_id = id;
  node.last.kind = kind;
  node.last.host = "here";
  node.alive = true;
  std::copy(id.begin(), id.end(), node.participant.guid.begin());
  return node;
}

std::vector<NodeLife> Fleet() {
  return {Node("base_station", NodeKind::kBaseStation), Node("client", NodeKind::kClient),
          Node("harness", NodeKind::kHarness),          Node("link", NodeKind::kLink),
          Node("monitor", NodeKind::kMonitor),          Node("plant", NodeKind::kPlant)};
}
NodeLife& Of(std::vector<NodeLife>& nodes, NodeKind kind) {
  return *std::find_if(nodes.begin(), nodes.end(),
                       [&](const NodeLife& node) { return node.last.kind == kind; });
}

std::string Missing(const std::vector<NodeLife>& nodes, bool board = false) {
  Members members;
  std::string missing;
  const bool complete = members.Adopt(nodes, nullptr, {{.id = {}, .has_node = !board}}, {}, "run", missing);
  EXPECT_EQ(complete, missing.empty());
  return missing;
}

TEST(Adopt, TakesOneOfEachAndNoOnlookers) {
  Members members;
  std::string missing;
  ASSERT_TRUE(members.Adopt(Fleet(), nullptr, {{}}, {}, "run", missing));
  std::vector<std::string> ids;
  for (const Member& member : members.all()) ids.push_back(member.id);
  EXPECT_THAT(ids, ElementsAre("base_station", "client", "link", "plant"));
  EXPECT_EQ(members.Find(NodeKind::kLink)->id, "link");
  EXPECT_EQ(members.Find(NodeKind::kJoystick), nullptr);
  EXPECT_EQ(members.reference_sender().id, "base_station");
  EXPECT_NO_THROW(members.CheckHosts());
}

TEST(Adopt, SaysWhatIsNotThere) {
  EXPECT_EQ(Missing({}),
            "plant node and no link node and no client node and no base-station or joystick node");
  auto nodes = Fleet();
  Of(nodes, NodeKind::kClient).alive = false;
  EXPECT_EQ(Missing(nodes), "client node");
  // A board hangs on the link's port: told by the harness, or by the link.
  EXPECT_EQ(Missing(nodes, true), "");
  Of(nodes, NodeKind::kLink).last.capabilities = {"scheduling=fifo", "client=serial"};
  EXPECT_EQ(Missing(nodes), "");
}

TEST(Adopt, TakesNoNodeOfAnotherVersion) {
  auto nodes = Fleet();
  Of(nodes, NodeKind::kLink).last.version = "0.0.7";
  EXPECT_EQ(Missing(nodes), "node of this version " TILTPROOF_VERSION ": link has version 0.0.7");
}

TEST(Adopt, TakesNoneOfAnotherRun) {
  auto nodes = Fleet();
  Of(nodes, NodeKind::kPlant).last.run_id = "other";
  EXPECT_EQ(Missing(nodes), "free node: plant is in another run");
  Of(nodes, NodeKind::kPlant).last.run_id = "run";
  EXPECT_EQ(Missing(nodes), "");
}

// A second one of a kind, or of a name, is ignored, and named once.
TEST(Adopt, TakesTheFirstOfAKindAndNamesTheOthersOnce) {
  auto nodes = Fleet();
  nodes.push_back(Node("plant-2", NodeKind::kPlant));
  nodes.push_back(Node("quad_joystick", NodeKind::kJoystick));
  nodes.push_back(Node("link", NodeKind::kLink));
  nodes.back().participant.guid[15] = 1;
  nodes.push_back(Node("plant-3", NodeKind::kPlant));
  nodes.back().last.run_id = "other";
  Members members;
  std::string missing;
  ASSERT_TRUE(members.Adopt(nodes, nullptr, {{}}, {}, "run", missing));
  EXPECT_EQ(members.Find(NodeKind::kPlant)->id, "plant");
  EXPECT_EQ(members.reference_sender().id, "base_station");
  EXPECT_EQ(members.all().size(), 4u);
  EXPECT_THAT(members.NewStrangers(nodes, "run"),
              ElementsAre("the plant node plant-2 on here (process 0) is ignored: this flight has plant",
                          "the joystick node quad_joystick on here (process 0) is ignored: this flight has "
                          "base_station",
                          "the link node link on here (process 0) is ignored: this flight has link"));
  EXPECT_THAT(members.NewStrangers(nodes, "run"), IsEmpty());
  // One in whose place another process came is no stranger.
  Member& plant = members.all().back();
  const auto before = plant.participant;
  members.Replace(plant, "plant-4", Node("plant-4", NodeKind::kPlant).participant);
  EXPECT_NE(plant.participant, before);
  EXPECT_THAT(members.NewStrangers(nodes, "run"), IsEmpty());
}

// Each of several clients has a client node and a link node, known by the id that they tell.
TEST(Adopt, TakesTheNodesOfEachClient) {
  const auto of = [](NodeLife node, const std::string& id) {
    node.last.capabilities.push_back("id=" + id);
    return node;
  };
  std::vector<NodeLife> nodes = {
      Node("base_station", NodeKind::kBaseStation), of(Node("c1", NodeKind::kClient), "b"),
      of(Node("c2", NodeKind::kClient), "a"),       Node("c3", NodeKind::kClient),
      of(Node("l1", NodeKind::kLink), "a"),         Node("plant", NodeKind::kPlant)};
  Members members;
  std::string missing;
  const std::vector<SoughtClient> clients = {{.id = "a"}, {.id = "b"}};
  EXPECT_FALSE(members.Adopt(nodes, nullptr, clients, {}, "run", missing));
  EXPECT_EQ(missing, "link node of client b (--id b)");
  nodes.push_back(of(Node("l2", NodeKind::kLink), "b"));
  nodes.push_back(of(Node("l3", NodeKind::kLink), "b"));
  ASSERT_TRUE(members.Adopt(nodes, nullptr, clients, {}, "run", missing)) << missing;
  EXPECT_EQ(members.Find(NodeKind::kClient, 0)->id, "c2");
  EXPECT_EQ(members.Find(NodeKind::kClient, 1)->part, "client-b");
  EXPECT_EQ(members.Find(NodeKind::kLink, 1)->id, "l2");
  EXPECT_EQ(members.all().size(), 6u);
  EXPECT_THAT(members.NewStrangers(nodes, "run"),
              ElementsAre("the link node l3 on here (process 0) is ignored: this flight has l2"));
  // A board on the cables of one link node has no node of its own.
  nodes.erase(nodes.begin() + 1);
  nodes[5].last.capabilities.push_back("client=serial");
  EXPECT_TRUE(members.Adopt(nodes, nullptr, clients, {}, "run", missing)) << missing;
}

// Each line between clients has a node, known by the line's id. Its ends have devices where the clients have cables.
TEST(Adopt, TakesTheNodeOfEachLine) {
  const auto of = [](NodeLife node, const std::string& id) {
    node.last.capabilities.push_back("id=" + id);
    return node;
  };
  std::vector<NodeLife> nodes = {Node("base_station", NodeKind::kBaseStation),
                                 of(Node("c1", NodeKind::kClient), "a"),
                                 of(Node("c2", NodeKind::kClient), "b"),
                                 of(Node("l1", NodeKind::kLink), "a"),
                                 of(Node("l2", NodeKind::kLink), "b"),
                                 of(Node("n1", NodeKind::kLine), "other"),
                                 Node("n2", NodeKind::kLine),
                                 Node("plant", NodeKind::kPlant)};
  Members members;
  std::string missing;
  const auto adopt = [&] {
    return members.Adopt(nodes, nullptr, {{.id = "a"}, {.id = "b"}}, {{.id = "cross", .clients = {0, 1}}},
                         "run", missing);
  };
  EXPECT_FALSE(adopt());
  EXPECT_EQ(missing, "line node of cross (--id cross)");
  nodes.push_back(of(Node("n3", NodeKind::kLine), "cross"));
  ASSERT_TRUE(adopt()) << missing;
  EXPECT_EQ(members.Find(NodeKind::kLine)->part, "line-cross");
  EXPECT_EQ(members.all().size(), 7u);
  EXPECT_NO_THROW(members.CheckHosts());

  const auto complaint = [&]() -> std::string {
    EXPECT_TRUE(adopt()) << missing;
    try {
      members.CheckHosts();
    } catch (const std::exception& error) {
      return error.what();
    }
    return "none";
  };
  nodes.back().last.host = "there";
  EXPECT_THAT(complaint(), HasSubstr("the line-cross node runs on there and the link-a node on here"));
  nodes.back().last.host = "here";
  nodes.back().last.capabilities.push_back("end1=serial");
  EXPECT_EQ(complaint(),
            "the node c2 has no cables, and n3 has a device for its end of the line: put - in its place in "
            "--cable");
  for (const std::size_t cabled : {2, 4}) nodes[cabled].last.capabilities.push_back("cable=serial");
  nodes[2].last.host = "there";
  EXPECT_EQ(complaint(), "none");
  nodes.back().last.capabilities.pop_back();
  EXPECT_EQ(
      complaint(),
      "the node c2 has cables, and n3 has no device for its end of the line: give it --cable DEV,DEV, in the "
      "order of `between`");
}

// A client node at the far end of serial cables may be on any host; both nodes must have their ends.
TEST(CheckHosts, TakesAClientOfAnotherHostAtTheFarEndOfItsCables) {
  auto nodes = Fleet();
  NodeLife& client = Of(nodes, NodeKind::kClient);
  NodeLife& link = Of(nodes, NodeKind::kLink);
  client.last.host = "there";
  const auto complaint = [&]() -> std::string {
    Members members;
    std::string missing;
    EXPECT_TRUE(members.Adopt(nodes, nullptr, {{}}, {}, "run", missing)) << missing;
    try {
      members.CheckHosts();
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(complaint(), HasSubstr("they share a serial line, so both must run on one host"));
  client.last.capabilities = {"cable=serial"};
  EXPECT_EQ(complaint(),
            "the nodes client and link are the ends of one line, and link has no cable: give both --cable, "
            "or none");
  link.last.capabilities = {"cable=serial"};
  EXPECT_EQ(complaint(), "");
  client.last.capabilities.clear();
  EXPECT_THAT(complaint(), HasSubstr("and client has no cable"));
}

TEST(Adopt, NamesAFewStrangersAlone) {
  auto nodes = Fleet();
  for (char c = 'a'; c <= 'z'; ++c) nodes.push_back(Node(std::string("x") + c, NodeKind::kPlant));
  Members members;
  std::string missing;
  ASSERT_TRUE(members.Adopt(nodes, nullptr, {{}}, {}, "run", missing));
  EXPECT_EQ(members.NewStrangers(nodes, "run").size(), Members::kStrangersMax);
}

TEST(CheckHosts, ThoseOnOneSerialLineShareAHost) {
  auto nodes = Fleet();
  Of(nodes, NodeKind::kBaseStation).last.host = "there";
  Members members;
  std::string missing;
  ASSERT_TRUE(members.Adopt(nodes, nullptr, {{}}, {}, "run", missing));
  EXPECT_NO_THROW(members.CheckHosts());
  Of(nodes, NodeKind::kClient).last.host = "there";
  ASSERT_TRUE(members.Adopt(nodes, nullptr, {{}}, {}, "run", missing));
  try {
    members.CheckHosts();
    ADD_FAILURE();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("client node runs on there and the link node on here"));
  }
}

// Attached nodes: no process to look at.
class WatchTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string missing;
    ASSERT_TRUE(members_.Adopt(nodes_, nullptr, {{}}, {}, "run", missing));
  }
  std::vector<MemberChange> Watch(const std::set<std::string>& excused = {}) {
    return members_.Watch(nodes_, nullptr, excused, {}, now_);
  }
  std::chrono::steady_clock::time_point now_{std::chrono::hours(1)};
  std::vector<NodeLife> nodes_ = Fleet();
  Members members_;
};

TEST_F(WatchTest, ACutOffNodeIsSilentThenBack) {
  EXPECT_THAT(Watch(), IsEmpty());
  EXPECT_FALSE(members_.AnySilent());
  Of(nodes_, NodeKind::kPlant).alive = false;
  auto changes = Watch();
  ASSERT_EQ(changes.size(), 1u);
  EXPECT_EQ(changes[0].kind, MemberChange::Kind::kSilent);
  EXPECT_EQ(changes[0].role, "plant");
  EXPECT_TRUE(members_.AnySilent());
  EXPECT_THAT(Watch(), IsEmpty());
  now_ += Members::kPartitionLimit;
  EXPECT_THAT(Watch(), IsEmpty());
  Of(nodes_, NodeKind::kPlant).alive = true;
  changes = Watch();
  ASSERT_EQ(changes.size(), 1u);
  EXPECT_EQ(changes[0].kind, MemberChange::Kind::kBack);
  EXPECT_FALSE(members_.AnySilent());
  EXPECT_THAT(Watch(), IsEmpty());
}

TEST_F(WatchTest, AFirmwaresNodeThatStaysAwayIsLostOnceAndForAll) {
  Of(nodes_, NodeKind::kClient).alive = false;
  EXPECT_EQ(Watch().size(), 1u);
  const auto silent_at = now_;
  now_ += Members::kPartitionLimit + std::chrono::milliseconds(1);
  const auto changes = Watch();
  ASSERT_EQ(changes.size(), 1u);
  EXPECT_EQ(changes[0].kind, MemberChange::Kind::kLost);
  EXPECT_TRUE(changes[0].firmware);
  // Its lease of 200 ms was over then.
  EXPECT_EQ(changes[0].heard_last, silent_at - std::chrono::milliseconds(200));
  EXPECT_THAT(changes[0].text, HasSubstr("the firmware under test is lost: its node client was not heard"));
  EXPECT_FALSE(members_.AnySilent());
  Of(nodes_, NodeKind::kClient).alive = true;
  EXPECT_THAT(Watch(), IsEmpty());
}

// The emulator or program beside it is the firmware's; the node is ours.
TEST_F(WatchTest, NoFirmwareIsBlamedForTheNodeOfAnotherProcess) {
  for (const char* client : {"client=qemu", "client=process"}) {
    now_ = {};
    members_ = Members();
    nodes_ = Fleet();
    Of(nodes_, NodeKind::kClient).last.capabilities = {client};
    SetUp();
    Of(nodes_, NodeKind::kClient).alive = false;
    EXPECT_EQ(Watch().size(), 1u);
    now_ += Members::kPartitionLimit + std::chrono::milliseconds(1);
    const auto changes = Watch();
    ASSERT_EQ(changes.size(), 1u);
    EXPECT_EQ(changes[0].kind, MemberChange::Kind::kLost);
    EXPECT_FALSE(changes[0].firmware) << client;
  }
}

// With others it is its host that is cut off, and with one of ours it is ours.
TEST_F(WatchTest, NoFirmwareIsBlamedWhenOthersAreSilentToo) {
  for (const NodeKind kind : {NodeKind::kLink, NodeKind::kClient}) Of(nodes_, kind).alive = false;
  EXPECT_EQ(Watch().size(), 2u);
  now_ += Members::kPartitionLimit + std::chrono::milliseconds(1);
  for (const MemberChange& change : Watch()) {
    EXPECT_EQ(change.kind, MemberChange::Kind::kLost);
    EXPECT_FALSE(change.firmware) << change.text;
  }
}

// A node that a fault keeps silent proves nothing about the other nodes of its host.
TEST_F(WatchTest, AFirmwareIsBlamedWhileAFaultKeepsAnotherNodeAway) {
  for (const NodeKind kind : {NodeKind::kBaseStation, NodeKind::kClient}) Of(nodes_, kind).alive = false;
  EXPECT_EQ(Watch({"base_station"}).size(), 2u);
  now_ += Members::kPartitionLimit + std::chrono::milliseconds(1);
  bool blamed = false;
  for (const MemberChange& change : Watch({"base_station"})) blamed |= change.firmware;
  EXPECT_TRUE(blamed);
  EXPECT_FALSE(members_.AnySilent());
}

TEST_F(WatchTest, WhoIsNoMemberDoesNotMatter) {
  for (const NodeKind kind : {NodeKind::kMonitor, NodeKind::kHarness}) Of(nodes_, kind).alive = false;
  EXPECT_THAT(Watch(), IsEmpty());
}

}  // namespace
}  // namespace tiltproof::harness
