// Handles a failure of the firmware: the reason is written where a reset preserves it
// (`tiltproof_fault_record`, symbols.h), the board is reset, and the next start prints it on the console.
//
//       0.000105 restarted after bus fault at pc=0x08000b3e lr=0x08000b31 cfsr=0x00008200 address=0x60000000 (fault 1)
//
// A reset by the watchdog leaves no record, only its flag.
#pragma once

#include <cstdint>

#include "firmware/ports/stm32f4/board.h"
#include "firmware/ports/stm32f4/symbols.h"

namespace tiltproof::stm32f4 {

// Records the cause and the caller's address, and resets. `cause` is one of symbols.h's.
[[noreturn]] void Fail(std::uint32_t cause);

// Once at the start, when the console works.
void ReportRestart(ResetReason reason);

}  // namespace tiltproof::stm32f4
