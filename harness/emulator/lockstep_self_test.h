// Whether lockstep works with the emulator that is installed.
//
// The plug-in uses QEMU's insides (harness/emulator/plugin/qemu_internals.h), which another release, or another
// build of the same one, may have changed. So it is tried out before the first flight, on a firmware of a dozen
// instructions: SysTick comes every millisecond, a byte arrives at its time, a stall lasts as long as it should, and
// two runs are equal to the nanosecond.
#pragma once

#include <string>

namespace tiltproof::harness {

// The release that the plug-in is written for.
inline constexpr const char* kLockstepQemuRelease = "7.2";

// "7.2.22" of the qemu-system-arm in PATH. Throws NoSuchProgram when there is none,
// std::runtime_error when it cannot be started or says something else.
std::string QemuVersion();

// Takes a few tenths of a second. Throws std::runtime_error that says what is wrong and what to do instead.
void TestLockstep(const std::string& plugin);

}  // namespace tiltproof::harness
