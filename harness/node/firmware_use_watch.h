// Looks at how much processor time a firmware's processes use: a program, and all that it has started.
//
//   FirmwareUseWatch watch(services);    // after AdoptOrphans()
//   const FirmwareUse use = watch.Take();
#pragma once

#include <sched.h>

#include <algorithm>
#include <utility>

#include "harness/node/node.h"
#include "harness/process/affinity.h"
#include "harness/process/descendants_time.h"
#include "harness/process/orphans.h"
#include "harness/run/firmware_use.h"

namespace tiltproof::harness {

class FirmwareUseWatch {
 public:
  explicit FirmwareUseWatch(NodeServices& services)
      : begin_(services.clock().Now()),
        before_(LookAtDescendants()),
        timer_(services, begin_ + FirmwareUse::kLookEveryNs, FirmwareUse::kLookEveryNs,
               [this](BootTime now) { Look(now); }) {
    cpu_set_t processors;
    CPU_ZERO(&processors);
    if (sched_getaffinity(0, sizeof processors, &processors) == 0)
      use_.processors_count = CPU_COUNT(&processors);
    use_.processors = OwnProcessors();
  }

  FirmwareUse Take() { return std::move(use_); }

 private:
  void Look(BootTime now) {
    ReapOrphans();
    const DescendantsTime all = LookAtDescendants();
    use_.Add({begin_, now, all.run_min_ns - before_.run_max_ns, all.processes_count});
    begin_ = now;
    before_ = all;
  }

  FirmwareUse use_;
  BootTime begin_;
  DescendantsTime before_;
  PeriodicTimer timer_;
};

}  // namespace tiltproof::harness
