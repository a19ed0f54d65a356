// The supervisor's table against a slow model that keeps all events and works the state out of the whole history.
#include "firmware/supervisor.h"

#include <gtest/gtest.h>

#include <map>
#include <random>
#include <set>
#include <vector>

namespace tiltproof::firmware {
namespace {

using Event = SupervisorEvent;
using State = SupervisorState;

constexpr int kTrustAfterPeriods = 250;  // 3 s at 12 ms

class History {
 public:
  void Add(Event event) { events_.push_back({event, period_}); }
  void EndPeriod() { ++period_; }

  State StateNow() const {
    bool ready = false;
    bool blind = false;
    bool held = false;
    int trusted_from = 0;
    for (const auto& [event, period] : events_) {
      if (event == Event::kReady) ready = true;
      if (!ready) continue;
      if (event == Event::kActuatorFailsafe) return State::kLastResort;
      const bool fault = event == Event::kFault || event == Event::kActuatorFault;
      const bool sees_again = blind && event == Event::kReply;
      if (fault || sees_again) trusted_from = period + kTrustAfterPeriods;
      if (event == Event::kBlind) blind = true;
      if (sees_again) blind = false;
      const bool trusted = !blind && period >= trusted_from;
      if (event == Event::kReferenceFollowed || !trusted) held = false;
      if (event == Event::kReferenceHeld && trusted) held = true;
    }
    if (!ready) return State::kInit;
    if (blind) return State::kFailsafe;
    if (period_ < trusted_from) return State::kDegraded;
    return held ? State::kHold : State::kRun;
  }

 private:
  struct Entry {
    Event event;
    int period;
  };
  std::vector<Entry> events_;
  int period_ = 0;
};

const std::map<State, std::vector<Event>> kWays = {
    {State::kInit, {}},
    {State::kRun, {Event::kReady}},
    {State::kHold, {Event::kReady, Event::kReferenceHeld}},
    {State::kDegraded, {Event::kReady, Event::kFault}},
    {State::kFailsafe, {Event::kReady, Event::kBlind}},
    {State::kLastResort, {Event::kReady, Event::kActuatorFailsafe}},
};

TEST(SupervisorTest, EveryPairOfStateAndEventIsAsTheHistorySays) {
  ASSERT_EQ(kWays.size(), kSupervisorStateCount);
  for (const auto& [state, way] : kWays) {
    for (std::size_t i = 0; i < kSupervisorEventCount; ++i) {
      const auto event = static_cast<Event>(i);
      Supervisor supervisor;
      History history;
      for (const Event step : way) {
        supervisor.On(step);
        history.Add(step);
      }
      ASSERT_EQ(supervisor.status().state, state);
      ASSERT_EQ(history.StateNow(), state);
      supervisor.On(event);
      history.Add(event);
      const State expected =
          event == Event::kCalm && state == State::kDegraded ? State::kRun : history.StateNow();
      EXPECT_EQ(supervisor.status().state, expected)
          << static_cast<unsigned>(state) << " on " << static_cast<unsigned>(event);
    }
  }
}

TEST(SupervisorTest, ARandomWalkIsAsTheHistorySays) {
  std::mt19937 engine(1);
  std::set<State> seen;
  for (int walk = 0; walk < 60; ++walk) {
    Supervisor supervisor;
    History history;
    unsigned entries = 0;
    // Each walk has its own mix: seldom an event, so that timers run out, or often.
    const auto seldom = 2 + engine() % 200;
    for (int period = 0; period < 800; ++period) {
      supervisor.BeginPeriod();
      history.EndPeriod();
      if (engine() % seldom == 0) {
        auto event = static_cast<Event>(engine() % (kSupervisorEventCount - 1));
        if (event == Event::kActuatorFailsafe && engine() % 8 != 0) event = Event::kReply;
        const bool before = IsFailsafe(history.StateNow());
        supervisor.On(event);
        history.Add(event);
        if (IsFailsafe(history.StateNow()) && !before) ++entries;
      }
      ASSERT_EQ(supervisor.status().state, history.StateNow()) << walk << " " << period;
      ASSERT_EQ(supervisor.status().failsafe_count, entries);
      seen.insert(supervisor.status().state);
    }
  }
  EXPECT_EQ(seen.size(), kSupervisorStateCount);
}

TEST(SupervisorTest, RunIsZero) {
  // firmware/tiltproof_client.h
  EXPECT_EQ(static_cast<unsigned>(State::kRun), 0U);
  EXPECT_EQ(Status{}.state, State::kRun);
}

TEST(SupervisorTest, EachFaultBeginsTheThreeSecondsAnew) {
  Supervisor supervisor;
  supervisor.On(Event::kReady);
  supervisor.On(Event::kFault);
  for (int period = 0; period < 200; ++period) supervisor.BeginPeriod();
  supervisor.On(Event::kActuatorFault);
  for (int period = 0; period < 249; ++period) supervisor.BeginPeriod();
  EXPECT_TRUE(supervisor.degraded());
  supervisor.BeginPeriod();
  EXPECT_FALSE(supervisor.degraded());
}

}  // namespace
}  // namespace tiltproof::firmware
