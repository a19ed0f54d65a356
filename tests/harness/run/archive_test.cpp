// Structs as bytes between processes: nothing is lost on the way, and bytes that are no such struct do no harm.
#include "harness/run/archive.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "harness/run/remote/protocol.h"
#include "tests/harness/run/kept_records.h"

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
  return {begin_ns, {0x7E, 1, 2, 3, 0x7E}, 3, 77};
}

faults::Activation SomeActivation() {
  return {-5, 3, "2 bits flipped", {SomeChunk(TimeNs{10})}, {SomeChunk(TimeNs{11}), SomeChunk(TimeNs{12})}};
}

// One record of each kind.
std::vector<Record> SomeRecords() {
  FirmwareUse use{.processors = "a boot 0-1", .processors_count = 2};
  use.spans = {{BootTime(1), BootTime(2), 3, 4}};
  return {
      {-1, {}, record::Row{{0.1, -0.0, 1e300}}},
      {2, 1, record::Bytes{link::Direction::kReference, ByteSide::kPassedOn, {0x7E, 1, 2}}},
      {3, 0, record::Counters{LineCounts{{{1, 2, 3, 4}, {5, 6, 7, 8}, {9, 10, 11, 12}}}}},
      {4, {}, record::Event{"kind", std::string("with\0NUL", 8)}},
      {5, 0, record::FirmwareText{"text"}},
      {6, 0, record::Accepted{record::AcceptedKind::kActuators}},
      {7, 0, record::Reply{kNever}},
      {8, 0, record::Answer{-5}},
      {9, 0, record::State{7}},
      {9, 0, record::Role{1}},
      {10, 0, record::Watched{{1, 2}}},
      {-5, 0, SomeActivation()},
      {12, 0, record::ActivationCounts{{0, 8}}},
      {13, {}, record::Late{14, record::LateKind::kBoard, "a boot 0-1"}},
      {15, {}, record::PlantEnd{{1, 2}, {3, 4}, {5, 6}, {7}, RedundancyTotals{1, 2, 0.5, 3, {}}}},
      {16, 0, record::LineEnd{LineCounts{{{1, 2, 3, 4}}}, 13, 14, 15}},
      {17, 0,
       record::ClientEnd{
           18, {}, 21, {"CRYP"}, {{"main", 19, 20, true}}, FirmwareEnd{}, ClientLoss{1, true, "hung", {}}}},
      {18, 0, record::FirmwareTime{use, Origin(BootTime(9))}},
      {19, {}, record::End{EndReason::kGroundStrike, "struck the ground", FirmwareEnd{}, 0.5}},
  };
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
  visit(std::vector<faults::DeviceCommand>{{1, 2, 3, faults::ResetProcessor{}},
                                           {4, 5, 6, faults::FlipBits{"ram", 7, 8}},
                                           {9, kNever, 10, faults::DriftClock{1.5}}});
  visit(DeviceEvent{BootTime(12), 3, "bit_flipped", "0x20000000: 0x00 -> 0x01", 2});
  visit(view);
  visit(ClientStatus{1, 2});
  visit(std::optional<ClientStatus>{});
  visit(std::optional<ClientStatus>{{3, 4}});
  visit(RunEvent{-1, "kind", std::string("with\0NUL", 8)});
  visit(Origin());
  visit(Origin(BootTime(7)));
  visit(SomeState());
  visit(SomeChunk(TimeNs{-9}));
  visit(SomeChunk(BootTime(-9)));
  visit(SomeActivation());
  for (const Record& record : SomeRecords()) visit(record);
  visit(std::vector<Bytes>{{}, {1, 2}});
}

TEST(Archive, EveryStructComesBackAsItWas) {
  ForEachStruct([]<class T>(const T& value) {
    const Bytes bytes = Packed(value);
    // Same bytes, same members; a field that no list names does not compile.
    EXPECT_EQ(Packed(Unpacker(bytes).Next<T>()), bytes);
  });
}

