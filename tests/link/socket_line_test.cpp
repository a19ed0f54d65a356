// Serial lines over unix sockets; the far side is plain POSIX calls.
#include "link/socket_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <numeric>

#include "link/pty.h"
#include "link/serial_port.h"
#include "link/unix_socket.h"

namespace tiltproof::link {
namespace {

using std::chrono_literals::operator""s;
using std::chrono_literals::operator""ms;
using ::testing::AllOf;
using ::testing::HasSubstr;
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

struct Ear {
  Bytes bytes;
  std::string closed;
  void Listen(ByteLine& line) {
    line.Start(
        [this](std::span<const std::uint8_t> more) { bytes.insert(bytes.end(), more.begin(), more.end()); },
        [this](const std::string& reason) { closed = reason; });
  }
};

// A peer after unix(7), without the code under test. An abstract name when `name` begins with '@'.
int Connect(const std::string& name) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::copy(name.begin(), name.end(), address.sun_path);
  socklen_t size = sizeof address;
  if (name.starts_with('@')) {
    address.sun_path[0] = '\0';
    size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size());
  }
  const int descriptor = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (connect(descriptor, reinterpret_cast<sockaddr*>(&address), size) == 0) return descriptor;
  close(descriptor);
  return -1;
}
int Connect(const SocketLine& line) { return Connect("@" + line.abstract_name()); }

