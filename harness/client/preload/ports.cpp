#include "harness/client/preload/ports.h"

#include <asm/ioctls.h>
#include <asm/termbits.h>
#include <fcntl.h>
#include <linux/serial.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

#include "harness/client/preload/harness_line.h"
#include "harness/client/preload/kernel.h"
#include "harness/client/preload/threads.h"

namespace tiltproof::preload {
namespace {

constexpr int kDescriptorsMax = 65536;
// The kernel's own limit of a terminal.
constexpr int kInputMax = 4095;
constexpr int kModemLines = 0x002 | 0x004 | 0x020 | 0x040 | 0x100;  // DTR, RTS, CTS, CAR, DSR of the kernel

struct Port {
  char path[256];
  int program_end, own_end;
  int open_count;
  termios settings;
  std::int64_t sent_ns;  // when the last stop bit leaves
};
constexpr int kPorts = 2;
Port ports[kPorts];
signed char uart_of[kDescriptorsMax];  // 1 + UART

long InputCount(const Port& port) {
  int count = 0;
  return Kernel(SYS_ioctl, port.program_end, FIONREAD, &count) < 0 ? 0 : count;
}

const char* MakePort(Port& port, const char* path) {
  if (std::strlen(path) >= sizeof port.path) return "the path of a port is too long";
  std::strcpy(port.path, path);
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
    return "there are no descriptors for ports";
  port.program_end = AboveOthers(ends[0]);
  port.own_end = AboveOthers(ends[1]);
  // Raw, as a serial port that a program of another kind has used before.
  port.settings.c_cflag = B115200 | CS8 | CREAD | CLOCAL;
  port.settings.c_cc[VMIN] = 1;
  return nullptr;
}

// A port without line editing, echo and translation: a serial line of bytes.
void CheckSettings(const Port& port) {
  if ((port.settings.c_lflag & (ICANON | ECHO)) != 0 ||
      (port.settings.c_iflag & (ICRNL | IXON | ISTRIP)) != 0 || (port.settings.c_oflag & OPOST) != 0)
    Refuse(
        "it sets a serial port to line editing or translation, which would damage bytes; call cfmakeraw()");
}

struct InputWait {
  const Port* port;
  long count;
};
bool HasInput(void* raw) {
  const auto* wait = static_cast<const InputWait*>(raw);
  return InputCount(*wait->port) >= wait->count;
}

}  // namespace

const char* MakePorts(const char* path, const char* reference_path) {
  const char* const trouble = MakePort(ports[0], path);
  return trouble != nullptr ? trouble : MakePort(ports[1], reference_path);
}

bool IsPortPath(const char* path) {
  for (const Port& port : ports)
    if (path != nullptr && std::strcmp(path, port.path) == 0) return true;
  return false;
}

void ReceiveBytes(int uart, const unsigned char* bytes, std::size_t count) {
  if (uart >= kPorts) return;
  const Port& port = ports[uart];
  if (port.open_count == 0) return;
  const long room = kInputMax - InputCount(port);
  if (room <= 0) return;
  if (count > static_cast<std::size_t>(room)) count = static_cast<std::size_t>(room);
  Kernel(SYS_sendto, port.own_end, bytes, count, static_cast<int>(MSG_DONTWAIT | MSG_NOSIGNAL), nullptr, 0);
}

int PortOf(long descriptor) {
  return descriptor >= 0 && descriptor < kDescriptorsMax ? uart_of[descriptor] - 1 : -1;
}

long OpenPort(const char* path, int flags) {
  for (int uart = 0; uart < kPorts; ++uart) {
    Port& port = ports[uart];
    if (std::strcmp(path, port.path) != 0) continue;
    const int close_on_exec = (flags & O_CLOEXEC) != 0 ? F_DUPFD_CLOEXEC : F_DUPFD;
    const long descriptor = Kernel(SYS_fcntl, port.program_end, close_on_exec, 0);
    if (descriptor < 0) return descriptor;
    Kernel(SYS_fcntl, port.program_end, F_SETFL, O_RDWR | (flags & O_NONBLOCK));
    if (descriptor >= kDescriptorsMax) Refuse("it opens a serial port as descriptor 65536 or above");
    uart_of[descriptor] = static_cast<signed char>(uart + 1);
    ++port.open_count;
    return descriptor;
  }
  return -1;
}

void NoteCopy(long from, long copy) {
  if (copy < 0 || copy == from) return;
  NoteClosed(copy);
  const int uart = PortOf(from);
  if (uart < 0) return;
  if (copy >= kDescriptorsMax) Refuse("it opens a serial port as descriptor 65536 or above");
  uart_of[copy] = static_cast<signed char>(uart + 1);
  ++ports[uart].open_count;
}

void NoteClosed(long descriptor) {
  const int uart = PortOf(descriptor);
  if (uart < 0) return;
  uart_of[descriptor] = 0;
  --ports[uart].open_count;
}

long WritePort(int uart, const iovec* parts, int count) {
  Port& port = ports[uart];
  long written = 0;
  for (int i = 0; i < count; ++i) {
    Transmit(uart, Now(), static_cast<const unsigned char*>(parts[i].iov_base), parts[i].iov_len);
    written += static_cast<long>(parts[i].iov_len);
  }
  const UartRate rate = RateOf(uart);
  if (port.sent_ns < Now()) port.sent_ns = Now();
  if (rate.baud > 0) port.sent_ns += (written * rate.character_bits * kSecond + rate.baud - 1) / rate.baud;
  return written;
}

long ReadPort(int uart, long descriptor, const iovec* parts, int count, ucontext_t* context) {
  const Port& port = ports[uart];
  long wanted = 0;
  for (int i = 0; i < count; ++i) wanted += static_cast<long>(parts[i].iov_len);
  if (wanted == 0) return 0;
  const bool waits = (Kernel(SYS_fcntl, descriptor, F_GETFL) & O_NONBLOCK) == 0;
  const long least = port.settings.c_cc[VMIN] < wanted ? port.settings.c_cc[VMIN] : wanted;
  const std::int64_t time_ns = port.settings.c_cc[VTIME] * (kSecond / 10);
  if (!waits && InputCount(port) == 0) {
    CountFutile(kFutileCall);
    return least == 0 && time_ns == 0 ? 0 : -EAGAIN;
  }
  if (waits) {
    // Without VMIN the time runs from the call; with it, between bytes (termios(3)).
    InputWait wait = {&port, least == 0 || time_ns > 0 ? 1 : least};
    std::int64_t deadline_ns = least == 0 ? Now() + time_ns : kNever;
    while (InputCount(port) < wait.count) {
      const Woken woken = Wait(deadline_ns, HasInput, &wait, context);
      if (woken == Woken::kBySignal) return -EINTR;
      if (woken == Woken::kByDeadline) break;
      if (least == 0 || time_ns == 0) break;
      wait.count = InputCount(port) < least ? InputCount(port) + 1 : least;
      deadline_ns = Now() + time_ns;
    }
    if (InputCount(port) == 0) return 0;
  }
  return Kernel(SYS_readv, port.program_end, parts, count);
}

long ControlPort(int uart, unsigned long request, void* argument, ucontext_t* context) {
  Port& port = ports[uart];
  switch (request) {
    case TCGETS:
      std::memcpy(argument, &port.settings, sizeof port.settings);
      return 0;
    case TCGETS2:
      std::memset(argument, 0, sizeof(termios2));
      std::memcpy(argument, &port.settings, sizeof port.settings);
      static_cast<termios2*>(argument)->c_ispeed = static_cast<termios2*>(argument)->c_ospeed =
          static_cast<speed_t>(RateOf(uart).baud);
      return 0;
    case TCSETSF:
    case TCSETSF2:
    case TCSETSW:
    case TCSETSW2:
      if (port.sent_ns > Now()) Wait(port.sent_ns, nullptr, nullptr, context);
      [[fallthrough]];
    case TCSETS:
    case TCSETS2:
      // termios2 begins as termios does.
      std::memcpy(&port.settings, argument, sizeof port.settings);
      CheckSettings(port);
      if (request != TCSETSF && request != TCSETSF2) return 0;
      [[fallthrough]];
    case TCFLSH:
      if (request == TCFLSH && reinterpret_cast<long>(argument) == TCOFLUSH) return 0;
      for (char dropped[4096]; InputCount(port) > 0;)
        Kernel(SYS_recvfrom, port.program_end, dropped, sizeof dropped, static_cast<int>(MSG_DONTWAIT),
               nullptr, nullptr);
      return 0;
    case TCSBRK:  // tcdrain(), or a break
      if (argument != nullptr && port.sent_ns > Now()) Wait(port.sent_ns, nullptr, nullptr, context);
      return 0;
    case TIOCOUTQ: {
      const UartRate rate = RateOf(uart);
      const std::int64_t left_ns = port.sent_ns > Now() ? port.sent_ns - Now() : 0;
      *static_cast<int*>(argument) =
          rate.character_bits == 0 ? 0
                                   : static_cast<int>(left_ns * rate.baud / rate.character_bits / kSecond);
      return 0;
    }
    case TIOCMGET:
      *static_cast<int*>(argument) = kModemLines;
      return 0;
    case TCSBRKP:
    case TCXONC:
    case TIOCEXCL:
    case TIOCNXCL:
    case TIOCMSET:
    case TIOCMBIS:
    case TIOCMBIC:
    case TIOCSBRK:
    case TIOCCBRK:
      return 0;
    case FIONREAD:
    case FIONBIO:
    case FIOCLEX:
    case FIONCLEX:
      return kNotOfPort;
    default:
      return -ENOTTY;
  }
}

}  // namespace tiltproof::preload
