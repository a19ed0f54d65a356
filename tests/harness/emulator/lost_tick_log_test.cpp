#include "harness/emulator/lost_tick_log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>

namespace tiltproof::harness {
namespace {

using lockstep::RealtimeBoard;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using Span = LostTickLog::Span;

class LostTickLogTest : public ::testing::Test {
 protected:
  // As the plug-in does.
  void Lose(std::int64_t before_ns, std::int64_t at_ns) {
    const std::uint64_t count = board_->lost_tick_count;
    board_->lost_ticks[count % RealtimeBoard::kLostTicksKept].before_ns = before_ns;
    board_->lost_ticks[count % RealtimeBoard::kLostTicksKept].at_ns = at_ns;
    board_->lost_tick_count = count + 1;
  }

  std::unique_ptr<RealtimeBoard> board_ = std::make_unique<RealtimeBoard>();
  LostTickLog log_{*board_};
};

TEST_F(LostTickLogTest, GivesEachTickOnceAndThoseInARowAsOne) {
  EXPECT_THAT(log_.Take(), IsEmpty());
  Lose(100, 110);
  Lose(200, 210);
  Lose(210, 220);
  Lose(205, 230);
  EXPECT_THAT(log_.Take(), ElementsAre(Span{100, 110}, Span{200, 230}));
  EXPECT_THAT(log_.Take(), IsEmpty());
  Lose(300, 310);
  EXPECT_THAT(log_.Take(), ElementsAre(Span{300, 310}));
}

TEST_F(LostTickLogTest, ThoseThatWereOverwrittenLieAfterTheLastLook) {
  Lose(100, 110);
  EXPECT_EQ(log_.Take().size(), 1u);
  const auto kept = static_cast<std::int64_t>(RealtimeBoard::kLostTicksKept);
  for (std::int64_t i = 0; i < kept + 1; ++i) Lose(1'000 + 20 * i, 1'010 + 20 * i);
  const auto spans = log_.Take();
  ASSERT_EQ(spans.size(), RealtimeBoard::kLostTicksKept);
  EXPECT_EQ(spans[0], (Span{110, 1'030}));
  EXPECT_EQ(spans[1], (Span{1'040, 1'050}));
  for (std::int64_t i = 0; i < kept; ++i) Lose(5'000 + 20 * i, 5'010 + 20 * i);
  EXPECT_EQ(log_.Take().at(0), (Span{5'000, 5'010}));
}

TEST_F(LostTickLogTest, WhatAFaultHoldsIsNoDoingOfThisMachine) {
  constexpr auto kAfter = LostTickLog::kComesToItselfNs;
  log_.Held(1'000, 2'000);
  Lose(990, 999);
  Lose(999, 2'010);
  Lose(2'010, 2'020);
  Lose(2'000 + kAfter + 1, 2'000 + kAfter + 10);
  EXPECT_THAT(log_.Take(), ElementsAre(Span{990, 999}, Span{2'000 + kAfter + 1, 2'000 + kAfter + 10}));
}

}  // namespace
}  // namespace tiltproof::harness
