// Effects of faults on the number of bytes on a line, and the faults that are certain to make too many.
#include "faults/volume.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "faults/registry.h"
#include "faults/schedule.h"
#include "harness/scenario/shipped_protocols.h"
#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

using ::testing::ElementsAre;

// The bound on what a line holds, and `check`, rely on it.
TEST(VolumeTest, FaultsChangeTheNumberOfBytesAsTheyDeclare) {
  for (const FaultType& type : FaultTypes()) {
    const auto* wire = type.As<WireKind>();
    if (wire == nullptr) continue;
    FaultSpec spec = ExampleSpec(type);
    if (wire->volume == Volume::kDoubles) spec.parameters["probability"] = 1.0;
    std::size_t sent_bytes = 0, bytes = 0, held_bytes_max = 0;
    FaultSchedule schedule = AtTheLine({spec}, 1);
    link::ChunkFilter* filter = schedule.Filter(link::Direction::kToClient);
    schedule.SetOrigin(kOriginAtPowerOn);
    for (std::int64_t n = 0; n < 1000; ++n) {
      std::vector<link::Chunk> chunks = {Frame(n)};
      sent_bytes += chunks[0].bytes.size();
      filter->Apply(chunks);
      for (const link::Chunk& chunk : chunks) bytes += chunk.bytes.size();
      held_bytes_max = std::max(held_bytes_max, filter->held_bytes());
    }
    if (wire->volume == Volume::kDoubles) {
      EXPECT_EQ(bytes, 2 * sent_bytes) << type.name;
    } else if (wire->volume == Volume::kKeeps) {
      EXPECT_GE(bytes, sent_bytes) << type.name;
    }
    EXPECT_LE(held_bytes_max > 0, wire->remembers)
        << type.name;  // some remember no frames, but when the last one came
  }
}

std::vector<FaultSpec> Doubling(int count) {
  std::vector<FaultSpec> specs;
  for (int i = 0; i < count; ++i)
    specs.push_back(
        Spec("wire.byte_duplicate", {{"probability", 1.0}}, std::string("f").append(std::to_string(i))));
  return specs;
}

constexpr TimeNs kDurationNs = 60 * kNsPerS;

bool IsTooMuch(const std::vector<FaultSpec>& specs) {
  return CertainOverfull(specs, kDurationNs, *harness::FindProtocol("paper")).has_value();
}

// A reply is 64 bytes and 4 around them: 2^16 times that is less than 8 MiB, 2^17 times more.
TEST(VolumeTest, TellsTheFaultThatIsOneTooMany) {
  EXPECT_FALSE(IsTooMuch(Doubling(16)));
  const auto too_much = CertainOverfull(Doubling(20), kDurationNs, *harness::FindProtocol("paper"));
  ASSERT_TRUE(too_much);
  EXPECT_EQ(too_much->direction, link::Direction::kToClient);
  EXPECT_EQ(too_much->faults.size(), 17U);
  // Frame faults act first, wherever they stand in the file.
  auto specs = Doubling(16);
  specs.push_back(Spec("frame.duplicate", {{"probability", 1.0}}, "frames"));
  EXPECT_EQ(CertainOverfull(specs, kDurationNs, *harness::FindProtocol("paper"))->faults.front(), 16U);
  EXPECT_EQ(CertainOverfull(specs, kDurationNs, *harness::FindProtocol("paper"))->faults.back(), 15U);
}

TEST(VolumeTest, CountsWhatIsCertainAlone) {
  const auto with = [](const auto& change) {
    auto specs = Doubling(17);
    change(specs[3]);
    return specs;
  };
  EXPECT_FALSE(IsTooMuch(with([](FaultSpec& f) { f.parameters["probability"] = 0.99; })));
  EXPECT_FALSE(IsTooMuch(with([](FaultSpec& f) { f.probability = 0.99; })));
  EXPECT_FALSE(IsTooMuch(with([](FaultSpec& f) { f.every_nth_count = 2; })));
  EXPECT_FALSE(IsTooMuch(with([](FaultSpec& f) { f.target = Target::kToPlant; })));
  EXPECT_FALSE(IsTooMuch(with([](FaultSpec& f) { f.type = "wire.byte_drop"; })));
  EXPECT_FALSE(IsTooMuch(with([](FaultSpec& f) { f.start_ns = kDurationNs - kNsPerMs; })));
  EXPECT_TRUE(IsTooMuch(with([](FaultSpec& f) { f.type = "wire.byte_insert"; })));
  EXPECT_TRUE(IsTooMuch(with([](FaultSpec& f) { f.target = Target::kBoth; })));
  EXPECT_TRUE(IsTooMuch(with([](FaultSpec& f) { f.message = "reply"; })));
  EXPECT_TRUE(IsTooMuch(with([](FaultSpec& f) { f.start_ns = 20 * kNsPerS; })));

  auto specs = Doubling(17);
  specs.push_back(Spec("frame.drop", {{"probability", 0.5}}, "drops"));
  EXPECT_FALSE(IsTooMuch(specs)) << "there may be nothing left to double";
  specs.back().end_ns = kNsPerS;
  specs[0].start_ns = 2 * kNsPerS;
  EXPECT_TRUE(IsTooMuch(specs)) << "the loss is over when the last begins";
  specs[1].end_ns = 2 * kNsPerS;
  EXPECT_FALSE(IsTooMuch(specs)) << "never all at once";
}

}  // namespace
}  // namespace tiltproof::faults
