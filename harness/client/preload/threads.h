// The threads of the program, of which one runs at a time, and their waits in virtual time.
//
// A thread runs until it waits. Then the first one that is ready goes on, in the order in which they became ready. When none is
// ready, the clock moves to the earliest deadline, or as far as the harness grants it.
//
//   Wait(Now() + 1'000'000, nullptr, nullptr);      // sleeps for 1 ms
//   Wait(kNever, HasBytes, &port);                  // until HasBytes(&port) is true
//
// All functions but Now() are for the thread that runs, in a system call of its own.
#pragma once

#include <ucontext.h>

#include <cstdint>
#include <ctime>

#include "harness/client/preload/harness_line.h"

namespace tiltproof::preload {

enum class Woken { kByCheck, kByDeadline, kBySignal };

// Looked at whenever no thread is ready; must not wait. True: the thread goes on.
using CheckFunction = bool (*)(void* argument);

std::int64_t Now();
// The real-time clock at power-on, of every flight: 1 January 2026, 00:00 UTC.
inline constexpr std::int64_t kEpochSeconds = 1'767'225'600;
// A time-out as Now() counts; null: never. A realtime one is on the real-time clock when it is absolute.
std::int64_t DeadlineOf(const timespec* timeout, bool absolute, bool realtime);

// Makes the calling thread the first. `sink` takes the bytes of ports, `expire` runs the timers that are due, and `next_ns` is
// when the next one is.
struct Surroundings {
  ByteSink sink;
  void (*expire)();
  std::int64_t (*next_ns)();
};
void BeginThreads(const Surroundings& surroundings, std::int64_t now_ns);

// True: the calling thread is one that Wait() knows.
bool IsKnownThread();
Woken Wait(std::int64_t deadline_ns, CheckFunction check, void* argument, ucontext_t* context);
// The same for a signal of the mask, which the thread blocks; kBySignal: it, or another one, may be pending.
Woken WaitForSignal(std::int64_t deadline_ns, std::uint64_t mask, ucontext_t* context);
// The others that are ready run first.
void Yield();
// The calling thread ends now: another one runs, and SYS_exit must follow.
void LeaveThread();

// Futexes (futex(2)): the kernel's locks under all those of the C library.
long Futex(const long (&arguments)[6], ucontext_t* context);

// A signal has been sent to this process, or with a `tid` to a thread: a thread that does not block it, or waits for it, stops
// waiting.
void InterruptFor(int signal, int tid);

// Counts a call that got the program nowhere, as it does when it spins; refuses the program when there are too many in an
// instant. A weight of 1 is a reading of the clock.
inline constexpr int kFutileCall = 250;
void CountFutile(int weight);
// Called once for each second of processor time.
void CheckProgress();

}  // namespace tiltproof::preload
