// On which of the machine's processors a process may run.
#pragma once

#include <sched.h>
#include <sys/types.h>

#include <string>

namespace tiltproof::harness {

// All its threads that exist now. What the system refuses stays as it was.
void AllowProcessors(pid_t pid, const cpu_set_t& processors);

// The processors of this process: those of which machine, since which of its boots. Two processes with the same text can
// take them from each other. Empty where the kernel does not say.
std::string OwnProcessors();

}  // namespace tiltproof::harness
