// The time that a program has been ready to run while others had the processor. A busy machine causes it, not the
// program. An emulator has no real-time priority, so the lateness of the harness's own nodes does not show it.
//
// The program's own threads also wait for each other, briefly and often: Take() subtracts that time
// (kOwnWaitNs) from every wait.
//
//   CpuWait wait(pid);
//   if (const TimeNs waited = wait.Take(since_last_ns); waited > late_after_ns) NoteLateness(now - waited, now);
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "link/time.h"
#include "link/unix_socket.h"

namespace tiltproof::harness {

class CpuWait {
 public:
  // kFamily: with all processes that it has started.
  enum class Of { kProcess, kFamily };
  explicit CpuWait(pid_t pid, Of of = Of::kProcess);

  static constexpr TimeNs kOwnWaitNs = 50 * kNsPerUs;

  // The wait since the last call, which was `since_last_ns` ago, of all threads of a process together, and of the
  // process in which it is longest; 0 where the kernel does not report it (/proc/PID/task/TID/schedstat). The kernel reports a wait when it is over. A thread that was ready and did
  // not run at all has waited all the time: a flight may end before it runs again. New threads and processes are looked for
  // on every kCallsPerLook-th call; the first kThreadsMax count.
  TimeNs Take(TimeNs since_last_ns);
  static constexpr int kCallsPerLook = 32;
  static constexpr std::size_t kThreadsMax = 100;  // each has two open files

 private:
  struct Waits {
    TimeNs run_ns = 0, total_ns = 0;
    std::int64_t count = 0;
    bool operator==(const Waits&) const = default;
  };
  struct Thread {
    pid_t pid = 0;  // of its process
    link::OwnedDescriptor schedstat, stat;
    Waits seen;
    TimeNs still_ns = 0;    // ready, without a change of its counters
    TimeNs counted_ns = 0;  // of it, as a wait that is not over yet
  };
  // Nullopt: the thread has ended.
  static std::optional<Waits> Read(int descriptor);
  static bool IsReady(int descriptor);
  void Look();
  void LookAt(pid_t pid);

  pid_t pid_;
  Of of_;
  bool counts_ = false;                    // the kernel
  std::map<std::string, Thread> threads_;  // by id
  int calls_count_ = 0;
};

}  // namespace tiltproof::harness
