// Rights that make a node punctual: a real-time scheduling policy and locked memory. The system grants them.
// Without them everything works, but less evenly.
#pragma once

#include <string>

namespace tiltproof::harness {

// In the middle of the range that user programs use: above all ordinary ones, below the kernel's own threads.
inline constexpr int kRealtimePriority = 20;

struct RealtimeRights {
  bool fifo = false;           // SCHED_FIFO for the calling thread
  bool locked_memory = false;  // no page of this process leaves memory
  // "SCHED_FIFO, memory locked", and what is missing and how to get it.
  std::string Text() const;
};

// Acquires what is permitted, for the calling thread and this process; children inherit neither.
RealtimeRights AcquireRealtimeRights();

// Rights that a node would get, tried in a child process.
RealtimeRights ProbeRealtimeRights();

}  // namespace tiltproof::harness
