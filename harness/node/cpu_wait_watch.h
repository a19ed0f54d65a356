// Notes as lateness of this machine when it lets an emulator wait for a processor, within a control period, for longer
// than a node may be late.
#pragma once

#include "harness/node/cpu_wait.h"
#include "harness/node/node.h"

namespace tiltproof::harness {

class CpuWaitWatch {
 public:
  CpuWaitWatch(NodeServices& services, pid_t pid)
      : wait_(pid),
        timer_(services, services.clock().Now() + kControlPeriodNs, kControlPeriodNs,
               [this, &services](TimeNs now) { services.lateness().Note(now - wait_.Take(), now); }) {}

 private:
  CpuWait wait_;
  PeriodicTimer timer_;
};

}  // namespace tiltproof::harness
