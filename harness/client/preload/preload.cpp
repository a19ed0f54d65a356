// The virtual clock of `--client 'clocked:CMD'`: a library that the dynamic linker loads before the program's own code (LD_PRELOAD).
//
//   TILTPROOF_SOCKET                           the harness's socket (docs/program.md)
//   TILTPROOF_PORT, TILTPROOF_REFERENCE_PORT   paths of the serial ports, which exist for this program only
//
// Without these variables it does nothing. It traps the program's system calls (seccomp) and answers those that wait or tell
// the time, so that a program needs no change, and none of the C library's functions needs to be known.
#include <sys/personality.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "harness/client/preload/calls.h"
#include "harness/client/preload/harness_line.h"
#include "harness/client/preload/kernel.h"
#include "harness/client/preload/launchers.h"
#include "harness/client/preload/ports.h"
#include "harness/client/preload/threads.h"
#include "harness/client/preload/timers.h"

namespace tiltproof::preload {
namespace {

bool IsInLauncher() {
  char file[4096] = {};
  if (readlink("/proc/self/exe", file, sizeof file - 1) < 0) return false;
  const char* slash = std::strrchr(file, '/');
  return slash != nullptr && IsLauncher(slash + 1);
}

void RefuseIf(const char* trouble) {
  if (trouble != nullptr) Refuse(trouble);
}

__attribute__((constructor)) void Begin() {
  const char* const socket = std::getenv("TILTPROOF_SOCKET");
  const char* const port = std::getenv("TILTPROOF_PORT");
  const char* const reference_port = std::getenv("TILTPROOF_REFERENCE_PORT");
  if (socket == nullptr || *socket == 0 || port == nullptr || reference_port == nullptr) return;
  // Helpers of a script that starts the firmware (`exec`) are processes of their own, and no firmware.
  if (getpid() != getpgrp()) return;
  if (IsInLauncher()) {
    // The same addresses in each flight: a program may sort by them. Holds from the next exec on.
    personality(static_cast<unsigned long>(personality(0xffffffff)) | ADDR_NO_RANDOMIZE);
    return;
  }
  RefuseIf(Connect(socket));
  RefuseIf(MakePorts(port, reference_port));
  // A flight ends at once, and a line that the program has printed is kept.
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  BeginThreads({ReceiveBytes, ExpireTimers, NextTimer}, FirstGrant(ReceiveBytes));
  RefuseIf(ReplaceSharedPage(VirtualClockGettime, VirtualGettimeofday, VirtualTime));
  RefuseIf(SetTrap({.call = Dispatch, .tick = CheckProgress, .cycles = [] {
                      Refuse(
                          "it reads the processor's cycle counter (rdtsc), which counts the machine's time");
                    }}));
}

}  // namespace
}  // namespace tiltproof::preload
