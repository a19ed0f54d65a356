// On which of the machine's processors another process may run.
#pragma once

#include <sched.h>
#include <sys/types.h>

namespace tiltproof::harness {

// All its threads that exist now. What the system refuses stays as it was.
void AllowProcessors(pid_t pid, const cpu_set_t& processors);

}  // namespace tiltproof::harness