TEST(Archive, RecordsComeBackInOrderWithEveryMember) {
  PackedRecords packed;
  for (const Record& record : SomeRecords()) packed.Write(record);
  ASSERT_EQ(SomeRecords().size(), std::variant_size_v<RecordBody>);
  KeptRecords read;
  ReadPacked(packed.TakeAll(), read);
  EXPECT_EQ(packed.size_bytes(), 0u);
  ASSERT_EQ(read.all.size(), SomeRecords().size());
  for (std::size_t i = 0; i < read.all.size(); ++i) EXPECT_EQ(read.all[i].body.index(), i);
  EXPECT_EQ(read.all[0].time_ns, -1);
  EXPECT_FALSE(read.all[0].client);
  EXPECT_EQ(read.all[1].client, 1u);
  EXPECT_EQ(read.Of<record::Row>()[0].values, (std::vector<double>{0.1, -0.0, 1e300}));
  EXPECT_EQ(read.Of<record::Bytes>()[0].direction, link::Direction::kReference);
  EXPECT_EQ(read.Of<record::Bytes>()[0].side, ByteSide::kPassedOn);
  EXPECT_EQ(read.Of<record::Bytes>()[0].bytes, (Bytes{0x7E, 1, 2}));
  EXPECT_EQ(read.Of<record::Counters>()[0].counts[2].bytes_corrupted, 12);
  EXPECT_EQ(read.Of<record::Event>()[0].text, std::string("with\0NUL", 8));
  EXPECT_EQ(read.Of<record::Accepted>()[0].kind, record::AcceptedKind::kActuators);
  EXPECT_EQ(read.Of<record::Reply>()[0].latency_ns, kNever);
  EXPECT_EQ(read.Of<record::LineEnd>()[0].resync_max_ns, 15);
  EXPECT_EQ(read.Of<record::ClientEnd>()[0].unmodelled_blocks, std::vector<std::string>{"CRYP"});
  EXPECT_EQ(read.Of<record::FirmwareTime>()[0].use.spans[0].run_ns, 3);
  const faults::Activation activation = read.Of<faults::Activation>()[0];
  EXPECT_EQ(activation.fault, 3u);
  EXPECT_EQ(activation.what, "2 bits flipped");
  ASSERT_EQ(activation.after.size(), 2u);
  EXPECT_EQ(activation.after[1].begin_ns, 12);
  EXPECT_EQ(activation.after[1].bytes, SomeChunk(TimeNs{0}).bytes);
  EXPECT_EQ(activation.after[1].message, 3u);
  EXPECT_EQ(activation.after[1].number, 77u);
}

TEST(Archive, ARecordOfAKindThatThereIsNotIsRefused) {
  Packer packer;
  packer(std::uint8_t{std::variant_size_v<RecordBody>});
  EXPECT_THROW(Unpacker(packer.bytes()).Next<RecordBody>(), std::runtime_error);
}

TEST(PartRecords, WaitUntilTheTimeOfTheFlightIsKnown) {
  KeptRecords kept;
  PartRecords records(kept, 2);
  const Bytes bytes(PartRecords::kBytesMax + 1, 7);
  records.WriteBytes(BootTime(100), link::Direction::kToClient, ByteSide::kSent, bytes);
  records.Write(BootTime(140), record::Event{"rejected", ""});
  records.Write(TimeNs{-3}, record::Event{"at once", ""});
  ASSERT_EQ(kept.all.size(), 1u);
  records.SetOrigin(Origin(BootTime(150)));
  records.SetOrigin(Origin(BootTime(999)));
  records.Write(BootTime(160), record::State{1});
  ASSERT_EQ(kept.all.size(), 5u);
  std::vector<TimeNs> times_ns;
  for (const Record& record : kept.all) {
    times_ns.push_back(record.time_ns);
    EXPECT_EQ(record.client, 2u);
  }
  EXPECT_EQ(times_ns, (std::vector<TimeNs>{-3, -50, -50, -10, 10}));
  EXPECT_EQ(kept.Of<record::Bytes>()[0].bytes.size(), PartRecords::kBytesMax);
  EXPECT_EQ(kept.Of<record::Bytes>()[1].bytes, Bytes{7});
  EXPECT_EQ(kept.Of<record::Bytes>()[1].direction, link::Direction::kToClient);
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
