// Calls into code under test that may crash, end the process or never return, without dying with it.
//
// A process that flies a library may do what a long-lived one must not: a fatal signal raised while the firmware runs,
// a call that lasts longer than the limit, and a call of exit() or exec (harness/client/process_end.cpp) jump back here
// and become an exception; the flight so far is kept and scored. Signals raised outside guarded code keep their default
// action. The harness's floating-point modes are in force again after every call, however it ended.
//
//   FirmwareGuard::Install();                                                   // once a process
//   TimeNs wake = FirmwareGuard::Call(FirmwareCall::kGrant, [&] { return grant(now); });     // may throw FirmwareTrouble
//
// A firmware that holds off signals, or stops the process, is beyond this guard: for that, Watched tells another process
// where the firmware is.
#pragma once

#include <atomic>
#include <csetjmp>
#include <csignal>
#include <cstdint>
#include <exception>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>

#include "harness/client/floating_point.h"
#include "link/time.h"

namespace tiltproof::harness {

// The firmware under test did what firmware must not: its own fault, never the harness's.
struct FirmwareTrouble : std::runtime_error {
  FirmwareTrouble(bool hung_in, const std::string& text) : std::runtime_error(text), hung(hung_in) {}
  bool hung;  // else crashed
};

// Into the firmware.
enum class FirmwareCall : std::uint8_t {
  kNone,
  kLoad,
  kVersion,
  kCreate,
  kStart,
  kReceive,
  kGrant,
  kReset,
  kStatus,
  kDestroy
};
// Of the function: "tiltproof_client_grant".
std::string_view Name(FirmwareCall call);

class FirmwareGuard {
 public:
  // Of the firmware's own time: none passes while its thread waits for a processor or the process is stopped, and while
  // it has called back, only what the harness computes for it.
  static constexpr TimeNs kHungAfterNs = 5 * kNsPerS;
  // By then the guard has ended the call, or never will.
  static constexpr TimeNs kUnreachableAfterNs = kHungAfterNs + 2 * kNsPerS;

  // Where the firmware is. In memory that processes share, for another one to see.
  struct Watched {
    std::atomic<std::uint64_t> calls_count{0};              // begun
    std::atomic<FirmwareCall> inside{FirmwareCall::kNone};  // the one under way
    // Set by the other one, which then sends SIGALRM: ends the call as that of a firmware that has stopped itself.
    std::atomic<bool> stopped_itself{false};
  };

  // For calls from this thread: handlers, on a stack of their own, for the signals of a crash, and a timer.
  static void Install(Watched* watched = nullptr, TimeNs hung_after_ns = kHungAfterNs);

  template <class Function>
  static auto Call(FirmwareCall call, const Function& function) {
    if (sigsetjmp(jump_, 0) != 0) Throw();
    // No object with a destructor here: the jump would not run it.
    Enter(call);
    try {
      if constexpr (std::is_void_v<decltype(function())>) {
        function();
        return Leave();
      } else {
        const auto result = function();
        Leave();
        return result;
      }
    } catch (const std::exception& error) {
      NoteException(error.what());
    } catch (...) {
      NoteException("of a type of its own");
    }
    Throw();
  }

  // What the firmware calls back: harness again, its signals and its floating-point modes. An exception does not pass
  // through the firmware's frames: the call under way throws it.
  template <class Function>
  static auto CallBack(const Function& function) {
    if (!IsInside()) return function();
    const FloatingPointModes firmwares = LeaveForCallBack();
    try {
      const auto result = function();
      ReturnToFirmware();
      firmwares.Restore();
      return result;
    } catch (...) {
      error_ = std::current_exception();
    }
    ThrowFromCallBack();
  }

  // Ends the call under way, as that of a firmware that "called exit(3)". Returns when there is none: outside of one,
  // in another thread, in a process that the firmware has forked.
  static void EndCall(const char* what);

 private:
  enum Cause { kCrashed = 1, kHung, kStoppedItself, kEnded, kHarnessError };

  static bool IsInside();
  static void Enter(FirmwareCall call);
  static void Leave();
  static FloatingPointModes LeaveForCallBack();
  static void ReturnToFirmware();
  [[noreturn]] static void ThrowFromCallBack();
  static void NoteException(const char* what);
  static void OnCrash(int signal_number);
  static void OnTimer(int signal_number);
  static void CountOwnTime();
  [[noreturn]] static void Jump(Cause cause);
  [[noreturn]] static void Throw();

  static sigjmp_buf jump_;
  static FloatingPointModes modes_;  // the harness's
  static std::exception_ptr error_;  // of a call back
};

}  // namespace tiltproof::harness
