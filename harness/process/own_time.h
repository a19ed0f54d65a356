// How much time another process has had for itself: what it ran, slept and waited for others. When it was stopped, or
// ready to run while others had the processors, that was not its own; nor is it when the one who looks was stopped.
//
// All limits on how long a process may stay silent are limits on this time:
//
//   OwnTime own(pid);
//   while (!Answered()) {
//     const bool over = own.Look(SteadyClock::now()) > limit_ns;
//     WaitForAnswer(over ? 0 : OwnTime::kLook);             // once more before giving up
//     if (over && !Answered()) throw ...;
//   }
//
// A process is taken with all that it has started: one that waits for a stopped child is no better off.
#pragma once

#include <sys/types.h>

#include <chrono>

#include "link/time.h"

namespace tiltproof::harness {

class OwnTime {
 public:
  using SteadyClock = std::chrono::steady_clock;

  // How often to look. No more than twice as much is charged at once: who looks later was kept from it.
  static constexpr std::chrono::milliseconds kLook{100};

  // -1: a process that cannot be seen is charged with all time in which the one who looks was awake.
  explicit OwnTime(pid_t pid = -1) : pid_(pid) {}

  // Its own time since the first look. The first is cheap: an answer mostly comes before the second.
  TimeNs Look(SteadyClock::time_point now);

  // Of the last look: it has stopped itself (it sent itself the signal), which is its own doing.
  bool stopped_itself() const { return stopped_itself_; }
  // Of the last look: it, or one that it started, is stopped; or all are without a processor.
  enum class Excuse { kNone, kStopped, kNoProcessor };
  Excuse excuse() const { return excuse_; }
  // The stopped one.
  pid_t stopped_pid() const { return stopped_pid_; }

 private:
  pid_t pid_;
  int looks_count_ = 0;
  SteadyClock::time_point last_;
  TimeNs run_ns_ = 0;  // by then
  TimeNs own_ns_ = 0;
  bool stopped_itself_ = false;
  Excuse excuse_ = Excuse::kNone;
  pid_t stopped_pid_ = -1;
};

enum class Input { kReady, kSilent, kStoppedItself };
// Waits until `descriptor` is readable or at its end (kReady), or `pid`, which is to write to it, has been silent for
// `limit_ns` of its own time.
Input AwaitInput(int descriptor, pid_t pid, TimeNs limit_ns);

// Stopped by a signal or a debugger, as the kernel shows it.
bool IsStopped(pid_t pid);
// It, or one that it has started, is stopped, and has not stopped itself.
bool IsStoppedByOthers(pid_t pid);

// Stopped, every one of its threads, by a signal that it has sent to itself. (The kernel shows the call in which it
// stands still.)
bool HasStoppedItself(pid_t pid);

}  // namespace tiltproof::harness
