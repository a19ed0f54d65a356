#include <gtest/gtest.h>

#include <algorithm>

#include "tests/faults/faulty_line.h"
#include "tests/faults/goodness_of_fit.h"

namespace tiltproof::faults {
namespace {

std::vector<bool> Lost(const std::vector<std::vector<link::Chunk>>& out) {
  std::vector<bool> lost;
  for (const auto& chunks : out) lost.push_back(chunks.empty());
  return lost;
}

TEST(DropTest, LosesItsShareOfFrames) {
  const auto out = Send(Spec("frame.drop", {{"probability", 0.2}}), 100'000, 8);
  const std::vector<bool> lost = Lost(out);
  EXPECT_TRUE(AreBernoulli(lost, 0.2));
  EXPECT_EQ(CountUnchanged(out, 8), std::count(lost.begin(), lost.end(), false));
}

TEST(DropTest, TheTriggersProbabilityComesOnTop) {
  FaultSpec spec = Spec("frame.drop", {{"probability", 0.5}});
  spec.probability = 0.5;
  EXPECT_TRUE(AreBernoulli(Lost(Send(spec, 100'000, 8)), 0.25));
}

}  // namespace
}  // namespace tiltproof::faults
