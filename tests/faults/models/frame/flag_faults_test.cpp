// Lost, forged and escaped flags, as the protocol's own decoder hears them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/faults/goodness_of_fit.h"
#include "tests/faults/models/frame/message_frames.h"

namespace tiltproof::faults {
namespace {

using link::FrameStatus;

TEST(FlagLossTest, FusesTwoFrames) {
  FaultSpec spec = Spec("frame.flag_loss", {{"probability", 1.0}});
  spec.start_ns = FrameTime(3);
  spec.end_ns = FrameTime(5);
  // Frame 3 loses its end, frame 4 its begin and its end, frame 5 closes what is open.
  const auto out = SendMessages(spec, "sensors", 8);
  EXPECT_EQ(out[3][0].bytes.size() + 1, MessageFrame("sensors", 3).bytes.size());
  EXPECT_EQ(out[4][0].bytes.size() + 2, MessageFrame("sensors", 4).bytes.size());
  EXPECT_EQ(out[5][0].bytes, MessageFrame("sensors", 5).bytes);
  std::vector<FrameStatus> statuses;
  for (const Heard& heard : Decoded(out)) statuses.push_back(heard.status);
  EXPECT_EQ(statuses, (std::vector<FrameStatus>{FrameStatus::kOk, FrameStatus::kOk, FrameStatus::kOk,
                                                FrameStatus::kBadChecksum, FrameStatus::kOk, FrameStatus::kOk,
                                                FrameStatus::kOk}));
}

TEST(FlagLossTest, ALoneOneIsOnlyLate) {
  FaultSpec spec = Spec("frame.flag_loss", {{"probability", 1.0}});
  spec.start_ns = FrameTime(3);
  spec.end_ns = FrameTime(4);
  const auto out = SendMessages(spec, "sensors", 8);
  EXPECT_EQ(out[3][0].bytes.back() == link::kFlag, false);
  const auto heard = Decoded(out);
  ASSERT_EQ(heard.size(), 8U);
  for (const Heard& each : heard) EXPECT_EQ(each.status, FrameStatus::kOk);
}

// About n p of n frames lose their flag. Every run of k of them makes one fused frame of k + 1. Exception: k is 1 and
// the next frame keeps its opening flag, because it does not follow a frame that the trigger picked.
TEST(FlagLossTest, HasItsProbability) {
  const auto out = SendMessages(Spec("frame.flag_loss", {{"probability", 0.25}}), "sensors", 100'000);
  std::vector<bool> lost;
  for (const auto& chunks : out) lost.push_back(chunks[0].bytes.back() != link::kFlag);
  EXPECT_TRUE(AreBernoulli(lost, 0.25));
  int fused = 0;
  for (const Heard& heard : Decoded(out)) fused += heard.status != FrameStatus::kOk ? 1 : 0;
  // A run begins at a lost flag whose frame did not open without one: p (1 - p) n of them.
  EXPECT_NEAR(fused, 18'750, 5 * std::sqrt(18'750));
}

TEST(FlagForgeryTest, SplitsFramesAtEveryPlaceAlike) {
  constexpr int kFrameCount = 200'000;
  const auto out = Send(Spec("frame.flag_forgery", {{"probability", 0.5}}), kFrameCount);
  std::vector<bool> split;
  std::vector<double> by_place(66, 0);  // of bytes 1 to 66, between the flags
  for (int n = 0; n < kFrameCount; ++n) {
    const Bytes before = Frame(n).bytes, &after = out[static_cast<std::size_t>(n)].at(0).bytes;
    ASSERT_EQ(after.size(), before.size());
    split.push_back(after != before);
    if (!split.back()) continue;
    const auto [from, to] = std::mismatch(before.begin(), before.end(), after.begin());
    EXPECT_TRUE(std::equal(from + 1, before.end(), to + 1));
    EXPECT_EQ(*to, link::kFlag);
    ++by_place.at(static_cast<std::size_t>(from - before.begin()) - 1);
  }
  EXPECT_TRUE(AreBernoulli(split, 0.5));
  EXPECT_TRUE(AreUniform(by_place));
}

TEST(FlagForgeryTest, NoneOfThemIsAccepted) {
  const auto out = SendMessages(Spec("frame.flag_forgery", {{"probability", 1.0}}), "sensors", 500);
  int accepted = 0;
  for (const Heard& heard : Decoded(out)) {
    link::Message message;
    if (heard.status == FrameStatus::kOk && PaperProtocol().Decode(link::Direction::kToClient, heard.payload,
                                                                   message) == link::MessageStatus::kOk)
      ++accepted;
  }
  EXPECT_EQ(accepted, 0);
}

TEST(DanglingEscapeTest, IsHeardAsAnAbort) {
  const auto out = SendMessages(Spec("frame.dangling_escape", {{"probability", 0.5}}), "sensors", 100'000);
  std::vector<bool> aborted;
  std::size_t n = 0;
  for (const Heard& heard : Decoded(out)) {
    const Bytes sent = MessageFrame("sensors", static_cast<std::int64_t>(n)).bytes;
    const Bytes& passed = out[n++][0].bytes;
    aborted.push_back(passed != sent);
    if (!aborted.back()) {
      EXPECT_EQ(heard.status, FrameStatus::kOk);
      continue;
    }
    EXPECT_EQ(heard.status, FrameStatus::kDanglingEscape);
    EXPECT_EQ(passed.size(), sent.size() + 1);
  }
  EXPECT_EQ(n, 100'000U);
  EXPECT_TRUE(AreBernoulli(aborted, 0.5));
}

}  // namespace
}  // namespace tiltproof::faults
