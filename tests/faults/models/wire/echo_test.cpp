// The part of frames that comes back. Its time of arrival is the line's part (tests/harness/run/echo_test.cpp).
#include <gtest/gtest.h>

#include "tests/faults/faulty_line.h"
#include "tests/faults/goodness_of_fit.h"

namespace tiltproof::faults {
namespace {

TEST(EchoTest, EachFrameComesBackForItselfAndGoesOn) {
  std::vector<bool> returned;
  const auto out = Send(Spec("wire.echo", {{"probability", 0.3}}), 100'000, 10);
  for (std::size_t n = 0; n < out.size(); ++n) {
    const auto number = static_cast<std::int64_t>(n);
    ASSERT_FALSE(out[n].empty());
    ASSERT_TRUE(Same(out[n][0], Frame(number, 10)));
    returned.push_back(out[n].size() == 2);
    if (returned.back()) {
      ASSERT_TRUE(Same(out[n][1], Frame(number, 10)));
    }
  }
  EXPECT_TRUE(AreBernoulli(returned, 0.3));
}

TEST(EchoTest, HasTheBytesThatFaultsBeforeItHaveLeft) {
  const FaultSpec echo = Spec("wire.echo", {{"probability", 1.0}}, "echo");
  const FaultSpec drop = Spec("wire.byte_drop", {{"probability", 0.1}}, "drop");
  FaultSchedule drop_first = AtTheLine({drop, echo}, 1), echo_first = AtTheLine({echo, drop}, 1);
  const auto after = Send(drop_first, 200), before = Send(echo_first, 200);
  int shorter_count = 0;
  for (std::size_t n = 0; n < after.size(); ++n) {
    ASSERT_EQ(after[n].size(), 2U);
    EXPECT_EQ(after[n][1].bytes, after[n][0].bytes);
    EXPECT_EQ(before[n].at(0).bytes, after[n][0].bytes);
    EXPECT_EQ(before[n].at(1).bytes, Frame(static_cast<std::int64_t>(n)).bytes);
    shorter_count += after[n][0].bytes.size() < 68 ? 1 : 0;
  }
  EXPECT_GT(shorter_count, 150);
}

TEST(EchoTest, ALostFrameDoesNotComeBack) {
  FaultSchedule schedule = AtTheLine(
      {Spec("frame.drop", {{"probability", 1.0}}, "drop"), Spec("wire.echo", {{"probability", 1.0}}, "echo")},
      1);
  for (const auto& chunks : Send(schedule, 10)) EXPECT_TRUE(chunks.empty());
}

TEST(EchoTest, AltersBothWaysOfTheMainLine) {
  const auto alters = [](Target target) {
    FaultSpec spec = Spec("wire.echo", {{"probability", 1.0}});
    spec.target = target;
    const FaultSchedule schedule = AtTheLine({spec}, 1);
    std::vector<bool> answers;
    for (const auto direction :
         {link::Direction::kToPlant, link::Direction::kToClient, link::Direction::kReference})
      answers.push_back(schedule.MayAlter(direction));
    return answers;
  };
  EXPECT_EQ(alters(Target::kToPlant), (std::vector{true, true, false}));
  EXPECT_EQ(alters(Target::kNone), (std::vector{true, true, false}));  // as to_plant
  EXPECT_FALSE(AtTheLine({}, 1).MayAlter(link::Direction::kToPlant));
}

}  // namespace
}  // namespace tiltproof::faults
