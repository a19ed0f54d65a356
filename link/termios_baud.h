// Baud rates that are no POSIX constant (153600, 1843200, ...): Linux takes any integer through termios2,
// whose header cannot stand beside <termios.h>, so this has a file of its own.
//
//   SetAnyBaud(descriptor, 153'600);
//   if (const auto actual = ActualBaud(descriptor)) ...   // what the device made of it
#pragma once

#include <cstdint>
#include <optional>

namespace tiltproof::link {

// Both directions. False, with errno set, when the device refuses.
bool SetAnyBaud(int descriptor, std::uint32_t baud);

// The output rate the kernel reports, in bits per second; nullopt when it reports none.
std::optional<std::uint32_t> ActualBaud(int descriptor);

}  // namespace tiltproof::link
