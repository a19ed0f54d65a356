// Records as lateness of this machine when it keeps a program that represents a board from running: when the
// program waits for a processor, within a control period, for longer than a node may be late, and while it is
// stopped. Already a shorter wait, if a control period were wrong by it, is noted as a disturbance: by so much a program
// that counts time by its sleeps is late for good.
#pragma once

#include <algorithm>
#include <functional>
#include <utility>

#include "harness/node/node.h"
#include "harness/process/cpu_wait.h"
#include "harness/process/own_time.h"

namespace tiltproof::harness {

class CpuWaitWatch {
 public:
  // `held`: whether a fault of the scenario holds it just now.
  CpuWaitWatch(
      NodeServices& services, const Scenario& scenario, pid_t pid, CpuWait::Of of = CpuWait::Of::kProcess,
      std::function<bool()> held = [] { return false; })
      : services_(services),
        look_every_ns_(scenario.link.protocol->control_period_ns),
        disturbed_after_ns_(static_cast<TimeNs>(scenario.control_period_tolerance_percent / 100 *
                                                static_cast<double>(look_every_ns_))),
        pid_(pid),
        held_(std::move(held)),
        wait_(pid, of),
        timer_(services, services.clock().Now() + look_every_ns_, look_every_ns_,
               [this](BootTime now) { Look(now); }) {}

 private:
  // It is not known when in that time it waited.
  void Look(BootTime now) {
    const BootTime before = std::exchange(looked_, now);
    // This look may be late itself.
    const BootTime since = std::min(before, now - look_every_ns_);
    const TimeNs waited_ns = wait_.Take(before == BootTime::Never() ? look_every_ns_ : now - before);
    if (waited_ns > disturbed_after_ns_) services_.lateness().NoteDisturbed(since, now);
    if (waited_ns > services_.lateness().late_after_ns)
      services_.lateness().Note(now - std::max(waited_ns, look_every_ns_), now);
    if (held_() || !IsStoppedByOthers(pid_)) {
      stopped_ns_ = BootTime::Never();
      return;
    }
    if (stopped_ns_ == BootTime::Never()) stopped_ns_ = now - look_every_ns_;
    services_.lateness().Note(stopped_ns_, now);
  }

  NodeServices& services_;
  TimeNs look_every_ns_, disturbed_after_ns_;
  pid_t pid_;
  std::function<bool()> held_;
  CpuWait wait_;
  BootTime looked_ = BootTime::Never();      // last
  BootTime stopped_ns_ = BootTime::Never();  // since when
  PeriodicTimer timer_;
};

}  // namespace tiltproof::harness
