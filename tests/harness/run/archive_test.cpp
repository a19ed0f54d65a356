// Structs as bytes between processes: nothing is lost on the way, and bytes that are no such struct do no harm.
#include "harness/run/remote/archive.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "harness/run/remote/protocol.h"

namespace tiltproof::harness {
namespace {

using Bytes = std::vector<std::uint8_t>;

template <class T>
Bytes Packed(const T& value) {
  Packer packer;
  packer(value);
  return {packer.bytes().begin(), packer.bytes().end()};
}

template <class Time>
link::TimedChunk<Time> SomeChunk(Time begin_ns) {
  return {begin_ns, {0x7E, 1, 2, 3, 0x7E}, link::MessageKind::kReply, 77};
}

faults::Activation SomeActivation() {
  return {-5, 3, "2 bits flipped", {SomeChunk(TimeNs{10})}, {SomeChunk(TimeNs{11}), SomeChunk(TimeNs{12})}};
}

LineLog SomeLineLog() {
  LineLog log;
  log.link.Append(SomeChunk(BootTime(100)), {1, link::Direction::kToClient}, false);
  log.link.Append(SomeChunk(BootTime(200)), {1, link::Direction::kReference}, true);
  log.reply_latency_ns = {1, kNever};
  log.client_round_trip_ns = {3};
  log.events = {{BootTime(4), "rejected", "to_plant: bad_checksum"}, {BootTime(-5), "", ""}};
  log.activations = {SomeActivation(), {}};
  log.activation_counts = {0, 8};
  log.counts[1] = {9, 10, 11, 12};
  log.accepted_wrong_count = 13;
  log.accepted_stale_count = 14;
  log.resync_max_ns = 15;
  return log;
}

PlantLog SomePlantLog() {
  PlantLog log;
  log.rows = {0.1, -0.0, 1e300};
  log.hover_input = {1, 2, 3, 4};
  log.input_min = {5, 6, 7, 8};
  log.input_max = {9, 10, 11, 12};
  log.clients[0].starts_accepted_count = 13;
  log.clients[0].request_times_ns = {14, 15};
  log.clients[0].actuator_times_ns = {16};
  log.events = {{17, "start_accepted", "t = 0"}};
  log.activations = {SomeActivation()};
  log.activation_counts = {18};
  return log;
}

PlantServer::State SomeState() {
  PlantServer::State state;
  state.origin = Origin(BootTime(1));
  state.reached_ns = 2;
  state.quiet_until_ns = BootTime(3);
  state.over = true;
  state.end_reason = EndReason::kGroundStrike;
  state.end_text = "struck the ground";
  return state;
}

// One of each struct that goes between processes: calls visit(value).
template <class Visit>
void ForEachStruct(const Visit& visit) {
  LineView view;
  view.next_arrival_ns = {BootTime(1), BootTime::Never(), BootTime::Earliest()};
  view.counts[2] = {4, 5, 6, 7};
  visit(Setup{"name: x\n", "library:/lib/firmware.so"});
  visit(DeviceEvent{BootTime(12), 3, "bit_flipped", "0x20000000: 0x00 -> 0x01", 2});
  visit(view);
  visit(ClientStatus{1, 2});
  visit(std::optional<ClientStatus>{});
  visit(std::optional<ClientStatus>{{3, 4}});
  visit(RunEvent{-1, "kind", std::string("with\0NUL", 8)});
  visit(BootEvent{BootTime(-1), "kind", "text"});
  visit(Origin());
  visit(Origin(BootTime(7)));
  visit(SomeState());
  visit(SomeChunk(TimeNs{-9}));
  visit(SomeChunk(BootTime(-9)));
  visit(SomeActivation());
  visit(SomePlantLog());
  visit(SomeLineLog());
  visit(std::vector<Bytes>{{}, {1, 2}});
}

TEST(Archive, EveryStructComesBackAsItWas) {
  ForEachStruct([]<class T>(const T& value) {
    const Bytes bytes = Packed(value);
    // Same bytes, same members; a field that no list names does not compile.
    EXPECT_EQ(Packed(Unpacker(bytes).Next<T>()), bytes);
  });
}

TEST(Archive, EveryMemberOfALogComesBack) {
  const LineLog line = Unpacker(Packed(SomeLineLog())).Next<LineLog>();
  EXPECT_EQ(line.link.content(), SomeLineLog().link.content());
  EXPECT_EQ(line.reply_latency_ns, (std::vector<TimeNs>{1, kNever}));
  EXPECT_EQ(line.client_round_trip_ns, (std::vector<TimeNs>{3}));
  ASSERT_EQ(line.events.size(), 2u);
  EXPECT_EQ(line.events[0].text, "to_plant: bad_checksum");
  ASSERT_EQ(line.activations.size(), 2u);
  EXPECT_EQ(line.activations[0].fault, 3u);
  EXPECT_EQ(line.activations[0].what, "2 bits flipped");
  ASSERT_EQ(line.activations[0].after.size(), 2u);
  EXPECT_EQ(line.activations[0].after[1].begin_ns, 12);
  EXPECT_EQ(line.activations[0].after[1].bytes, SomeChunk(TimeNs{0}).bytes);
  EXPECT_EQ(line.activations[0].after[1].kind, link::MessageKind::kReply);
  EXPECT_EQ(line.activations[0].after[1].number, 77u);
  EXPECT_EQ(line.activation_counts, (std::vector<std::int64_t>{0, 8}));
  EXPECT_EQ(line.counts[1].bytes_corrupted, 12);
  EXPECT_EQ(line.accepted_wrong_count, 13);
  EXPECT_EQ(line.accepted_stale_count, 14);
  EXPECT_EQ(line.resync_max_ns, 15);

  const PlantLog plant = Unpacker(Packed(SomePlantLog())).Next<PlantLog>();
  EXPECT_EQ(plant.rows, SomePlantLog().rows);
  EXPECT_EQ(plant.hover_input, SomePlantLog().hover_input);
  EXPECT_EQ(plant.input_min, SomePlantLog().input_min);
  EXPECT_EQ(plant.input_max, SomePlantLog().input_max);
  EXPECT_EQ(plant.clients[0].starts_accepted_count, 13);
  EXPECT_EQ(plant.clients[0].request_times_ns, (std::vector<TimeNs>{14, 15}));
  EXPECT_EQ(plant.clients[0].actuator_times_ns, (std::vector<TimeNs>{16}));
  EXPECT_EQ(plant.events.at(0).kind, "start_accepted");
  EXPECT_EQ(plant.activations.size(), 1u);
  EXPECT_EQ(plant.activation_counts, (std::vector<std::int64_t>{18}));

  const auto state = Unpacker(Packed(SomeState())).Next<PlantServer::State>();
  EXPECT_EQ(state.origin, Origin(BootTime(1)));
  EXPECT_EQ(state.reached_ns, 2);
  EXPECT_EQ(state.quiet_until_ns, BootTime(3));
  EXPECT_TRUE(state.over);
  EXPECT_EQ(state.end_reason, EndReason::kGroundStrike);
  EXPECT_EQ(state.end_text, "struck the ground");
}

TEST(Archive, CutBytesThrow) {
  ForEachStruct([]<class T>(const T& value) {
    const Bytes bytes = Packed(value);
    for (std::size_t size = 0; size < bytes.size(); ++size)
      EXPECT_THROW(Unpacker(std::span(bytes).first(size)).Next<T>(), std::runtime_error) << size;
  });
}

TEST(Archive, DamagedBytesAreAnotherStructOrThrow) {
  std::mt19937 random(1);
  ForEachStruct([&]<class T>(const T& value) {
    const Bytes whole = Packed(value);
    for (int turn = 0; turn < 2000; ++turn) {
      Bytes bytes = whole;
      for (int i = 0; i < 3; ++i) bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
      try {
        Unpacker(bytes).Next<T>();
      } catch (const std::runtime_error&) {
        // Nothing else: std::length_error or std::bad_alloc would be a size believed.
      }
    }
  });
}

TEST(Archive, AByteThatIsNoBoolIsRefused) {
  EXPECT_TRUE(Unpacker(Bytes{1}).Next<bool>());
  EXPECT_FALSE(Unpacker(Bytes{0}).Next<bool>());
  EXPECT_THROW(Unpacker(Bytes{2}).Next<bool>(), std::runtime_error);
}

int made = 0;
struct Counted {
  Counted() { ++made; }
  std::int64_t value = 0;
  TILTPROOF_FIELDS(value)
};

TEST(Archive, ADamagedCountMakesNoMoreElementsThanThereAreBytesFor) {
  Packer packer;
  packer(std::size_t{800}, std::vector<std::uint8_t>(800));
  made = 0;
  EXPECT_THROW(Unpacker(packer.bytes()).Next<std::vector<Counted>>(), std::runtime_error);
  EXPECT_LE(made, 102);
  packer = {};
  packer(~std::size_t{0}, std::int64_t{1});
  EXPECT_THROW(Unpacker(packer.bytes()).Next<std::vector<Counted>>(), std::runtime_error);
  EXPECT_THROW(Unpacker(packer.bytes()).Next<std::vector<double>>(), std::runtime_error);
  EXPECT_THROW(Unpacker(packer.bytes()).Next<std::string>(), std::runtime_error);
}

}  // namespace
}  // namespace tiltproof::harness
