// Baud rates that are not POSIX constants (153600, 1843200, ...). Linux accepts any integer through termios2,
// whose header cannot be included together with <termios.h>. So this code has its own file.
//
//   SetAnyBaud(descriptor, 153'600);
//   if (const auto actual = ActualBaud(descriptor)) ...   // the rate that the device really uses
#pragma once

#include <cstdint>
#include <optional>

namespace tiltproof::link {

// Sets both directions. False, with errno set, when the device refuses.
bool SetAnyBaud(int descriptor, std::uint32_t baud);

// The output rate the kernel reports, in bits per second; nullopt when it reports none.
std::optional<std::uint32_t> ActualBaud(int descriptor);

}  // namespace tiltproof::link
