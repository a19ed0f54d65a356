// Notes as lateness of this machine when it lets an emulator wait for a processor, within a control period, for longer
// than a node may be late.
#pragma once

#include <algorithm>

#include "harness/node/cpu_wait.h"
#include "harness/node/node.h"

namespace tiltproof::harness {

class CpuWaitWatch {
 public:
  CpuWaitWatch(NodeServices& services, pid_t pid)
      : services_(services),
        wait_(pid),
        timer_(services, services.clock().Now() + kControlPeriodNs, kControlPeriodNs,
               [this](TimeNs now) { Look(now); }) {}

 private:
  // When in the period it waited is not known.
  void Look(TimeNs now) {
    const TimeNs waited_ns = wait_.Take();
    if (waited_ns > Lateness::kLateAfterNs)
      services_.lateness().Note(now - std::max(waited_ns, kControlPeriodNs), now);
  }

  NodeServices& services_;
  CpuWait wait_;
  PeriodicTimer timer_;
};

}  // namespace tiltproof::harness
