// The kernel as the preloaded clock calls it: system calls that its own filter lets pass, and the trap for all others.
//
//   SetTrap({.call = Dispatch, .idle = SpinTick});   // from now on, Dispatch() answers the program's calls
//   Kernel(SYS_read, fd, buffer, size);              // -errno on error; errno itself is left alone
//
// Everything here may run in a signal handler. It uses no heap and no lock.
#pragma once

#include <sys/syscall.h>
#include <ucontext.h>

#include <cstdint>
#include <type_traits>

namespace tiltproof::preload {

// The only place from which the filter lets every system call pass.
extern "C" long tiltproof_kernel(long number, long a, long b, long c, long d, long e, long f);

template <typename T>
long AsWord(T value) {
  if constexpr (std::is_pointer_v<T> || std::is_null_pointer_v<T>) {
    return reinterpret_cast<long>(value);
  } else {
    return static_cast<long>(value);
  }
}

template <typename A = long, typename B = long, typename C = long, typename D = long, typename E = long,
          typename F = long>
long Kernel(long number, A a = 0, B b = 0, C c = 0, D d = 0, E e = 0, F f = 0) {
  return tiltproof_kernel(number, AsWord(a), AsWord(b), AsWord(c), AsWord(d), AsWord(e), AsWord(f));
}

// A system call of the program.
struct Call {
  long number;
  long a[6];
  ucontext_t* context;  // the program's registers and signal mask, restored when the call returns
};

struct Trap {
  long (*call)(const Call& call);  // returns the call's result: -errno on error
  void (*tick)();                  // after each second of processor time
  void (*cycles)();                // the program has read the processor's cycle counter
};

// Signals of which the trap needs each, as a mask of the kernel: the program cannot block them.
inline constexpr std::uint64_t kTrapSignals = 1ULL << 30;  // SIGSYS

// Sends the program's calls, from now on and in all threads, to `trap`. Returns null, or what the kernel refused.
const char* SetTrap(const Trap& trap);
// Makes the kernel's shared page (vDSO) call these functions. Returns null, or what went wrong.
const char* ReplaceSharedPage(int (*clock_gettime)(int, void*), int (*gettimeofday)(void*, void*),
                              long (*time)(long*));
// The program's wish for SIGSEGV, which the trap uses until the program crashes.
long SetSegmentAction(const void* action, void* old);

}  // namespace tiltproof::preload
