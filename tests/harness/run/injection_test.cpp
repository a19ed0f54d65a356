// A fault that is injected is recorded as it acts, also when the node where it acts hears of it too late.
#include "harness/run/realtime/injection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <deque>
#include <stdexcept>

#include "harness/run/line.h"
#include "link/frame.h"
#include "tests/harness/run/kept_records.h"
#include "tests/harness/scenario/fault_file.h"

namespace tiltproof::harness {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr TimeNs kPeriodNs = 12 * kNsPerMs;

class InjectionTest : public FaultFile {
 protected:
  InjectionTest() {
    injections_.next = [this]() -> std::optional<std::string> {
      if (wishes_.empty()) return std::nullopt;
      const std::string wish = wishes_.front();
      wishes_.pop_front();
      return wish;
    };
    injections_.add = [this](const Scenario& scenario, const AddedFault& fault) {
      Scenario more = scenario;
      AddFault(more, fault, options_);
      return more;
    };
    injections_.answer = [this](const Injections::Answer& answer) { answers_.push_back(answer); };
  }

  std::optional<RunEvent> Inject(const std::string& fault, TimeNs now_ns, const Injector::Tell& tell) {
    wishes_.push_back(fault);
    return injector_.Poll(scenario_, true, now_ns, tell);
  }

  std::deque<std::string> wishes_;
  Injections injections_;
  std::vector<Injections::Answer> answers_;
  Injector injector_{&injections_};
  Scenario scenario_ = Read("  - {id: first, type: harness.null}\n");
};

constexpr const char* kDrop =
    "{id: drop, type: frame.drop, target: to_client, duration_s: 1, parameters: {probability: 1}}";

TEST_F(InjectionTest, BeginsAsPlannedWhereItsNodeHearsInTime) {
  const auto event =
      Inject(kDrop, 1'000 * kNsPerMs, [](const AddedFault& fault) { return std::vector{fault.start_ns}; });
  ASSERT_EQ(scenario_.faults.size(), 2U);
  EXPECT_EQ(scenario_.faults.back().start_ns, 1'044 * kNsPerMs);
  EXPECT_EQ(scenario_.faults.back().end_ns, 2'044 * kNsPerMs);
  ASSERT_TRUE(event);
  EXPECT_EQ(event->time_ns, 1'044 * kNsPerMs);
  EXPECT_EQ(event->text, "'drop' (frame.drop) from 1.044 s on");
}

// The link node, which stood still meanwhile, hears of the fault 60 ms after its planned begin. What passes its line
// afterwards shows when the fault begins.
TEST_F(InjectionTest, IsRecordedAsItActsWhereItsNodeHearsTooLate) {
  KeptRecords records;
  LocalLine line(scenario_, records, 0, true, {.grows = true});
  const Origin origin(BootTime(5 * kNsPerS));
  line.SetOrigin(origin);
  const std::array<std::uint8_t, 1> payload = {3};
  std::array<std::uint8_t, link::FrameBytesMax(1)> wire{};
  const auto frame = link::EncodeFrame(payload, wire).bytes;
  TimeNs now_ns = 1'104 * kNsPerMs + 100 * kNsPerUs;
  const auto event = Inject(kDrop, 1'000 * kNsPerMs, [&](AddedFault fault) {
    EXPECT_EQ(fault.start_ns, 1'044 * kNsPerMs);
    fault.start_ns = KeptBegin(scenario_, fault.start_ns, now_ns);
    Scenario kept = scenario_;
    AddFault(kept, fault, options_);
    line.Add(kept.faults.back());
    return std::vector{fault.start_ns};
  });
  std::vector<TimeNs> sent_ns;
  for (; now_ns < 2'300 * kNsPerMs; now_ns += kPeriodNs) {
    sent_ns.push_back(now_ns);
    line.Transmit(link::Direction::kToClient, origin.ToBootTime(now_ns), frame);
  }
  line.Finish(origin.ToBootTime(now_ns));
  const auto activations = records.Of<faults::Activation>();
  ASSERT_EQ(scenario_.faults.size(), 2U);
  const faults::FaultSpec& recorded = scenario_.faults.back();
  ASSERT_FALSE(activations.empty());
  // All frames in the recorded window, and no other.
  std::vector<TimeNs> in_window_ns, dropped_ns;
  for (const TimeNs sent : sent_ns)
    if (recorded.start_ns <= sent && sent < recorded.end_ns) in_window_ns.push_back(sent);
  for (const auto& activation : activations) dropped_ns.push_back(activation.time_ns);
  EXPECT_EQ(dropped_ns, in_window_ns);
  EXPECT_EQ(recorded.start_ns, 1'116 * kNsPerMs);
  EXPECT_EQ(recorded.end_ns, 2'116 * kNsPerMs);
  ASSERT_TRUE(event);
  EXPECT_EQ(event->time_ns, recorded.start_ns);
  EXPECT_THAT(event->text, AllOf(HasSubstr("from 1.116 s on"), HasSubstr("too late for 1.044 s")));
  ASSERT_EQ(answers_.size(), 1U);
  EXPECT_TRUE(answers_[0].accepted);
  EXPECT_EQ(answers_[0].fault.start_ns, recorded.start_ns);
  EXPECT_THAT(WriteResolved(scenario_), AllOf(HasSubstr("start_s: 1.116"), Not(HasSubstr("start_s: 1.044"))));
}

TEST_F(InjectionTest, IsRefusedWhereItsNodeHearsAfterTheFlight) {
  const auto event =
      Inject(kDrop, 1'000 * kNsPerMs, [&](const auto&) { return std::vector{scenario_.duration_ns}; });
  EXPECT_FALSE(event);
  EXPECT_EQ(scenario_.faults.size(), 1U);
  ASSERT_EQ(answers_.size(), 1U);
  EXPECT_FALSE(answers_[0].accepted);
  EXPECT_THAT(answers_[0].text, HasSubstr("the flight is over"));
}

// The begin is a control step of which nothing has been done yet.
TEST_F(InjectionTest, KeptBegin) {
  EXPECT_EQ(KeptBegin(scenario_, 48 * kNsPerMs, 0), 48 * kNsPerMs);
  EXPECT_EQ(KeptBegin(scenario_, 48 * kNsPerMs, 48 * kNsPerMs - 1), 48 * kNsPerMs);
  EXPECT_EQ(KeptBegin(scenario_, 48 * kNsPerMs, 48 * kNsPerMs), 60 * kNsPerMs);
  EXPECT_EQ(KeptBegin(scenario_, 48 * kNsPerMs, 59 * kNsPerMs), 60 * kNsPerMs);
}

}  // namespace
}  // namespace tiltproof::harness
