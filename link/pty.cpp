#include "link/pty.h"

#include <fcntl.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace tiltproof::link {

Pty::Pty(boost::asio::io_context& loop) {
  const int master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  std::array<char, 64> path{};
  struct termios settings {};
  if (master >= 0 && grantpt(master) == 0 && unlockpt(master) == 0 &&
      ptsname_r(master, path.data(), path.size()) == 0)
    slave_ = open(path.data(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (slave_ >= 0 && tcgetattr(slave_, &settings) == 0) {
    cfmakeraw(&settings);
    if (tcsetattr(slave_, TCSANOW, &settings) == 0) {
      slave_path_ = path.data();
      master_ = std::make_unique<SerialPort>(loop, master, "the line at " + slave_path_);
      return;
    }
  }
  const std::string why = std::strerror(errno);
  if (slave_ >= 0) close(slave_);
  if (master >= 0) close(master);
  throw std::runtime_error("cannot make a pseudo-terminal: " + why +
                           "; is /dev/pts mounted, and are there free ones (/proc/sys/kernel/pty/nr, max)?");
}

Pty::~Pty() { close(slave_); }

}  // namespace tiltproof::link
