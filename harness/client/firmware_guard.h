// Guards calls into code under test that may crash, end the process or never return, so that this process
// survives them.
//
// A process that flies a library may do what a long-lived one must not. A fatal signal raised while the
// firmware runs, a call that lasts longer than the limit, and a call of exit() or exec
// (harness/client/process_end.cpp) jump back here and become an exception. The flight so far is kept and
// scored. Signals raised outside guarded code keep their default action. The harness's floating-point modes
// are restored after every call, however it ended.
//
//   FirmwareGuard::Install();                                                   // before each flight
//   TimeNs wake = FirmwareGuard::Call(FirmwareCall::kGrant, [&] { return grant(now); });     // may throw FirmwareTrouble
//
// This guard cannot handle a firmware that blocks signals or stops the process. For that, Watched tells
// another process where the firmware is.
#pragma once

#include <atomic>
#include <csetjmp>
#include <csignal>
#include <cstdint>
#include <exception>
#include <string_view>
#include <type_traits>

#include "harness/client/code_place.h"
#include "harness/client/firmware_end.h"
#include "harness/client/floating_point.h"
#include "link/time.h"

namespace tiltproof::harness {

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
  kRole,
  kDestroy
};
// The name of the function: "tiltproof_client_grant".
std::string_view Name(FirmwareCall call);

class FirmwareGuard {
 public:
  // Limit on the firmware's own time. No such time passes while its thread waits for a processor or the
  // process is stopped; while it has called back, only the harness's computing time for it does.
  static constexpr TimeNs kHungAfterNs = 5 * kNsPerS;
  // After this time the guard has ended the call, or never will.
  static constexpr TimeNs kUnreachableAfterNs = kHungAfterNs + 2 * kNsPerS;

  // Where the firmware is. In memory shared between processes, so that another one can see it.
  struct Watched {
    std::atomic<std::uint64_t> calls_count{0};              // begun
    std::atomic<FirmwareCall> inside{FirmwareCall::kNone};  // the current one
    // Set by the other process, which then sends SIGALRM: ends the call as that of a firmware that has
    // stopped itself.
    std::atomic<bool> stopped_itself{false};
    // Place where a thread that the firmware has started took the process with it. Unknown: none did.
    CodePlace thread_crash_place{};
  };

  // For calls from this thread: handlers, on their own stack, for the signals of a crash, and a timer.
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

  // For calls back from the firmware: harness code again, with the harness's signals and floating-point
  // modes. An exception does not pass through the firmware's frames: the current call throws it.
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

  // Ends the current call, as that of a firmware that "called exit(3)". Returns when there is none: outside
  // of a call, in another thread, in a process that the firmware has forked.
  static void EndCall(const char* what, const CodePlace& place = {});

  // True in the thread that calls the firmware, and in every thread where nothing is guarded. Only it may call back.
  static bool IsGuardedThread();
  // For a call back from another thread: the present call, or the next, ends as that of a firmware that did so.
  // Async-signal-safe.
  static void NoteForeignCallBack(const char* function);

  // The library in which places of crashes are looked for: an address in it. Null: none.
  static void SetFirmware(const void* address);
  // True for the address at which that library is loaded.
  static bool IsFirmwares(const void* base);
  // The place in it where the last call crashed, in one of its functions or in what they called. Unknown when the call ended
  // in another way, too.
  static const CodePlace& CrashPlace();

  // True if a call in this process has ended by a jump or an exception: its unfinished work stays as it was.
  static bool HasLeftCalls() { return has_left_calls_; }

 private:
  enum Cause { kCrashed = 1, kHung, kStoppedItself, kEnded, kHarnessError };

  static bool IsInside();
  static void Enter(FirmwareCall call);
  static void Leave();
  static FloatingPointModes LeaveForCallBack();
  static void ReturnToFirmware();
  [[noreturn]] static void ThrowFromCallBack();
  static void NoteException(const char* what);
  static void OnCrash(int signal_number, siginfo_t* info, void* context);
  static void OnTimer(int signal_number);
  static void CountOwnTime();
  [[noreturn]] static void Jump(Cause cause);
  [[noreturn]] static void Throw();

  static sigjmp_buf jump_;
  static FloatingPointModes modes_;  // the harness's
  static std::exception_ptr error_;  // from a call back
  static bool has_left_calls_;
};

}  // namespace tiltproof::harness
