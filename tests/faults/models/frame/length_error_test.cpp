// The length of a frame is wrong: how often, where, and by how much.
#include <gtest/gtest.h>

#include <vector>

#include "link/length_framing.h"
#include "tests/faults/faulty_line.h"
#include "tests/faults/goodness_of_fit.h"

namespace tiltproof::faults {
namespace {

constexpr std::size_t kSyncBytes = 2;

TEST(LengthErrorTest, AllPlacesAndAllOtherValuesAreEquallyLikely) {
  constexpr std::int64_t kCount = 100'000;
  const FaultSpec spec = Spec("frame.length_error", {{"probability", 0.5}});
  const auto protocol = link::PaperOver(
      link::MakeLengthFraming({.sync = {0xAA, 0x55}, .length_bytes = 2}, link::CheckKind::kCrc16Ibm3740));
  const Bytes honest = protocol->framing->Encode(Bytes(64, 7));
  FaultSchedule schedule({spec}, 1, {.protocol = protocol});
  schedule.SetOrigin(kOriginAtPowerOn);
  std::vector<double> changed(2, 0), by_place(2, 0), by_difference(255, 0);
  for (std::int64_t n = 0; n < kCount; ++n) {
    std::vector<link::Chunk> chunks = {Frame(n)};
    chunks[0].bytes = honest;
    schedule.Filter(link::Direction::kToClient)->Apply(chunks);
    ASSERT_EQ(chunks.size(), 1U);
    ASSERT_EQ(chunks[0].bytes.size(), honest.size());
    std::vector<std::size_t> places;
    for (std::size_t i = 0; i < honest.size(); ++i)
      if (chunks[0].bytes[i] != honest[i]) places.push_back(i);
    ASSERT_LE(places.size(), 1U);
    ++changed[places.size()];
    if (places.empty()) continue;
    const std::size_t place = places[0];
    ASSERT_GE(place, kSyncBytes);
    ASSERT_LT(place, kSyncBytes + 2);
    ++by_place[place - kSyncBytes];
    ++by_difference[static_cast<std::uint8_t>(chunks[0].bytes[place] - honest[place]) - 1U];
  }
  EXPECT_TRUE(AreUniform(changed));
  EXPECT_TRUE(AreUniform(by_place));
  EXPECT_TRUE(AreUniform(by_difference));
}

}  // namespace
}  // namespace tiltproof::faults
