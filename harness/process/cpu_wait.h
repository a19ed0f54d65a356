// The time that a program has been ready to run while others had the processor. A busy machine causes it, not
// the program. An emulator has no real-time priority, so the lateness of the harness's own nodes does not
// show it.
//
// The program's own threads also wait for each other, briefly and often: Take() subtracts that time
// (kOwnWaitNs) from every wait.
//
//   CpuWait wait(pid);
//   if (const TimeNs waited = wait.Take(); waited > late_after_ns) NoteLateness(now - waited, now);
#pragma once

#include <sys/types.h>

#include <map>
#include <string>

#include "link/time.h"
#include "link/unix_socket.h"

namespace tiltproof::harness {

class CpuWait {
 public:
  explicit CpuWait(pid_t pid);

  static constexpr TimeNs kOwnWaitNs = 50 * kNsPerUs;

  // The wait since the last call, of all threads together; 0 where the kernel does not report it
  // (/proc/PID/task/TID/schedstat). A wait counts when it is over. New threads are looked for on every
  // kCallsPerLook-th call.
  TimeNs Take();
  static constexpr int kCallsPerLook = 32;

 private:
  struct Waits {
    TimeNs total_ns = 0;
    std::int64_t count = 0;
  };
  struct Thread {
    link::OwnedDescriptor file;
    Waits seen;
  };
  static Waits Read(int descriptor);
  void Look();

  pid_t pid_;
  std::map<std::string, Thread> threads_;  // by id
  int calls_count_ = 0;
};

}  // namespace tiltproof::harness
