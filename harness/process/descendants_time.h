// The processor time that the processes have used which descend from this one: children, their children, and those whose
// parents have ended, in whatever group or session they are.
//
//   AdoptOrphans();                                 // of harness/process/orphans.h, or orphans are not descendants
//   const DescendantsTime before = LookAtDescendants();
//   const TimeNs used_at_least_ns = LookAtDescendants().run_min_ns - before.run_max_ns;
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <vector>

#include "link/time.h"

namespace tiltproof::harness {

struct DescendantsTime {
  // Processor time of all threads together, including those that ended and were waited for. Time of a process that ends
  // during the look is missing in the minimum, or is twice in the maximum. Waited-for time is cut to ticks of 10 ms.
  TimeNs run_min_ns = 0, run_max_ns = 0;
  std::int64_t processes_count = 0;
};

DescendantsTime LookAtDescendants();

// The first kDescendantsMax processes that descend from `pid`, elder generations first. A process whose parent has ended
// descends from the one that adopted it.
std::vector<pid_t> DescendantsOf(pid_t pid);
inline constexpr std::size_t kDescendantsMax = 1000;

}  // namespace tiltproof::harness
