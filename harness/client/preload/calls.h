// The system calls of a program under the virtual clock.
#pragma once

#include <cstdint>

#include "harness/client/preload/kernel.h"

namespace tiltproof::preload {

// Does what the program's call asks for, in virtual time. Returns its result, -errno on error.
long Dispatch(const Call& call);

// The clocks: the functions of the kernel's shared page. Processor time stays that of the machine.
int VirtualClockGettime(int clock, void* time);
int VirtualGettimeofday(void* time, void* zone);
long VirtualTime(long* seconds);

}  // namespace tiltproof::preload