std::string OpenError(const std::string& name) {
  boost::asio::io_context loop;
  try {
    SerialPort port(loop, name, 921'600);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "no error";
}

class SocketLineTest : public ::testing::Test {
 protected:
  SocketLineTest()
      : folder_(std::filesystem::temp_directory_path() / ("tiltproof-socket-" + std::to_string(getpid()))) {
    std::filesystem::create_directories(folder_);
  }
  ~SocketLineTest() override { std::filesystem::remove_all(folder_); }

  // A socket of the emulator's, as a file.
  int ListenAt(const std::filesystem::path& path, int type = SOCK_STREAM) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    const std::string text = path.string();
    std::copy(text.begin(), text.end(), address.sun_path);
    const int descriptor = socket(AF_UNIX, type | SOCK_CLOEXEC, 0);
    EXPECT_EQ(bind(descriptor, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    EXPECT_TRUE(type != SOCK_STREAM || listen(descriptor, 1) == 0);
    return descriptor;
  }

  boost::asio::io_context loop_;
  std::filesystem::path folder_;
};

TEST_F(SocketLineTest, EveryByteArrivesUnchangedBothWays) {
  SocketLine line(loop_);
  SerialPort port(loop_, line.name(), 921'600);
  Ear at_line, at_port;
  at_line.Listen(line);
  at_port.Listen(port);
  ASSERT_TRUE(RunUntil(loop_, [&] { return line.HasPeer(); }));
  EXPECT_TRUE(port.Write(AllBytes()));
  EXPECT_TRUE(line.Write(AllBytes()));
  EXPECT_TRUE(RunUntil(loop_, [&] { return at_line.bytes.size() >= 256 && at_port.bytes.size() >= 256; }));
  EXPECT_EQ(at_line.bytes, AllBytes());
  EXPECT_EQ(at_port.bytes, AllBytes());
  EXPECT_EQ(at_port.closed, "");
  EXPECT_FALSE(port.TakesByteTime());
}

TEST_F(SocketLineTest, WhatAPeerSaysBeforeAnybodyListensIsKept) {
  SocketLine line(loop_);
  const int peer = Connect(line);
  ASSERT_GE(peer, 0);
  EXPECT_EQ(write(peer, "start", 5), 5);
  Ear ear;
  ear.Listen(line);
  EXPECT_TRUE(RunUntil(loop_, [&] { return ear.bytes.size() >= 5; }));
  EXPECT_EQ(std::string(ear.bytes.begin(), ear.bytes.end()), "start");
  close(peer);
}

TEST_F(SocketLineTest, ThePeerMayLeaveAndComeBack) {
  SocketLine line(loop_);
  Ear ear;
  ear.Listen(line);
  for (int i = 0; i < 3; ++i) {
    EXPECT_FALSE(line.Write(AllBytes())) << "nobody is plugged in";
    const int peer = Connect(line);
    ASSERT_GE(peer, 0);
    ASSERT_TRUE(RunUntil(loop_, [&] { return line.HasPeer(); }));
    ear.bytes.clear();
    EXPECT_EQ(write(peer, "again", 5), 5);
    EXPECT_TRUE(RunUntil(loop_, [&] { return ear.bytes.size() == 5; }));
    const Bytes answer = {1, 2, 3};
    EXPECT_TRUE(line.Write(answer));
    Bytes got(16);
    // Nothing of what was written while no peer was there.
    EXPECT_EQ(read(peer, got.data(), got.size()), 3);
    close(peer);
    ASSERT_TRUE(RunUntil(loop_, [&] { return !line.HasPeer(); }));
  }
  EXPECT_EQ(ear.closed, "");
}

TEST_F(SocketLineTest, APeerThatLeavesBytesUnreadIsNoEndOfTheLine) {
  SocketLine line(loop_);
  Ear ear;
  ear.Listen(line);
  const int peer = Connect(line);
  ASSERT_TRUE(RunUntil(loop_, [&] { return line.HasPeer(); }));
  EXPECT_TRUE(line.Write(AllBytes()));
  close(peer);  // the kernel says "connection reset" to who writes or reads
  line.Write(AllBytes());
  ASSERT_TRUE(RunUntil(loop_, [&] { return !line.HasPeer(); }));
  const int next = Connect(line);
  EXPECT_TRUE(RunUntil(loop_, [&] { return line.HasPeer(); }));
  EXPECT_EQ(ear.closed, "");
  close(next);
}

TEST_F(SocketLineTest, ASecondPeerWaitsForItsTurn) {
  SocketLine line(loop_);
  Ear ear;
  ear.Listen(line);
  const int first = Connect(line);
  ASSERT_TRUE(RunUntil(loop_, [&] { return line.HasPeer(); }));
  const int second = Connect(line);
  ASSERT_GE(second, 0);
  EXPECT_EQ(write(second, "B", 1), 1);
  EXPECT_EQ(write(first, "A", 1), 1);
  ASSERT_TRUE(RunUntil(loop_, [&] { return !ear.bytes.empty(); }));
  EXPECT_EQ(ear.bytes, Bytes{'A'});
  close(first);
  ASSERT_TRUE(RunUntil(loop_, [&] { return ear.bytes.size() == 2; }));
  EXPECT_EQ(ear.bytes[1], 'B');
  close(second);
}

TEST_F(SocketLineTest, AMebibyteComesThroughToASlowReader) {
  SocketLine line(loop_);
  Ear ear;
  ear.Listen(line);
  const int peer = Connect(line);
  ASSERT_TRUE(RunUntil(loop_, [&] { return line.HasPeer(); }));
  Bytes sent(SerialPort::kQueueBytesMax);
  for (std::size_t i = 0; i < sent.size(); ++i) sent[i] = static_cast<std::uint8_t>(i * 31 + (i >> 8));
  ASSERT_TRUE(line.Write(sent));
  EXPECT_FALSE(line.Write(sent)) << "the queue has a limit";
  Bytes got(sent.size());
  std::size_t got_count = 0;
  const auto end = std::chrono::steady_clock::now() + 10s;
  while (got_count < sent.size() && std::chrono::steady_clock::now() < end) {
    loop_.restart();
    loop_.poll();
    const ssize_t count = recv(peer, got.data() + got_count, got.size() - got_count, MSG_DONTWAIT);
    got_count += static_cast<std::size_t>(std::max<ssize_t>(count, 0));
  }
  EXPECT_EQ(got, sent);
  close(peer);
}

TEST_F(SocketLineTest, ItsNameGoesWithItAndThePeerHears) {
  auto line = std::make_unique<SocketLine>(loop_);
  const std::string name = line->name();
  Ear at_line, at_port;
  at_line.Listen(*line);
  SerialPort port(loop_, name, 921'600);
  at_port.Listen(port);
  ASSERT_TRUE(RunUntil(loop_, [&] { return line->HasPeer(); }));
  EXPECT_EQ(SocketTrouble(name), std::nullopt);
  line.reset();
  loop_.restart();
  loop_.run_for(10s);  // returns as soon as nothing is under way
  EXPECT_TRUE(loop_.stopped());
  EXPECT_THAT(at_port.closed, AllOf(HasSubstr(name), HasSubstr("the other end is gone")));
  EXPECT_FALSE(port.Write(AllBytes()));
  EXPECT_THAT(OpenError(name), AllOf(HasSubstr(name), HasSubstr("no process listens there")));
  EXPECT_THAT(SocketTrouble(name).value_or(""), HasSubstr("no process listens there"));
}

TEST_F(SocketLineTest, AnotherUserIsTurnedAway) {
  if (geteuid() != 0) GTEST_SKIP() << "only root may become another user";
  SocketLine line(loop_);
  Ear ear;
  ear.Listen(line);
  const pid_t stranger = fork();
  if (stranger == 0) {
    // The line is root's, so a process of the user `nobody` is a stranger, and the line ends for it.
    if (setuid(65534) != 0) _exit(2);
    const int peer = Connect(line);
    char byte = 'X';
    if (peer < 0) _exit(3);
    // The line may have ended before.
    if (send(peer, &byte, 1, MSG_NOSIGNAL) < 0) _exit(0);
    _exit(read(peer, &byte, 1) <= 0 ? 0 : 4);
  }
  int status = -1;
  ASSERT_TRUE(RunUntil(loop_, [&] { return waitpid(stranger, &status, WNOHANG) == stranger; }));
  EXPECT_EQ(status, 0);
  EXPECT_TRUE(ear.bytes.empty());
  const int peer = Connect(line);
  EXPECT_TRUE(RunUntil(loop_, [&] { return line.HasPeer(); }));
  close(peer);
}

// Sockets as an emulator offers them.

TEST_F(SocketLineTest, APortConnectsToAFile) {
  const auto path = folder_ / "uart";
  const int listener = ListenAt(path);
  EXPECT_EQ(SocketTrouble("unix:" + path.string()), std::nullopt);
  SerialPort port(loop_, "unix:" + path.string(), 921'600);
  const int peer = accept(listener, nullptr, nullptr);
  ASSERT_GE(peer, 0);
  EXPECT_EQ(write(peer, "request", 7), 7);
  Ear ear;
  ear.Listen(port);
  EXPECT_TRUE(RunUntil(loop_, [&] { return ear.bytes.size() >= 7; }));
  EXPECT_TRUE(port.Write(AllBytes()));
  EXPECT_EQ(port.UnsentBytes(), 0u);
  EXPECT_EQ(port.PeerProcess(), getpid());
  close(peer);
  EXPECT_TRUE(RunUntil(loop_, [&] { return !ear.closed.empty(); }));
  EXPECT_THAT(ear.closed, HasSubstr("the other end is gone"));
  close(listener);
}

TEST_F(SocketLineTest, SaysWhatIsWrongWithAName) {
  EXPECT_THAT(OpenError("unix:"), HasSubstr("the name is empty"));
  EXPECT_THAT(OpenError("unix:" + std::string(200, 'x')), HasSubstr("longer than 107 bytes"));
  const std::string missing = "unix:" + (folder_ / "missing").string();
  EXPECT_THAT(OpenError(missing), AllOf(HasSubstr(missing), HasSubstr("no process listens there")));
  EXPECT_THAT(SocketTrouble(missing).value_or(""), HasSubstr("no such socket"));
  std::ofstream(folder_ / "file") << "text";
  EXPECT_THAT(SocketTrouble("unix:" + (folder_ / "file").string()).value_or(""), HasSubstr("not a socket"));
  close(ListenAt(folder_ / "left"));  // its owner has died
  EXPECT_THAT(OpenError("unix:" + (folder_ / "left").string()), HasSubstr("no process listens there"));
  const int datagram = ListenAt(folder_ / "datagram", SOCK_DGRAM);
  EXPECT_THAT(OpenError("unix:" + (folder_ / "datagram").string()), HasSubstr("must be a stream"));
  close(datagram);
}

TEST_F(SocketLineTest, PseudoTerminalsTakeNoByteTime) {
  Pty pty(loop_);
  SerialPort port(loop_, pty.slave_path(), 921'600);
  EXPECT_FALSE(port.TakesByteTime());
  EXPECT_EQ(port.PeerProcess(), std::nullopt);
}

}  // namespace
}  // namespace tiltproof::link
