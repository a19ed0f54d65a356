// Lost, forged and escaped flags, as the protocol's own decoder hears them.
#include <gtest/gtest.h>

#include <cmath>

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

// Of n frames about n p lose their flag, and every run of k of them makes one fused frame of k + 1, unless k is 1
// and the next frame keeps its opening flag because it does not follow one that the trigger picked.
TEST(FlagLossTest, HasItsProbability) {
  const auto out = SendMessages(Spec("frame.flag_loss", {{"probability", 0.25}}), "sensors", 20'000);
  int lost = 0;
  for (const auto& chunks : out) lost += chunks[0].bytes.back() != link::kFlag ? 1 : 0;
  EXPECT_NEAR(lost, 5000, 5 * std::sqrt(20'000 * 0.25 * 0.75));
  int fused = 0;
  for (const Heard& heard : Decoded(out)) fused += heard.status != FrameStatus::kOk ? 1 : 0;
  // A run begins at a lost flag whose frame did not open without one: p (1 - p) n of them.
  EXPECT_NEAR(fused, 3750, 5 * std::sqrt(3750));
}

TEST(FlagForgeryTest, SplitsFramesAtEveryPlaceAlike) {
  constexpr int kFrameCount = 20'000;
  const auto out = Send(Spec("frame.flag_forgery", {{"probability", 0.5}}), kFrameCount);
  std::vector<int> by_place(68, 0);
  int split = 0;
  for (int n = 0; n < kFrameCount; ++n) {
    const auto places = FlippedBits(Frame(n), out[static_cast<std::size_t>(n)].at(0));
    if (places.empty()) continue;
    ++split;
    ++by_place[places.front() / 8];
    EXPECT_EQ(places.front() / 8, places.back() / 8);
    EXPECT_EQ(out[static_cast<std::size_t>(n)][0].bytes[places.front() / 8], link::kFlag);
  }
  EXPECT_NEAR(split, kFrameCount / 2, 5 * std::sqrt(kFrameCount / 4.0));
  EXPECT_EQ(by_place.front() + by_place.back(), 0);
  for (std::size_t place = 1; place < 67; ++place)
    EXPECT_NEAR(by_place[place], split / 66.0, 6 * std::sqrt(split / 66.0)) << place;
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
  const auto out = SendMessages(Spec("frame.dangling_escape", {{"probability", 0.5}}), "sensors", 2000);
  int aborted = 0;
  std::size_t n = 0;
  for (const Heard& heard : Decoded(out)) {
    const Bytes sent = MessageFrame("sensors", static_cast<std::int64_t>(n)).bytes;
    const Bytes& passed = out[n++][0].bytes;
    if (passed == sent) {
      EXPECT_EQ(heard.status, FrameStatus::kOk);
      continue;
    }
    ++aborted;
    EXPECT_EQ(heard.status, FrameStatus::kDanglingEscape);
    EXPECT_EQ(passed.size(), sent.size() + 1);
  }
  EXPECT_EQ(n, 2000U);
  EXPECT_NEAR(aborted, 1000, 5 * std::sqrt(500.0));
}

}  // namespace
}  // namespace tiltproof::faults
