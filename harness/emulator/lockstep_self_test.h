// Tests whether lockstep works with the installed emulator.
//
// The plug-in uses QEMU's internals (harness/emulator/plugin/qemu_internals.h), which may differ in another
// release or another build of the same one. So it is tested before the first flight, on a firmware of a dozen
// instructions: SysTick comes every millisecond, a byte arrives at its time, a stall lasts as long as it
// should, and two runs are equal to the nanosecond.
#pragma once

#include <string>

namespace tiltproof::harness {

// The release that the plug-in is written for.
inline constexpr const char* kLockstepQemuRelease = "7.2";

// "7.2.22" of the qemu-system-arm in PATH. Throws NoSuchProgram when there is none,
// std::runtime_error when it cannot be started or says something else.
std::string QemuVersion();

// The plug-in fits the installed emulator. Throws std::runtime_error that says what does not.
void CheckRelease();

// Takes a few tenths of a second. Throws std::runtime_error that says what is wrong and what to do about it.
void TestLockstep(const std::string& plugin);

}  // namespace tiltproof::harness
