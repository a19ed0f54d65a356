// Boost 1.74's Asio uses std::exchange without its header.
#include <utility>
//
#include <fcntl.h>
#include <grp.h>
#include <linux/serial.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <boost/asio/buffer.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/serial_port.hpp>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <vector>

#include "link/serial_devices.h"
#include "link/serial_port.h"
#include "link/termios_baud.h"
#include "link/unix_socket.h"

namespace tiltproof::link {
namespace {

namespace asio = boost::asio;
using boost::system::error_code;

constexpr std::size_t kReadBytesMax = 4096;
// Further off, receivers sample the wrong bit.
constexpr double kBaudErrorMax = 0.02;

// /dev/ptmx.
const dev_t kPseudoTerminalMaster = makedev(5, 2);

bool IsPseudoTerminal(const struct stat& status) {
  const auto number = major(status.st_rdev);
  return number >= 136 && number <= 143;  // UNIX98_PTY_SLAVE_MAJOR ...
}

[[noreturn]] void Refuse(const std::string& device, const std::string& why) {
  throw std::runtime_error("cannot open serial port " + device + ": " + why);
}

std::string DevicesText() {
  std::string text;
  for (const auto& device : ListSerialDevices()) text += (text.empty() ? "" : ", ") + device;
  return text.empty()
             ? "no serial device is connected to this machine: check the cable, then `ls /dev/ttyUSB* "
               "/dev/ttyACM*`"
             : "serial devices of this machine: " + text;
}

[[noreturn]] void RefuseBusy(const std::string& device) {
  const std::string holders = Text(ProcessesHolding(device));
  Refuse(device, "busy: " +
                     (holders.empty() ? "another process holds it (`sudo fuser -v " + device + "` names it)"
                                      : "held by process " + holders) +
                     "; end it first");
}

// An open, locked, non-blocking descriptor of a terminal.
OwnedDescriptor OpenDevice(const std::string& device) {
  struct stat status {};
  // Asked before opening: that has side effects on some devices.
  if (stat(device.c_str(), &status) != 0) {
    const int error = errno;
    if (error == ENOENT || error == ENOTDIR) Refuse(device, "no such device; " + DevicesText());
    if (error == EACCES) Refuse(device, "no permission to look into its folder");
    Refuse(device, std::strerror(error));
  }
  if (!S_ISCHR(status.st_mode)) Refuse(device, "not a serial device; " + DevicesText());

  OwnedDescriptor descriptor(open(device.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  if (descriptor.get() < 0) {
    const int error = errno;
    if (error == EACCES || error == EPERM) Refuse(device, "no permission: run " + PermissionAdvice(device));
    if (error == EBUSY) RefuseBusy(device);
    if (error == ENXIO || error == ENODEV || error == EIO)
      Refuse(device, "there is a device file but no device behind it (" + std::string(std::strerror(error)) +
                         "): was it unplugged? " + DevicesText());
    Refuse(device, std::strerror(error));
  }
  struct termios settings {};
  if (tcgetattr(descriptor.get(), &settings) != 0) {
    // A port of the mainboard without hardware behind it answers EIO.
    const bool no_hardware = errno == EIO;
    Refuse(device,
           (no_hardware ? "there is no hardware behind it; " : "not a serial device; ") + DevicesText());
  }

  if (flock(descriptor.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) RefuseBusy(device);
  // A pseudo-terminal is always open in the process that made it, and would stay marked as exclusive when its
  // user is killed; the lock alone guards it.
  if (!IsPseudoTerminal(status)) {
    // Root may open a port that others hold exclusively, and flock() does not see a process without a lock.
    int exclusive = 0;
    const bool marked = ioctl(descriptor.get(), TIOCGEXCL, &exclusive) == 0 && exclusive != 0;
    const auto holders = ProcessesHolding(device);
    if (marked || std::any_of(holders.begin(), holders.end(),
                              [](const Holder& holder) { return holder.pid != getpid(); }))
      RefuseBusy(device);
    ioctl(descriptor.get(), TIOCEXCL);
  }
  return descriptor;
}

constexpr tcflag_t kFormatFlags = CSIZE | PARENB | PARODD | CSTOPB;

tcflag_t FlagsOf(const CharacterFormat& character) {
  tcflag_t flags = character.data_bits == 7 ? CS7 : CS8;
  if (character.has_parity()) flags |= PARENB;
  if (character.parity == Parity::kOdd) flags |= PARODD;
  if (character.stop_bits == 2) flags |= CSTOPB;
  return flags;
}

// Raw: no byte means anything to the line discipline, and none is held back.
void MakeRaw(const std::string& device, int descriptor, const CharacterFormat& character) {
  struct termios settings {};
  if (tcgetattr(descriptor, &settings) != 0) Refuse(device, std::strerror(errno));
  cfmakeraw(&settings);
  settings.c_iflag &= ~static_cast<tcflag_t>(IXON | IXOFF | IXANY | INPCK);
  settings.c_cflag &= ~static_cast<tcflag_t>(CSIZE | PARENB | PARODD | CMSPAR | CSTOPB | CRTSCTS | CIBAUD);
  settings.c_cflag |= FlagsOf(character) | CREAD | CLOCAL;
  // CIBAUD cleared: the input rate follows the output rate, whatever the port's last user had set.
  // A read without bytes says "try again"; 0 bytes only mean the end of the line.
  settings.c_cc[VMIN] = 1;
  settings.c_cc[VTIME] = 0;
  if (tcsetattr(descriptor, TCSANOW, &settings) != 0) Refuse(device, std::strerror(errno));
  // The call succeeds when any of the settings was possible. A pseudo-terminal has no characters on a line.
  struct stat status {};
  struct termios actual {};
  if (fstat(descriptor, &status) == 0 && !IsPseudoTerminal(status) && tcgetattr(descriptor, &actual) == 0 &&
      (actual.c_cflag & kFormatFlags) != FlagsOf(character))
    Refuse(device, "it cannot do " + Name(character));
}

// By the constant of a standard rate, which every driver knows; false for any other.
bool SetStandardBaud(asio::io_context& loop, int descriptor, std::int64_t baud) {
  // The rate belongs to the device, so that any descriptor of it will do.
  asio::serial_port port(loop);
  error_code error;
  port.assign(fcntl(descriptor, F_DUPFD_CLOEXEC, 0), error);
  if (!error) port.set_option(asio::serial_port_base::baud_rate(static_cast<unsigned>(baud)), error);
  return !error;
}

void SetBaud(asio::io_context& loop, const std::string& device, int descriptor, std::int64_t baud) {
  if (!SetStandardBaud(loop, descriptor, baud) && !SetAnyBaud(descriptor, static_cast<std::uint32_t>(baud)))
    Refuse(device, "it refuses " + std::to_string(baud) + " baud (" + std::strerror(errno) + ")");
  const auto actual = ActualBaud(descriptor);
  if (actual && std::abs(static_cast<double>(*actual) - static_cast<double>(baud)) >
                    kBaudErrorMax * static_cast<double>(baud))
    Refuse(device, "it cannot do " + std::to_string(baud) + " baud; nearest: " + std::to_string(*actual));
}

std::string Reason(const std::string& name, const error_code& error) {
  if (error == asio::error::eof || error.value() == EIO || error.value() == ENXIO ||
      error.value() == ENODEV || error.value() == EPIPE || error.value() == ECONNRESET)
    return name + " was closed: the device was unplugged, or the other end is gone (" +
           (error == asio::error::eof ? "end of file" : std::strerror(error.value())) + ")";
  return name + " failed: " + error.message();
}

}  // namespace

// Shared with the operations under way, which may outlive the port by one turn of the loop.
class SerialPort::State : public std::enable_shared_from_this<State> {
 public:
  State(asio::io_context& loop, std::string name) : port_(loop), name_(std::move(name)) {}

  int descriptor() { return port_.native_handle(); }
  const std::string& name() const { return name_; }
  bool IsOpen() const { return port_.is_open(); }
  bool IsSocket() const { return socket_; }
  bool IsHardware() const { return !pseudo_terminal_ && !socket_; }

  // The descriptor is ours from here on, whatever happens.
  void Adopt(OwnedDescriptor descriptor) {
    struct stat status {};
    if (fstat(descriptor.get(), &status) == 0) {
      pseudo_terminal_ = IsPseudoTerminal(status) || status.st_rdev == kPseudoTerminalMaster;
      socket_ = S_ISSOCK(status.st_mode);
    }
    port_.assign(descriptor.get());
    descriptor.Release();
  }

  void Start(Received received, Closed closed) {
    received_ = std::move(received);
    closed_ = std::move(closed);
    Read();
  }

  bool Write(std::span<const std::uint8_t> bytes) {
    if (!IsOpen() || write_failed_ ||
        sending_.size() - sent_ + waiting_.size() + bytes.size() > kQueueBytesMax)
      return false;
    if (sending_.empty()) {
      // At once, instead of after a turn of the loop.
      while (!bytes.empty()) {
        const ssize_t written = WriteSome(bytes);
        if (written < 0 && errno == EINTR) continue;
        if (written < 0 && errno != EAGAIN) {
          write_failed_ = true;
          asio::post(port_.get_executor(), [self = shared_from_this(), error = errno] {
            self->Fail({error, boost::system::system_category()});
          });
          return false;
        }
        if (written <= 0) break;
        bytes = bytes.subspan(static_cast<std::size_t>(written));
      }
    }
    if (bytes.empty()) return true;
    waiting_.insert(waiting_.end(), bytes.begin(), bytes.end());
    if (sending_.empty()) Send();
    return true;
  }

  std::size_t UnsentBytes() {
    if (!IsOpen()) return 0;
    int in_driver = 0;
    // Bytes that a socket has taken are at its other end.
    if (socket_ || ioctl(port_.native_handle(), TIOCOUTQ, &in_driver) != 0 || in_driver < 0) in_driver = 0;
    return sending_.size() - sent_ + waiting_.size() + static_cast<std::size_t>(in_driver);
  }

  std::size_t UnreadBytes() {
    int in_driver = 0;
    if (!IsOpen() || ioctl(port_.native_handle(), FIONREAD, &in_driver) != 0) return 0;
    return static_cast<std::size_t>(std::max(in_driver, 0));
  }

  void Close() {
    if (!IsOpen()) return;
    if (IsHardware()) {
      tcflush(port_.native_handle(), TCIOFLUSH);
      ioctl(port_.native_handle(), TIOCNXCL);
    }
    error_code ignored;
    port_.close(ignored);
  }

 private:
  // Like write(2), but when a socket's peer has left it returns an error instead of raising a signal.
  ssize_t WriteSome(std::span<const std::uint8_t> bytes) {
    if (socket_) return ::send(port_.native_handle(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
    return ::write(port_.native_handle(), bytes.data(), bytes.size());
  }

  void Read() {
    port_.async_read_some(asio::buffer(buffer_),
                          [self = shared_from_this()](const error_code& error, std::size_t count) {
                            if (!self->IsOpen()) return;
                            if (error) return self->Fail(error);
                            if (self->received_) self->received_({self->buffer_.data(), count});
                            if (self->IsOpen()) self->Read();
                          });
  }

  void Send() {
    if (sent_ == sending_.size()) {
      sending_.clear();
      sent_ = 0;
      std::swap(sending_, waiting_);
    }
    if (sending_.empty()) return;
    port_.async_wait(
        asio::posix::stream_descriptor::wait_write, [self = shared_from_this()](const error_code& error) {
          if (!self->IsOpen()) return;
          if (error) return self->Fail(error);
          const ssize_t written = self->WriteSome(std::span(self->sending_).subspan(self->sent_));
          if (written < 0 && errno != EAGAIN && errno != EINTR)
            return self->Fail({errno, boost::system::system_category()});
          self->sent_ += static_cast<std::size_t>(std::max<ssize_t>(written, 0));
          self->Send();
        });
  }

  void Fail(const error_code& error) {
    if (!IsOpen()) return;
    Close();
    if (closed_) closed_(Reason(name_, error));
  }

  asio::posix::stream_descriptor port_;
  std::string name_;
  bool pseudo_terminal_ = false, socket_ = false;
  Received received_;
  Closed closed_;
  bool write_failed_ = false;
  std::array<std::uint8_t, kReadBytesMax> buffer_{};
  std::vector<std::uint8_t> sending_;  // the driver is taking these
  std::size_t sent_ = 0;               // of sending_
  std::vector<std::uint8_t> waiting_;
};

SerialPort::SerialPort(asio::io_context& loop, const std::string& device, std::int64_t baud,
                       const CharacterFormat& character)
    : state_(std::make_shared<State>(loop, device)) {
  if (baud < kBaudMin || baud > kBaudMax)
    Refuse(device, "baud rate " + std::to_string(baud) + " is not within " + std::to_string(kBaudMin) +
                       " to " + std::to_string(kBaudMax));
  if (IsSocketName(device)) {
    state_->Adopt(ConnectSocket(device));
    return;
  }
  OwnedDescriptor descriptor = OpenDevice(device);
  MakeRaw(device, descriptor.get(), character);
  state_->Adopt(std::move(descriptor));
  SetBaud(loop, device, state_->descriptor(), baud);
  tcflush(state_->descriptor(), TCIFLUSH);
}

SerialPort::SerialPort(asio::io_context& loop, int descriptor, std::string name)
    : state_(std::make_shared<State>(loop, std::move(name))) {
  const int flags = fcntl(descriptor, F_GETFL);
  if (flags >= 0) fcntl(descriptor, F_SETFL, flags | O_NONBLOCK);
  state_->Adopt(OwnedDescriptor(descriptor));
}

SerialPort::~SerialPort() { state_->Close(); }

void SerialPort::Start(Received received, Closed closed) {
  state_->Start(std::move(received), std::move(closed));
}
bool SerialPort::Write(std::span<const std::uint8_t> bytes) { return state_->Write(bytes); }
std::size_t SerialPort::UnsentBytes() const { return state_->UnsentBytes(); }
std::size_t SerialPort::UnreadBytes() const { return state_->UnreadBytes(); }
bool SerialPort::IsOpen() const { return state_->IsOpen(); }
std::optional<pid_t> SerialPort::PeerProcess() const {
  ucred peer{};
  socklen_t size = sizeof peer;
  if (!IsOpen() || getsockopt(state_->descriptor(), SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0 ||
      peer.pid <= 0)
    return std::nullopt;
  return peer.pid;
}
bool SerialPort::TakesByteTime() const { return state_->IsHardware(); }

void SerialPort::SetModemLine(ModemLine line, bool on) {
  const int bit = line == ModemLine::kDtr ? TIOCM_DTR : TIOCM_RTS;
  if (IsOpen() && ioctl(state_->descriptor(), on ? TIOCMBIS : TIOCMBIC, &bit) == 0) return;
  throw std::runtime_error(state_->name() + ": no line " + (line == ModemLine::kDtr ? "DTR" : "RTS") +
                           " can be set here (" + std::strerror(IsOpen() ? errno : EBADF) +
                           "): use an adapter that has it, or a command");
}

SerialPort::LowLatency SerialPort::SetLowLatency(const std::filesystem::path& root) {
  LowLatency achieved;
  if (!IsOpen() || state_->IsSocket()) return achieved;
  struct serial_struct driver {};
  const int descriptor = state_->descriptor();
  if (ioctl(descriptor, TIOCGSERIAL, &driver) == 0) {
    driver.flags |= ASYNC_LOW_LATENCY;
    ioctl(descriptor, TIOCSSERIAL, &driver);
    achieved.driver = ioctl(descriptor, TIOCGSERIAL, &driver) == 0 &&
                      (static_cast<unsigned>(driver.flags) & ASYNC_LOW_LATENCY) != 0;
  }
  const std::filesystem::path file = LatencyTimerFile(state_->name(), root);
  achieved.latency_timer_ms = ReadLatencyTimer(state_->name(), root);
  if (achieved.latency_timer_ms.value_or(1) > 1) {
    std::ofstream(file) << 1 << std::flush;
    achieved.latency_timer_ms = ReadLatencyTimer(state_->name(), root);
    if (achieved.latency_timer_ms.value_or(1) > 1)
      achieved.advice = "the adapter holds received bytes back for up to " +
                        std::to_string(*achieved.latency_timer_ms) + " ms: run `echo 1 | sudo tee " +
                        file.string() + "`";
  }
  return achieved;
}

}  // namespace tiltproof::link
