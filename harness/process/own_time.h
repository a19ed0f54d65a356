// Time that another process has had for itself: the time in which it ran, slept or waited for others. Time
// does not count while it was stopped, or ready to run while others had the processors. Neither does time in
// which the observer was stopped, or one of its threads waited for a processor: the observer may have missed
// what the other process sent.
//
// All limits on how long a process may stay silent are limits on this time:
//
//   OwnTime own(pid);
//   while (!Answered()) {
//     const bool over = own.Look(OwnTime::SteadyClock::now()) > limit_ns;
//     WaitForAnswer(over ? 0ms : OwnTime::kLook);           // once more before giving up
//     if (over && !Answered()) throw ...;
//   }
//
// A process is judged together with all processes that it has started: waiting for a stopped child is no
// better.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <functional>
#include <map>
#include <string>
#include <utility>

#include "link/time.h"

namespace tiltproof::harness {

class OwnTime {
 public:
  using SteadyClock = std::chrono::steady_clock;

  // The time between two looks. A look charges at most twice as much: an observer that looks later was kept
  // from looking.
  static constexpr std::chrono::milliseconds kLook{100};

  // However long the observer had to wait, this share counts: a hang is found on the busiest machine.
  static constexpr int kLeastShare = 10;  // one in ten

  // The time since the last call in which a thread of this process was ready, but had no processor: the longest such
  // time of any thread.
  class OwnDelay {
   public:
    TimeNs operator()();

   private:
    std::map<std::string, TimeNs> threads_;  // in all, by then
  };

  // -1: a process that cannot be observed is charged with all the time in which the observer was awake.
  // `observer_delay`: like an OwnDelay.
  explicit OwnTime(pid_t pid = -1, std::function<TimeNs()> observer_delay = OwnDelay())
      : pid_(pid), observer_delay_(std::move(observer_delay)) {}

  // Its own time since the first look. The first look is cheap: an answer mostly comes before the second.
  TimeNs Look(SteadyClock::time_point now);

  // True if at the last look it had stopped itself (it sent itself the signal), which is its own fault.
  bool stopped_itself() const { return stopped_itself_; }
  // The excuse of the process at the last look: it, or a process that it started, was stopped, or all
  // were without a processor.
  enum class Excuse { kNone, kStopped, kNoProcessor };
  Excuse excuse() const { return excuse_; }
  // The stopped process.
  pid_t stopped_pid() const { return stopped_pid_; }

 private:
  pid_t pid_;
  std::function<TimeNs()> observer_delay_;
  int looks_count_ = 0;
  SteadyClock::time_point last_;
  TimeNs run_ns_ = 0;  // by then
  TimeNs own_ns_ = 0;
  bool stopped_itself_ = false;
  Excuse excuse_ = Excuse::kNone;
  pid_t stopped_pid_ = -1;
};

// Time that a process has computed, with all of its threads. Time in which it was stopped, slept or had no processor
// does not count. 0 when there is no such process.
TimeNs ProcessorTime(pid_t pid);

enum class Input { kReady, kSilent, kStoppedItself, kInterrupted };
enum class OnSignal { kGoOn, kReturn };
// Waits until `descriptor` is readable or at its end (kReady), or `pid`, which is to write to it, has been silent for
// `limit_ns` of its own time. With kReturn, a signal that this thread handles ends the wait, too (kInterrupted).
Input AwaitInput(int descriptor, pid_t pid, TimeNs limit_ns, OnSignal on_signal = OnSignal::kGoOn);

// True if the kernel shows the process as stopped by a signal or a debugger.
bool IsStopped(pid_t pid);
// True if it, or a process that it has started, is stopped, and none of them has stopped itself.
bool IsStoppedByOthers(pid_t pid);

// True if all of its threads are stopped by a signal that it has sent to itself. (The kernel shows the system
// call in which it stopped.)
bool HasStoppedItself(pid_t pid);

}  // namespace tiltproof::harness
