// Frames that only the fault sends: they follow those that pass, and their number has its distribution.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>

#include "tests/faults/goodness_of_fit.h"
#include "tests/faults/models/frame/message_frames.h"

namespace tiltproof::faults {
namespace {

using link::Direction;

// Frames come every 12 ms, so that behind each follow a Poisson number of others with this mean.
constexpr double kRate_hz = 100, kMean = kRate_hz * 0.012;

void ExpectPoisson(const std::vector<std::vector<link::Chunk>>& out) {
  std::vector<double> observed(8, 0), expected(8, 0);
  EXPECT_EQ(out.front().size(), 1U);  // nothing is known of the pause before
  for (std::size_t n = 1; n < out.size(); ++n) {
    const auto& chunks = out[n];
    observed[std::min<std::size_t>(chunks.size() - 1, 7)] += 1;
    for (const link::Chunk& chunk : chunks) {
      EXPECT_EQ(chunk.begin_ns, chunks[0].begin_ns);
      EXPECT_EQ(chunk.number, n);
    }
  }
  double rest = static_cast<double>(out.size() - 1), term = rest * std::exp(-kMean);
  for (std::size_t k = 0; k < 7; term *= kMean / static_cast<double>(++k)) rest -= expected[k] = term;
  expected[7] = rest;
  EXPECT_TRUE(HaveCounts(observed, expected));
}

TEST(UnsolicitedTest, AreMessagesOfTheirDirectionAtTheirRate) {
  const auto out = SendMessages(Spec("frame.unsolicited", {{"rate_hz", kRate_hz}}), "actuators", 100'000);
  ExpectPoisson(out);
  std::map<std::string, double> by_name;
  std::vector<double> values;  // of four fields
  for (std::size_t n = 0; n < out.size(); ++n) {
    EXPECT_EQ(out[n][0].bytes, MessageFrame("actuators", static_cast<std::int64_t>(n)).bytes);
    for (std::size_t i = 1; i < out[n].size(); ++i) {
      const auto heard = Decoded({{out[n][i]}});
      ASSERT_EQ(heard.size(), 1U);
      link::Message message;
      ASSERT_EQ(PaperProtocol().Decode(Direction::kToPlant, heard[0].payload, message),
                link::MessageStatus::kOk);
      ++by_name[message.type->name];
      if (message.type->name != "actuators") continue;
      for (std::size_t k = 0; k < message.type->fields.size(); ++k) {
        const link::MessageField& field = message.type->fields[k];
        values.push_back((message.values[k] - field.min) / (field.max - field.min));
      }
    }
  }
  EXPECT_FALSE(by_name.contains("start"));
  EXPECT_EQ(by_name.size(), 2U);
  EXPECT_TRUE(AreUniform({by_name["actuators"], by_name["request"]}));
  EXPECT_TRUE(HaveCdf(values, [](double x) { return x; }));
}

TEST(BabbleTest, IsNoiseBetweenFlagsAtItsRate) {
  const auto out = SendMessages(Spec("frame.babble", {{"rate_hz", kRate_hz}}), "sensors", 100'000);
  ExpectPoisson(out);
  std::vector<double> by_length(65, 0), by_value(256, 0);
  for (const auto& chunks : out) {
    for (std::size_t i = 1; i < chunks.size(); ++i) {
      const Bytes& noise = chunks[i].bytes;
      EXPECT_EQ(noise.front(), link::kFlag);
      EXPECT_EQ(noise.back(), link::kFlag);
      by_length.at(noise.size() - 2) += 1;
      for (std::size_t k = 1; k + 1 < noise.size(); ++k) by_value[noise[k]] += 1;
    }
  }
  by_length.erase(by_length.begin());
  EXPECT_TRUE(AreUniform(by_length));
  EXPECT_TRUE(AreUniform(by_value));
}

// Events outside the window do not count, and the first frame in it says nothing of the time before it.
TEST(BabbleTest, CountsOnlyWhatFallsIntoTheWindow) {
  FaultSpec spec = Spec("frame.babble", {{"rate_hz", 10'000.0}});
  spec.start_ns = FrameTime(10) - 1 * kNsPerMs;
  spec.end_ns = FrameTime(12) + 1;
  const auto out = SendMessages(spec, "sensors", 20);
  for (std::size_t n = 0; n < out.size(); ++n) {
    if (n < 10 || n > 12) {
      EXPECT_EQ(out[n].size(), 1U) << n;
    }
  }
  EXPECT_NEAR(static_cast<double>(out[10].size()), 10, 5 * std::sqrt(10.0));  // of 1 ms
  EXPECT_NEAR(static_cast<double>(out[11].size()), 120, 5 * std::sqrt(120.0));
}

// A long silence does not end in a flood.
TEST(BabbleTest, OfALongPauseTheLastSecondCounts) {
  FaultSchedule schedule = AtTheLine({Spec("frame.babble", {{"rate_hz", 1000.0}})}, 1);
  schedule.SetOrigin(kOriginAtPowerOn);
  std::vector<link::Chunk> chunks = {MessageFrame("sensors", 0)};
  schedule.Filter(Direction::kToClient)->Apply(chunks);
  chunks = {MessageFrame("sensors", 10'000)};  // two minutes later
  schedule.Filter(Direction::kToClient)->Apply(chunks);
  EXPECT_NEAR(static_cast<double>(chunks.size()), 1000, 5 * std::sqrt(1000.0));
}

}  // namespace
}  // namespace tiltproof::faults
