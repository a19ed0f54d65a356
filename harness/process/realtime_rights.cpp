#include "harness/process/realtime_rights.h"

#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>

namespace tiltproof::harness {
namespace {

// With a limit, a later allocation beyond it would fail and end the node: then rather not at all.
bool MayLockMemory() {
  rlimit limit{};
  return geteuid() == 0 || (getrlimit(RLIMIT_MEMLOCK, &limit) == 0 && limit.rlim_cur == RLIM_INFINITY);
}

}  // namespace

RealtimeRights AcquireRealtimeRights() {
  RealtimeRights rights;
  sched_param parameters{};
  parameters.sched_priority = kRealtimePriority;
  rights.fifo = sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &parameters) == 0;
  rights.locked_memory = MayLockMemory() && mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
  return rights;
}

RealtimeRights ProbeRealtimeRights() {
  RealtimeRights rights;
  const pid_t pid = fork();
  if (pid < 0) return rights;
  if (pid == 0) {
    const RealtimeRights got = AcquireRealtimeRights();
    _exit((got.fifo ? 1 : 0) | (got.locked_memory ? 2 : 0));
  }
  int status = 0;
  while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFEXITED(status)) {
    rights.fifo = (WEXITSTATUS(status) & 1) != 0;
    rights.locked_memory = (WEXITSTATUS(status) & 2) != 0;
  }
  return rights;
}

std::string RealtimeRights::Text() const {
  std::string text = fifo ? "SCHED_FIFO" : "no real-time policy (needs rtprio in /etc/security/limits.conf)";
  text += locked_memory ? ", memory locked" : ", memory not locked (needs memlock unlimited)";
  return text;
}

}  // namespace tiltproof::harness
