// Timers of the program in virtual time: setitimer(), alarm(), timer_create() and timerfd_create().
//
// A timer descriptor is an event descriptor of the kernel, so that poll(), select() and epoll wait for it. A timer with a signal
// sends it when it is due.
#pragma once

#include <cstdint>
#include <ctime>

namespace tiltproof::preload {

// When the next one is due, in the time of Now(); kNever without one.
std::int64_t NextTimer();
// Runs those that are due.
void ExpireTimers();

// Each call returns as the system call does: -errno on error. kNoTimer: the descriptor is no timer of this module's.
inline constexpr long kNoTimer = -4096;
long CreateTimerDescriptor(int clock, int flags);
long SetTimerDescriptor(long descriptor, int flags, const itimerspec* value, itimerspec* old);
long GetTimerDescriptor(long descriptor, itimerspec* value);
void CloseTimerDescriptor(long descriptor);

// `event`: sigevent of the kernel, or null (SIGALRM). `id`: int of the kernel.
long CreateTimer(int clock, const void* event, int* id);
long SetTimer(int id, int flags, const itimerspec* value, itimerspec* old);
long GetTimer(int id, itimerspec* value);
long DeleteTimer(int id);

// The signal by which the C library's own thread waits for timers that start threads (SIGEV_THREAD).
inline constexpr int kTimerHelperSignal = 32;
[[noreturn]] void RefuseTimerThreads();

// The timer of setitimer(ITIMER_REAL) and alarm(): SetTimer() and GetTimer() take it.
inline constexpr int kIntervalTimer = 0;

}  // namespace tiltproof::preload
