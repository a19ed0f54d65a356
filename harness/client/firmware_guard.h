// Calls into code under test that may crash or never return, without dying with it.
//
// A worker process flies one scenario and then exits, so its guard may do what a long-lived process must not:
// a fatal signal raised while the firmware runs, or a firmware call that lasts longer than the limit, jumps
// back here and becomes an exception; the flight so far is kept and scored. Signals raised outside guarded
// code keep their default action.
//
//   FirmwareGuard::Install();                                   // once a process
//   TimeNs wake = FirmwareGuard::Call([&] { return grant(now); });   // may throw FirmwareTrouble
#pragma once

#include <csetjmp>
#include <csignal>
#include <stdexcept>
#include <string>
#include <type_traits>

namespace tiltproof::harness {

// The firmware under test did what firmware must not: its own fault, never the harness's.
struct FirmwareTrouble : std::runtime_error {
  FirmwareTrouble(bool hung_in, const std::string& text) : std::runtime_error(text), hung(hung_in) {}
  bool hung;  // else crashed
};

class FirmwareGuard {
 public:
  // Wall-clock time after which a call counts as hung.
  static constexpr int kHungAfter_s = 5;

  // Handlers on a stack of their own for SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, and a one-second interval
  // timer (SIGALRM).
  static void Install();

  template <class Function>
  static auto Call(const Function& function) {
    if (sigsetjmp(jump_, 0) != 0) Throw();
    // No object with a destructor here: the jump would not run it.
    Enter();
    if constexpr (std::is_void_v<decltype(function())>) {
      function();
      Leave();
    } else {
      const auto result = function();
      Leave();
      return result;
    }
  }

  // While guarded code calls back into the harness, signals are the harness's own again.
  class Outside {
   public:
    Outside() : was_inside_(inside_) { inside_ = 0; }
    // A firmware that calls back without end spends most of its time in here, and is over its limit all the
    // same.
    ~Outside() {
      inside_ = was_inside_;
      if (inside_ != 0 && ticks_ > kHungAfter_s) OnSignal(SIGALRM);
    }
    Outside(const Outside&) = delete;
    Outside& operator=(const Outside&) = delete;

   private:
    sig_atomic_t was_inside_;
  };

 private:
  static void Enter() {
    ticks_ = 0;
    inside_ = 1;
  }
  static void Leave() { inside_ = 0; }
  static void OnSignal(int signal_number);
  [[noreturn]] static void Throw();

  static sigjmp_buf jump_;
  static volatile sig_atomic_t inside_;
  static volatile sig_atomic_t ticks_;  // of the timer within the present call
  static volatile sig_atomic_t caught_signal_;
};

}  // namespace tiltproof::harness
