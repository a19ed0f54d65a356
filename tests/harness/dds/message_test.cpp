#include "harness/dds/messages.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <regex>
#include <set>
#include <sstream>

#include "harness/dds/bus.h"
#include "harness/dds/domain_slot.h"
#include "harness/dds/qos.h"
#include "harness/dds/topics.h"
#include "tests/harness/dds/bus_of_tests.h"
#include "tests/harness/dds/condition.h"
#include "tests/harness/dds/peer_process.h"
#include "tests/harness/dds/random_messages.h"

namespace tiltproof::dds {
namespace {

using testing::HasSubstr;

constexpr int kSeed = 20240607;
constexpr int kRandomCount = 40;

// The peer draws the same messages from the same seed: what arrives from there is compared with what is drawn here.
TEST(MessageTest, EveryTypeArrivesAsItWasSent) {
  const DomainSlot slot;
  Bus bus(OnDomain(slot.domain()));
  PeerProcess peer({"send_random", std::to_string(slot.domain()), "test", std::to_string(kSeed),
                    std::to_string(kRandomCount)});
  Random random(kSeed);
  const auto receive = [&]<class T>() {
    SCOPED_TRACE(QosOf<T>().type);
    std::vector<T> expected;
    for (int i = 0; i < kRandomCount; ++i) expected.push_back(RandomMessage<T>(random, i));
    // A log's sequence counts from 1: a message without one is nothing.
    if constexpr (!Log<T>) expected.push_back(T{});
    expected.push_back(LargestMessage<T>());

    Condition condition;
    Subscriber<T> subscriber(bus, condition.Waker());
    std::vector<T> received;
    const bool all = condition.Wait([&] {
      for (auto& message : subscriber.Take()) received.push_back(std::move(message));
      return received.size() >= expected.size();
    });
    EXPECT_TRUE(all) << received.size() << " of " << expected.size();
    // Topics that keep one of each instance may bring instances in any order.
    for (const auto& message : expected) {
      EXPECT_TRUE(std::find(received.begin(), received.end(), message) != received.end());
    }
    EXPECT_EQ(received.size(), expected.size());
  };
#define TILTPROOF_RECEIVE(T, ...) receive.template operator()<T>();
  TILTPROOF_DDS_TOPICS(TILTPROOF_RECEIVE)
#undef TILTPROOF_RECEIVE
  EXPECT_EQ(peer.ReadLine(), "done");
}

TEST(MessageTest, RefusesWhatExceedsALimitAndSaysWhere) {
  const DomainSlot slot;
  Bus bus(OnDomain(slot.domain()));
  const auto error = [&]<class T>(const T& message) {
    Publisher<T> publisher(bus);
    try {
      publisher.Write(message);
    } catch (const std::invalid_argument& e) {
      return std::string(e.what());
    }
    return std::string("no error");
  };

  RunEvent event;
  event.text = std::string(kTextBytesMax + 1, 'x');
  EXPECT_EQ(error(event), "RunEvent.text: 4097 bytes, at most 4096 can be sent");
  event.text = std::string("a\0b", 3);
  EXPECT_THAT(error(event), HasSubstr("RunEvent.text: holds a NUL byte"));

  RunScenario scenario;
  scenario.scenario_yaml = std::string(kDocumentBytesMax + 1, 'x');
  EXPECT_THAT(error(scenario), HasSubstr("RunScenario.scenario_yaml: 262145 bytes"));
  scenario.scenario_yaml.clear();
  scenario.nodes = {"a", std::string(kIdBytesMax + 1, 'x')};
  EXPECT_THAT(error(scenario), HasSubstr("RunScenario.nodes[1]"));

  Records records;
  records.payload.resize(kPayloadBytesMax + 1);
  EXPECT_THAT(error(records), HasSubstr("Records.payload: 1048577 elements"));

  SerialTap tap;
  tap.frames.resize(3);
  tap.frames[2].bytes.resize(kChunkBytesMax + 1);
  EXPECT_EQ(error(tap), "SerialTap.frames[2].bytes: 65537 elements, at most 65536 can be sent");
  tap.frames.resize(kChunksCountMax + 1);
  EXPECT_THAT(error(tap), HasSubstr("SerialTap.frames: 4097 elements"));

  FaultCommand command;
  command.parameters = {{std::string(kIdBytesMax + 1, 'x'), 1}};
  EXPECT_THAT(error(command), HasSubstr("FaultCommand.parameters[0].name: 129 bytes"));

  Heartbeat heartbeat;
  heartbeat.capabilities.resize(kNamesCountMax + 1);
  EXPECT_THAT(error(heartbeat), HasSubstr("Heartbeat.capabilities: 129 elements"));
}

TEST(MessageTest, PublisherGoesOnAfterARefusedMessage) {
  const DomainSlot slot;
  Bus bus(OnDomain(slot.domain()));
  Condition condition;
  Subscriber<Score> subscriber(bus, condition.Waker());
  Publisher<Score> publisher(bus);
  Score score;
  score.verdict = std::string(kIdBytesMax + 1, 'x');
  EXPECT_THROW(publisher.Write(score), std::invalid_argument);
  score.verdict = "pass";
  EXPECT_TRUE(publisher.Write(score));
  EXPECT_TRUE(condition.Wait([&] { return subscriber.Take() == std::vector{score}; }));
}

std::string SnakeCase(const std::string& name) {
  std::string snake;
  for (const char c : name) {
    if (std::isupper(static_cast<unsigned char>(c)) != 0 && !snake.empty()) snake += '_';
    snake += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return snake;
}

// The interface file is what others read: it must tell the truth about the table.
TEST(MessageTest, TableAndInterfaceFileAgree) {
  std::ifstream file(TILTPROOF_SOURCE_DIR "/harness/dds/tiltproof.idl");
  std::stringstream text;
  text << file.rdbuf();
  const auto idl = text.str();
  const auto rows = TopicTable();
  std::set<std::string> types;
  for (const auto& row : rows) {
    EXPECT_EQ(row.topic, "tiltproof/" + SnakeCase(row.type));
    EXPECT_TRUE(types.insert(row.type).second);
    EXPECT_THAT(row.qos, HasSubstr("RELIABLE"));
    // The comment above the struct names the class.
    std::smatch match;
    const std::regex comment("QoS: ([a-z]+)[^@{]*@(?:final|appendable) struct " + row.type + " \\{");
    ASSERT_TRUE(std::regex_search(idl, match, comment)) << row.type;
    const std::string qos_class = match[1];
    const bool latecomers = row.qos.find("TRANSIENT_LOCAL") != std::string::npos;
    const bool keep_all = row.qos.find("KEEP_ALL") != std::string::npos;
    EXPECT_EQ(latecomers, qos_class == "standing" || row.type == "RunEvent") << row.type;
    EXPECT_EQ(keep_all, qos_class == "log" || qos_class == "order") << row.type;
    EXPECT_EQ(row.qos.find("each sequence once") != std::string::npos, qos_class == "log") << row.type;
  }
  EXPECT_EQ(types.size(), 15u);
}

}  // namespace
}  // namespace tiltproof::dds
