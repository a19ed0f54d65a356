#include "firmware/supervisor.h"

#include <array>

namespace tiltproof::firmware {
namespace {

using enum SupervisorState;

// Rows: states by number; columns: events in their order.
constexpr std::array<std::array<SupervisorState, kSupervisorEventCount>, kSupervisorStateCount> kAfter = {{
    // clang-format off
    //          kReady       kReply       kFault       kBlind       kReferenceHeld  kReferenceFollowed  kActuatorFault  kActuatorFailsafe  kCalm
    /* run  */ {kRun,        kRun,        kDegraded,   kFailsafe,   kHold,          kRun,               kDegraded,      kLastResort,       kRun},
    /* init */ {kRun,        kInit,       kInit,       kInit,       kInit,          kInit,              kInit,          kInit,             kInit},
    /* hold */ {kHold,       kHold,       kDegraded,   kFailsafe,   kHold,          kRun,               kDegraded,      kLastResort,       kHold},
    /* degr */ {kDegraded,   kDegraded,   kDegraded,   kFailsafe,   kDegraded,      kDegraded,          kDegraded,      kLastResort,       kRun},
    /* fail */ {kFailsafe,   kDegraded,   kFailsafe,   kFailsafe,   kFailsafe,      kFailsafe,          kFailsafe,      kLastResort,       kFailsafe},
    /* last */ {kLastResort, kLastResort, kLastResort, kLastResort, kLastResort,    kLastResort,        kLastResort,    kLastResort,       kLastResort},
    // clang-format on
}};

// Degraded: 3 s.
constexpr std::array<std::uint32_t, kSupervisorStateCount> kTimerPeriods = {0, 0, 0, 250, 0, 0};

constexpr bool RestartsTimer(SupervisorEvent event) {
  return event == SupervisorEvent::kFault || event == SupervisorEvent::kActuatorFault;
}

}  // namespace

SupervisorState SupervisorStateAfter(SupervisorState state, SupervisorEvent event) {
  return kAfter[static_cast<std::size_t>(state)][static_cast<std::size_t>(event)];
}

std::uint32_t SupervisorTimerPeriods(SupervisorState state) {
  return kTimerPeriods[static_cast<std::size_t>(state)];
}

void Supervisor::On(SupervisorEvent event) {
  const SupervisorState before = status_.state;
  status_.state = SupervisorStateAfter(before, event);
  if (status_.state != before || RestartsTimer(event)) timer_periods_ = SupervisorTimerPeriods(status_.state);
  if (IsFailsafe(status_.state) && !IsFailsafe(before)) ++status_.failsafe_count;
}

void Supervisor::BeginPeriod() {
  if (timer_periods_ == 0) return;
  if (--timer_periods_ == 0) On(SupervisorEvent::kCalm);
}

}  // namespace tiltproof::firmware
