#include "link/termios_baud.h"

#include <asm/termbits.h>
#include <sys/ioctl.h>

namespace tiltproof::link {

bool SetAnyBaud(int descriptor, std::uint32_t baud) {
  struct termios2 settings {};
  if (ioctl(descriptor, TCGETS2, &settings) != 0) return false;
  // No input rate of its own (CIBAUD): it follows the output rate.
  settings.c_cflag &= ~static_cast<tcflag_t>(CBAUD | CIBAUD);
  settings.c_cflag |= BOTHER;
  settings.c_ispeed = baud;
  settings.c_ospeed = baud;
  return ioctl(descriptor, TCSETS2, &settings) == 0;
}

std::optional<std::uint32_t> ActualBaud(int descriptor) {
  struct termios2 settings {};
  if (ioctl(descriptor, TCGETS2, &settings) != 0) return std::nullopt;
  return settings.c_ospeed;
}

}  // namespace tiltproof::link
