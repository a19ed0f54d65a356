// Modes of floating-point arithmetic in this thread: rounding, tiny numbers, traps. Foreign code may change
// them (fesetround, a library built with -ffast-math), and with them every result of the harness.
//
//   const FloatingPointModes ours;  CallOthers();  ours.Restore();
#pragma once

#if defined(__x86_64__)
#include <cstdint>
#else
#include <cfenv>
#endif

namespace tiltproof::harness {

#if defined(__x86_64__)

class FloatingPointModes {
 public:
  FloatingPointModes() {
    asm volatile("fnstcw %0" : "=m"(control_));
    asm volatile("stmxcsr %0" : "=m"(mxcsr_));
  }

  // Sets them where they differ: that is rare, and reading is cheap.
  void Restore() const {
    const FloatingPointModes now;
    if (now.control_ == control_ && ((now.mxcsr_ ^ mxcsr_) & ~kFlags) == 0) return;
    RestoreAll();
  }
  // After a jump out of arbitrary code.
  void RestoreAll() const {
    // Empties the x87 stack, too.
    asm volatile("fninit\n\tfldcw %0" : : "m"(control_));
    asm volatile("ldmxcsr %0" : : "m"(mxcsr_));
  }

 private:
  static constexpr std::uint32_t kFlags = 0x3F;  // exceptions that have occurred; they change no result
  std::uint16_t control_ = 0;
  std::uint32_t mxcsr_ = 0;
};

#else

class FloatingPointModes {
 public:
  FloatingPointModes() { std::fegetenv(&environment_); }
  void Restore() const { std::fesetenv(&environment_); }
  void RestoreAll() const { Restore(); }

 private:
  std::fenv_t environment_;
};

#endif

}  // namespace tiltproof::harness
