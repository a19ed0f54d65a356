// Trust of the build `tolerant` in its flight: one state, moved by events through a table.
//
//   Supervisor supervisor;
//   supervisor.On(SupervisorEvent::kReady);          // the first valid reply: there is a reference, too
//   supervisor.BeginPeriod();                        // once per control period: timers
//   if (supervisor.degraded()) ...                   // line, sensors or actuators are not trusted
//
// The table is data (SupervisorStateAfter), so a test can walk all of it. A period without reply is kFault, so many
// in a row kBlind; the last resort is for good, replies do not end it.
#pragma once

#include <cstddef>
#include <cstdint>

namespace tiltproof::firmware {

// The numbers are those of TiltproofClientStatus.
enum class SupervisorState : std::uint32_t {
  kRun = 0,        // normal
  kInit = 1,       // no valid reply yet
  kHold = 2,       // the reference is not the one received: it is held or approached
  kDegraded = 3,   // a fault in the last 3 s: of line, sensors or actuators
  kFailsafe = 4,   // blind: flies on the prediction alone
  kLastResort = 5  // fail-safe, too: the actuators can no longer hold the vehicle up
};
inline constexpr std::size_t kSupervisorStateCount = 6;

enum class SupervisorEvent : std::uint8_t {
  kReady,              // first valid reply and reference
  kReply,              // a valid reply that was used
  kFault,              // a reply missing, late or surprising, a signal substituted
  kBlind,              // no valid reply for several periods
  kReferenceHeld,      // the reference flown is not the one received
  kReferenceFollowed,  // it is again
  kActuatorFault,      // one is weak or stuck
  kActuatorFailsafe,   // what is left of them cannot hold the vehicle up
  kCalm,               // the state's timer has run out
};
inline constexpr std::size_t kSupervisorEventCount = 9;

SupervisorState SupervisorStateAfter(SupervisorState state, SupervisorEvent event);

// Control periods from a state's entry, or the last fault in it, to kCalm; 0: no timer.
std::uint32_t SupervisorTimerPeriods(SupervisorState state);

constexpr bool IsFailsafe(SupervisorState state) {
  return state == SupervisorState::kFailsafe || state == SupervisorState::kLastResort;
}

struct Status {
  SupervisorState state = SupervisorState::kRun;
  std::uint32_t failsafe_count = 0;  // entries of a fail-safe state from another since power-on
};

class Supervisor {
 public:
  void On(SupervisorEvent event);
  void BeginPeriod();

  const Status& status() const { return status_; }
  bool degraded() const { return status_.state == SupervisorState::kDegraded || IsFailsafe(status_.state); }

 private:
  Status status_{.state = SupervisorState::kInit, .failsafe_count = 0};
  std::uint32_t timer_periods_ = 0;  // left
};

}  // namespace tiltproof::firmware
