// Serial ports over real pseudo-terminals; the far side is plain POSIX calls.
#include <dlfcn.h>
#include <fcntl.h>
#include <grp.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include <utility>
//
#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <numeric>

#include "gmock/gmock.h"
#include "link/pty.h"
#include "link/serial_devices.h"
#include "link/serial_port.h"
#include "link/termios_baud.h"

namespace {
// The settings that programs have asked for: a pseudo-terminal does not keep them.
std::vector<struct termios> settings_made;
}  // namespace

extern "C" int tcsetattr(int descriptor, int actions, const struct termios* settings) noexcept {
  static const auto real =
      reinterpret_cast<int (*)(int, int, const struct termios*)>(dlsym(RTLD_NEXT, "tcsetattr"));
  settings_made.push_back(*settings);
  return real(descriptor, actions, settings);
}

namespace tiltproof::link {
namespace {

using std::chrono_literals::operator""s;
using std::chrono_literals::operator""ms;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using Bytes = std::vector<std::uint8_t>;

Bytes AllBytes() {
  Bytes bytes(256);
  std::iota(bytes.begin(), bytes.end(), std::uint8_t{0});
  return bytes;
}

// Runs the loop until the condition holds; false when it does not within 10 s.
bool RunUntil(boost::asio::io_context& loop, const std::function<bool()>& condition) {
  const auto end = std::chrono::steady_clock::now() + 10s;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    if (loop.stopped()) loop.restart();
    loop.run_one_for(20ms);
  }
  return true;
}

std::string OpenError(const std::string& device, std::int64_t baud = 115'200) {
  boost::asio::io_context loop;
  try {
    SerialPort port(loop, device, baud);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "no error";
}

std::size_t OpenDescriptors() {
  const std::filesystem::directory_iterator begin("/proc/self/fd");
  return static_cast<std::size_t>(std::distance(begin, {}));
}

struct Ear {
  Bytes bytes;
  std::string closed;
  void Listen(SerialPort& port) {
    port.Start(
        [this](std::span<const std::uint8_t> more) { bytes.insert(bytes.end(), more.begin(), more.end()); },
        [this](const std::string& reason) { closed = reason; });
  }
};

// Text that `work` returns in a child process with the rights of the user `nobody`.
std::string AsNobody(const std::function<std::string()>& work) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) return "no pipe";
  const pid_t child = fork();
  if (child == 0) {
    const std::string text = setgid(65534) == 0 && setuid(65534) == 0 ? work() : "cannot drop rights";
    const ssize_t written = write(ends[1], text.data(), text.size());
    _exit(written == static_cast<ssize_t>(text.size()) ? 0 : 1);
  }
  close(ends[1]);
  std::string text(4096, '\0');
  const ssize_t count = read(ends[0], text.data(), text.size());
  close(ends[0]);
  waitpid(child, nullptr, 0);
  text.resize(static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
  return text;
}

class SerialPortTest : public ::testing::Test {
 protected:
  SerialPortTest()
      : folder_(std::filesystem::temp_directory_path() / ("tiltproof-port-" + std::to_string(getpid()))) {
    std::filesystem::create_directories(folder_);
  }
  ~SerialPortTest() override { std::filesystem::remove_all(folder_); }
  boost::asio::io_context loop_;
  std::filesystem::path folder_;
};

TEST_F(SerialPortTest, EveryByteArrivesUnchangedBothWays) {
  Pty pty(loop_);
  SerialPort port(loop_, pty.slave_path(), 921'600);
  Ear at_master, at_port;
  at_master.Listen(pty.master());
  at_port.Listen(port);
  EXPECT_TRUE(port.Write(AllBytes()));
  EXPECT_TRUE(pty.master().Write(AllBytes()));
  EXPECT_TRUE(RunUntil(loop_, [&] { return at_master.bytes.size() >= 256 && at_port.bytes.size() >= 256; }));
  EXPECT_EQ(at_master.bytes, AllBytes());
  EXPECT_EQ(at_port.bytes, AllBytes());
  EXPECT_EQ(at_port.closed, "");
}

TEST_F(SerialPortTest, BothSidesAreRawForAPeerThatSetsNothing) {
  Pty pty(loop_);
  Ear ear;
  ear.Listen(pty.master());
  const int peer = open(pty.slave_path().c_str(), O_RDWR | O_NOCTTY);
  ASSERT_GE(peer, 0);
  EXPECT_EQ(write(peer, AllBytes().data(), 256), 256);
  EXPECT_TRUE(pty.master().Write(AllBytes()));
  EXPECT_TRUE(RunUntil(loop_, [&] { return ear.bytes.size() >= 256; }));
  EXPECT_EQ(ear.bytes, AllBytes());
  Bytes got(256);
  EXPECT_EQ(read(peer, got.data(), got.size()), 256);
  EXPECT_EQ(got, AllBytes());
  close(peer);
}

TEST_F(SerialPortTest, AMebibyteComesThroughToASlowReader) {
  Pty pty(loop_);
  SerialPort& port = pty.master();
  const int peer = open(pty.slave_path().c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK);
  ASSERT_GE(peer, 0);
  Bytes sent(SerialPort::kQueueBytesMax);
  for (std::size_t i = 0; i < sent.size(); ++i) sent[i] = static_cast<std::uint8_t>(i * 31 + (i >> 8));
  ASSERT_TRUE(port.Write(sent));
  // No peer reads: what the kernel did not take is queued, and one more mebibyte is refused whole.
  EXPECT_GT(port.UnsentBytes(), sent.size() / 2);
  EXPECT_FALSE(port.Write(sent));
  // 1000 bytes between two turns of the loop.
  Bytes got(sent.size() + 1);
  std::size_t got_count = 0;
  const auto end = std::chrono::steady_clock::now() + 10s;
  while (got_count < sent.size() && std::chrono::steady_clock::now() < end) {
    loop_.restart();
    loop_.poll();
    const ssize_t count =
        read(peer, got.data() + got_count, std::min<std::size_t>(1000, got.size() - got_count));
    got_count += static_cast<std::size_t>(std::max<ssize_t>(count, 0));
  }
  got.resize(got_count);
  EXPECT_EQ(got, sent);
  EXPECT_EQ(port.UnsentBytes(), 0u);
  close(peer);
}

TEST_F(SerialPortTest, SmallWritesKeepTheirOrderWhileTheQueueIsBusy) {
  Pty pty(loop_);
  SerialPort port(loop_, pty.slave_path(), 921'600);
  Bytes sent;
  for (int i = 0; i < 20'000; ++i) {
    const Bytes piece(7, static_cast<std::uint8_t>(i));
    ASSERT_TRUE(port.Write(piece));
    sent.insert(sent.end(), piece.begin(), piece.end());
    if (i % 100 == 0) loop_.poll_one();
  }
  Ear ear;
  ear.Listen(pty.master());
  EXPECT_TRUE(RunUntil(loop_, [&] { return ear.bytes.size() >= sent.size(); }));
  EXPECT_EQ(ear.bytes, sent);
}

TEST_F(SerialPortTest, TheOtherEndGoneIsReportedOnceAndTheLoopRunsDry) {
  auto pty = std::make_unique<Pty>(loop_);
  const std::string path = pty->slave_path();
  SerialPort port(loop_, path, 921'600);
  int calls = 0;
  std::string reason;
  port.Start([](auto) {}, [&](const std::string& why) { ++calls, reason = why; });
  pty.reset();
  loop_.run_for(10s);  // returns as soon as nothing is under way: no spinning, nothing left over
  EXPECT_TRUE(loop_.stopped());
  EXPECT_EQ(calls, 1);
  EXPECT_THAT(reason, AllOf(HasSubstr(path), HasSubstr("unplugged")));
  EXPECT_FALSE(port.IsOpen());
  EXPECT_FALSE(port.Write(AllBytes()));
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST_F(SerialPortTest, AWriteToADeadLineReportsTheClosure) {
  auto pty = std::make_unique<Pty>(loop_);
  SerialPort port(loop_, pty->slave_path(), 921'600);
  Ear ear;
  ear.Listen(port);
  pty.reset();
  EXPECT_FALSE(port.Write(AllBytes()));
  EXPECT_EQ(ear.closed, "");  // never from within a call
  EXPECT_TRUE(RunUntil(loop_, [&] { return !ear.closed.empty(); }));
}

TEST_F(SerialPortTest, ThePortMayBeDestroyedInItsOwnCallbacks) {
  auto pty = std::make_unique<Pty>(loop_);
  auto port = std::make_unique<SerialPort>(loop_, pty->slave_path(), 921'600);
  bool gone = false;
  port->Start(
      [&](auto) {
        port.reset();
        gone = true;
      },
      [](const std::string&) { FAIL(); });
  pty->master().Write(AllBytes());
  EXPECT_TRUE(RunUntil(loop_, [&] { return gone; }));
  auto again = std::make_unique<SerialPort>(loop_, pty->slave_path(), 921'600);
  gone = false;
  again->Start([](auto) {},
               [&](const std::string&) {
                 again.reset();
                 gone = true;
               });
  pty.reset();
  EXPECT_TRUE(RunUntil(loop_, [&] { return gone; }));
}

TEST_F(SerialPortTest, ThePeerMayComeLateLeaveAndComeBack) {
  Pty pty(loop_);
  Ear ear;
  ear.Listen(pty.master());
  for (int i = 0; i < 3; ++i) {
    // Without a peer the master waits: nothing happens at all.
    loop_.poll();
    EXPECT_EQ(loop_.run_for(50ms), 0u);
    ear.bytes.clear();
    pty.master().Write(Bytes{'o', 'l', 'd'});
    SerialPort port(loop_, pty.slave_path(), 921'600);
    Ear at_port;
    at_port.Listen(port);
    port.Write(AllBytes());
    pty.master().Write(Bytes{'n', 'e', 'w'});
    EXPECT_TRUE(RunUntil(loop_, [&] { return ear.bytes.size() >= 256 && at_port.bytes.size() >= 3; }));
    EXPECT_EQ(ear.bytes, AllBytes());
    EXPECT_EQ(at_port.bytes, (Bytes{'n', 'e', 'w'}));  // a UART that was not read has kept nothing
  }
  EXPECT_EQ(ear.closed, "");
}

TEST_F(SerialPortTest, NothingIsLeftBehind) {
  const std::size_t before = OpenDescriptors();
  std::string path;
  {
    boost::asio::io_context loop;
    Pty pty(loop);
    path = pty.slave_path();
    SerialPort port(loop, path, 153'600);
    Ear ear;
    ear.Listen(port);
    port.Write(AllBytes());
    EXPECT_THAT(OpenError(path), HasSubstr("busy"));
  }
  EXPECT_EQ(OpenDescriptors(), before);
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST_F(SerialPortTest, DescriptorsAreNotInherited) {
  Pty pty(loop_);
  SerialPort port(loop_, pty.slave_path(), 115'200);
  // As a child process that lists what it has inherited sees it.
  const std::string command = "ls -l /proc/self/fd | grep -c -E '/dev/(pts|ptmx)|" + pty.slave_path() + "$' ";
  std::FILE* pipe = popen((command + "< /dev/null 2> /dev/null").c_str(), "re");
  char line[16] = {};
  EXPECT_NE(std::fgets(line, sizeof line, pipe), nullptr);
  pclose(pipe);
  EXPECT_EQ(std::atoi(line), 0);
}

TEST_F(SerialPortTest, AnyBaudRateIsSetForBothDirections) {
  Pty pty(loop_);
  for (const std::int64_t baud : {153'600, 115'200, 921'600, 1'843'200, 57'600, 50}) {
    SerialPort port(loop_, pty.slave_path(), baud);
    const int probe = open(pty.slave_path().c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK);
    ASSERT_GE(probe, 0);
    EXPECT_EQ(ActualBaud(probe), static_cast<std::uint32_t>(baud));
    // By another way than ours.
    const std::string command = "stty speed < " + pty.slave_path();
    std::FILE* pipe = popen(command.c_str(), "re");
    char line[32] = {};
    EXPECT_NE(std::fgets(line, sizeof line, pipe), nullptr);
    pclose(pipe);
    if (baud != 153'600 && baud != 1'843'200) {  // stty knows POSIX's rates alone
      EXPECT_EQ(std::atoll(line), baud) << line;
    }
    close(probe);
  }
  for (const std::int64_t baud :
       {std::int64_t{0}, std::int64_t{-9600}, std::int64_t{49}, std::int64_t{1} << 40})
    EXPECT_THAT(OpenError(pty.slave_path(), baud), AllOf(HasSubstr("baud rate"), HasSubstr("20000000")));
}

TEST_F(SerialPortTest, AMissingDeviceIsNamedTogetherWithThoseThereAre) {
  const std::string missing = (folder_ / "ttyUSB7").string();
  EXPECT_THAT(OpenError(missing),
              AllOf(HasSubstr(missing), HasSubstr("no such device"), HasSubstr("serial device")));
  EXPECT_THAT(OpenError(""), HasSubstr("no such device"));
}

TEST_F(SerialPortTest, WhatIsNoSerialDeviceIsRefused) {
  std::ofstream(folder_ / "file") << "text";
  EXPECT_THAT(OpenError(folder_ / "file"), HasSubstr("not a serial device"));
  EXPECT_THAT(OpenError("/dev/null"), HasSubstr("not a serial device"));
  ASSERT_EQ(mkfifo((folder_ / "fifo").c_str(), 0600), 0);
  EXPECT_THAT(OpenError(folder_ / "fifo"), HasSubstr("not a serial device"));
  EXPECT_THAT(OpenError(folder_), HasSubstr("not a serial device"));
}

TEST_F(SerialPortTest, ABusyPortNamesItsHolder) {
  Pty pty(loop_);
  auto port = std::make_unique<SerialPort>(loop_, pty.slave_path(), 115'200);
  EXPECT_THAT(OpenError(pty.slave_path()),
              AllOf(HasSubstr("busy"), HasSubstr(std::to_string(getpid()) + " (")));
  port.reset();
  EXPECT_EQ(OpenError(pty.slave_path()), "no error");
  // Another program's lock.
  const int other = open(pty.slave_path().c_str(), O_RDWR | O_NOCTTY);
  ASSERT_EQ(flock(other, LOCK_EX | LOCK_NB), 0);
  EXPECT_THAT(OpenError(pty.slave_path()), HasSubstr("busy"));
  close(other);
  EXPECT_EQ(OpenError(pty.slave_path()), "no error");
}

TEST_F(SerialPortTest, WithoutPermissionItSaysHowToGetIt) {
  if (geteuid() != 0) GTEST_SKIP() << "needs root, to give a device away and to drop its rights";
  Pty pty(loop_);
  ASSERT_EQ(chmod(pty.slave_path().c_str(), 0600), 0);
  EXPECT_THAT(AsNobody([&] { return OpenError(pty.slave_path()); }),
              AllOf(HasSubstr("no permission"), HasSubstr("sudo chgrp dialout " + pty.slave_path()),
                    HasSubstr("sudo usermod -aG dialout $USER")));
  // root:root: no user should join the group of root.
  ASSERT_EQ(chown(pty.slave_path().c_str(), 0, 0), 0);
  ASSERT_EQ(chmod(pty.slave_path().c_str(), 0660), 0);
  EXPECT_THAT(AsNobody([&] { return OpenError(pty.slave_path()); }),
              AllOf(HasSubstr("sudo chgrp dialout"), HasSubstr("it belongs to root:root")));
  // A group that may use it is enough.
  const struct group* dialout = getgrnam("dialout");
  ASSERT_NE(dialout, nullptr);
  ASSERT_EQ(chown(pty.slave_path().c_str(), 0, dialout->gr_gid), 0);
  EXPECT_THAT(AsNobody([&] { return OpenError(pty.slave_path()); }),
              AllOf(HasSubstr("run `sudo usermod -aG dialout $USER`"), Not(HasSubstr("chgrp"))));
}

TEST_F(SerialPortTest, OthersExclusiveUseIsBusyForThoseWithoutRootsRights) {
  if (geteuid() != 0) GTEST_SKIP() << "needs root, to drop its rights";
  Pty pty(loop_);
  ASSERT_EQ(chmod(pty.slave_path().c_str(), 0666), 0);
  const int other = open(pty.slave_path().c_str(), O_RDWR | O_NOCTTY);
  ASSERT_EQ(ioctl(other, TIOCEXCL), 0);
  EXPECT_THAT(AsNobody([&] { return OpenError(pty.slave_path()); }), HasSubstr("busy"));
  close(other);
}

TEST_F(SerialPortTest, LowLatencyIsAValueNeverAnError) {
  Pty pty(loop_);
  SerialPort port(loop_, pty.slave_path(), 921'600);
  const auto none = port.SetLowLatency(folder_);  // a pseudo-terminal has neither
  EXPECT_FALSE(none.driver);
  EXPECT_EQ(none.latency_timer_ms, std::nullopt);
  EXPECT_EQ(none.advice, "");
  const auto file = LatencyTimerFile(pty.slave_path(), folder_);
  std::filesystem::create_directories(file.parent_path());
  std::ofstream(file) << "16\n";
  EXPECT_EQ(ReadLatencyTimer(pty.slave_path(), folder_), 16);
  const auto ftdi = port.SetLowLatency(folder_);
  EXPECT_EQ(ftdi.latency_timer_ms, 1);
  EXPECT_EQ(ftdi.advice, "");
}

TEST_F(SerialPortTest, ALatencyTimerThatMayNotBeSetComesWithTheCommand) {
  if (geteuid() != 0) GTEST_SKIP() << "needs root, to drop its rights";
  Pty pty(loop_);
  ASSERT_EQ(chmod(pty.slave_path().c_str(), 0666), 0);
  const auto file = LatencyTimerFile(pty.slave_path(), folder_);
  std::filesystem::create_directories(file.parent_path());
  std::ofstream(file) << "16\n";
  EXPECT_THAT(AsNobody([&] {
                boost::asio::io_context loop;
                SerialPort port(loop, pty.slave_path(), 921'600);
                const auto achieved = port.SetLowLatency(folder_);
                return std::to_string(achieved.latency_timer_ms.value_or(-1)) + " " + achieved.advice;
              }),
              AllOf(::testing::StartsWith("16 "), HasSubstr("sudo tee"), HasSubstr(file.string())));
}

TEST_F(SerialPortTest, DevicesAreListedInOrder) {
  std::filesystem::create_directories(folder_ / "dev/serial/by-id");
  for (const char* name : {"ttyUSB1", "ttyACM0", "ttyUSB0", "ttyS0", "null", "serial/by-id/usb-FTDI-if00"})
    std::ofstream(folder_ / "dev" / name) << "";
  const std::string dev = (folder_ / "dev").string();
  EXPECT_THAT(ListSerialDevices(folder_),
              ::testing::ElementsAre(dev + "/ttyACM0", dev + "/ttyUSB0", dev + "/ttyUSB1",
                                     dev + "/serial/by-id/usb-FTDI-if00"));
  EXPECT_TRUE(ListSerialDevices(folder_ / "nowhere").empty());
}

TEST(SerialPortFormatTest, TheDriverIsAskedForTheCharactersOfTheLine) {
  const std::vector<std::pair<CharacterFormat, tcflag_t>> cases = {
      {{}, CS8},
      {{.parity = Parity::kEven}, CS8 | PARENB},
      {{.data_bits = 7, .parity = Parity::kOdd}, CS7 | PARENB | PARODD},
      {{.stop_bits = 2}, CS8 | CSTOPB}};
  for (const auto& [format, flags] : cases) {
    boost::asio::io_context loop;
    Pty pty(loop);
    settings_made.clear();
    const SerialPort port(loop, pty.slave_path(), 115'200, format);
    ASSERT_FALSE(settings_made.empty());
    const struct termios& settings = settings_made.front();
    EXPECT_EQ(settings.c_cflag & (CSIZE | PARENB | PARODD | CMSPAR | CSTOPB), flags) << Name(format);
    // A byte with a parity error is received as it is, without a mark (termios(3)).
    EXPECT_EQ(settings.c_iflag & (INPCK | IGNPAR | PARMRK | ISTRIP), 0U);
  }
}

}  // namespace
}  // namespace tiltproof::link
