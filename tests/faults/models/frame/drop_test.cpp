#include <gtest/gtest.h>

#include <algorithm>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

TEST(DropTest, LosesItsShareOfFrames) {
  const auto out = Send(Spec("frame.drop", {{"probability", 0.2}}), 10'000);
  const auto lost = std::count_if(out.begin(), out.end(), [](const auto& chunks) { return chunks.empty(); });
  EXPECT_NEAR(static_cast<double>(lost), 2000.0, 200.0);
  EXPECT_EQ(CountUnchanged(out), 10'000 - lost);
}

TEST(DropTest, TheTriggersProbabilityComesOnTop) {
  FaultSpec spec = Spec("frame.drop", {{"probability", 0.5}});
  spec.probability = 0.5;
  EXPECT_NEAR(CountUnchanged(Send(spec, 10'000)), 7500, 220);
}

}  // namespace
}  // namespace tiltproof::faults
