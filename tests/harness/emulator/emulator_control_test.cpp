// QMP and the debugger port against a real QEMU with a small image: what one of them does, the other one sees.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <csignal>
#include <utility>
//
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "harness/emulator/bit_flipper.h"
#include "harness/emulator/diagnosis/cpu_state.h"
#include "harness/emulator/diagnosis/gdb_board.h"
#include "harness/emulator/gdb_client.h"
#include "harness/emulator/qmp_client.h"
#include "harness/process/child_process.h"
#include "link/unix_socket.h"
#include "tests/harness/emulator/tick_image.h"

namespace tiltproof::harness {
namespace {

using std::chrono_literals::operator""s;
using std::chrono_literals::operator""ms;
using std::chrono_literals::operator""ns;
using testing::ElementsAre;
using testing::HasSubstr;

// Far from what the image uses.
constexpr std::uint32_t kFreeAddress = 0x2000'1000;

bool RunUntil(boost::asio::io_context& loop, const std::function<bool()>& condition) {
  const auto end = std::chrono::steady_clock::now() + 30s;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    if (loop.stopped()) loop.restart();
    loop.run_one_for(20ms);
  }
  return true;
}

std::pair<int, int> SocketPair() {
  int ends[2] = {-1, -1};
  EXPECT_EQ(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends), 0);
  return {ends[0], ends[1]};
}

class EmulatorControlTest : public testing::Test {
 protected:
  void SetUp() override {
    if (system("command -v qemu-system-arm > /dev/null") != 0) GTEST_SKIP() << "no qemu-system-arm";
    image_ = std::filesystem::path(testing::TempDir()) / ("tick-" + std::to_string(getpid()) + ".elf");
    WriteTickImage(image_);
    const auto [qmp, qmp_far] = SocketPair();
    const auto [gdb, gdb_far] = SocketPair();
    ChildSpec spec;
    spec.command = {"qemu-system-arm",
                    "-M",
                    "netduinoplus2",
                    "-display",
                    "none",
                    "-monitor",
                    "none",
                    "-nodefaults",
                    "-S",
                    "-chardev",
                    "socket,id=qmp,fd=3",
                    "-mon",
                    "chardev=qmp,mode=control",
                    "-chardev",
                    "socket,id=gdb,fd=4",
                    "-gdb",
                    "chardev:gdb",
                    "-kernel",
                    image_.string()};
    spec.descriptors = {qmp_far, gdb_far};
    process_.emplace(spec);
    close(qmp_far);
    close(gdb_far);
    qmp_.emplace(
        loop_, qmp,
        QmpClient::Callbacks{.event = [this](const std::string& name,
                                             const std::string& data) { events_.emplace_back(name, data); },
                             .lost = [this](const std::string& why) { qmp_lost_ = why; }});
    debugger_port_ = link::OwnedDescriptor(dup(gdb));
    gdb_.emplace(loop_, gdb, [this](const std::string& why) { gdb_lost_ = why; });
  }
  void TearDown() override {
    process_.reset();
    std::filesystem::remove(image_);
  }

  // Both empty, or an error and a value.
  std::pair<std::string, std::string> Execute(const std::string& command,
                                              const std::string& arguments = "{}") {
    std::optional<std::pair<std::string, std::string>> answer;
    qmp_->Execute(command, arguments,
                  [&](const std::string& error, const std::string& value) { answer.emplace(error, value); });
    EXPECT_TRUE(RunUntil(loop_, [&] { return answer.has_value(); })) << command;
    return answer.value_or(std::pair<std::string, std::string>{"no answer", ""});
  }

  std::uint32_t Word(std::uint32_t address) {
    char arguments[80];
    std::snprintf(arguments, sizeof arguments, R"({"command-line": "xp /1xw 0x%x"})", address);
    const auto [error, value] = Execute("human-monitor-command", arguments);
    EXPECT_EQ(error, "");
    const auto colon = value.find(": 0x");
    EXPECT_NE(colon, std::string::npos) << value;
    return colon == std::string::npos
               ? 0
               : static_cast<std::uint32_t>(std::stoul(value.substr(colon + 2), nullptr, 16));
  }

  struct Flipped {
    std::string error;
    std::vector<FlippedByte> bytes;
  };
  Flipped Flip(std::vector<MemoryBit> bits) {
    std::optional<Flipped> flipped;
    gdb_->Flip(std::move(bits), [&](const std::string& error, const std::vector<FlippedByte>& bytes) {
      flipped.emplace(Flipped{error, bytes});
    });
    EXPECT_TRUE(RunUntil(loop_, [&] { return flipped.has_value(); }));
    return flipped.value_or(Flipped{"no answer", {}});
  }

  // True if the image's ticks go on.
  bool Ticks() {
    const std::uint32_t before = Word(kTickCountAddress);
    return RunUntil(loop_, [&] { return Word(kTickCountAddress) != before; });
  }
  std::string Status() { return Execute("query-status").second; }

  boost::asio::io_context loop_;
  std::filesystem::path image_;
  std::optional<ChildProcess> process_;
  std::optional<QmpClient> qmp_;
  std::optional<BitFlipper> gdb_;
  link::OwnedDescriptor debugger_port_;  // the same one
  std::vector<std::pair<std::string, std::string>> events_;
  std::string qmp_lost_, gdb_lost_;
};

TEST_F(EmulatorControlTest, TheBoardWaitsForItsStart) {
  EXPECT_THAT(Status(), HasSubstr("\"running\":false"));
  EXPECT_EQ(Word(kTickCountAddress), 0u);
  EXPECT_EQ(Execute("cont").first, "");
  EXPECT_THAT(Status(), HasSubstr("\"running\":true"));
  EXPECT_TRUE(Ticks());
}

TEST_F(EmulatorControlTest, StopsGoesOnAndResets) {
  Execute("cont");
  EXPECT_TRUE(Ticks());
  EXPECT_EQ(Execute("stop").first, "");
  const std::uint32_t count = Word(kTickCountAddress);
  EXPECT_GT(count, 0u);
  EXPECT_EQ(Word(kTickCountAddress), count);
  EXPECT_EQ(Execute("system_reset").first, "");
  ASSERT_TRUE(RunUntil(loop_, [&] {
    return std::any_of(events_.begin(), events_.end(),
                       [](const auto& event) { return event.first == "RESET"; });
  }));
  EXPECT_THAT(events_.back().second, HasSubstr("\"guest\":false"));
  EXPECT_THAT(Status(), HasSubstr("\"running\":false"));
  EXPECT_EQ(Execute("cont").first, "");
  EXPECT_TRUE(Ticks());
}

TEST_F(EmulatorControlTest, SaysWhatQemuRefuses) {
  EXPECT_THAT(Execute("fly_away").first, HasSubstr("fly_away"));
  EXPECT_THAT(Execute("human-monitor-command", R"({"speed": 3})").first, testing::Not(""));
  EXPECT_EQ(Execute("cont").first, "");
}

TEST_F(EmulatorControlTest, FlipsBitsWhileTheBoardRuns) {
  Execute("cont");
  EXPECT_TRUE(Ticks());
  const Flipped flipped = Flip({{kFreeAddress, 0}, {kFreeAddress + 1, 7}, {kFreeAddress, 3}});
  EXPECT_EQ(flipped.error, "");
  EXPECT_THAT(flipped.bytes,
              ElementsAre(FlippedByte{kFreeAddress, 0x00, 0x01}, FlippedByte{kFreeAddress + 1, 0x00, 0x80},
                          FlippedByte{kFreeAddress, 0x01, 0x09}));
  EXPECT_EQ(Word(kFreeAddress), 0x8009u);
  EXPECT_THAT(Status(), HasSubstr("\"running\":true"));
  EXPECT_TRUE(Ticks());
  EXPECT_EQ(gdb_->Waiting(), 0ns);
}

TEST_F(EmulatorControlTest, FlipsManyTimesOneAfterTheOther) {
  Execute("cont");
  constexpr int kCount = 200;
  int done = 0;
  for (int i = 0; i < kCount; ++i)
    gdb_->Flip({{kFreeAddress, i % 8}}, [&](const std::string& error, const auto& bytes) {
      EXPECT_EQ(error, "");
      EXPECT_EQ(bytes.size(), 1u);
      ++done;
    });
  EXPECT_TRUE(RunUntil(loop_, [&] { return done == kCount; }));
  // Each bit 25 times.
  EXPECT_EQ(Word(kFreeAddress), 0xFFu);
  EXPECT_TRUE(Ticks());
}

TEST_F(EmulatorControlTest, ABoardThatStandsStillIsLeftSo) {
  Execute("cont");
  EXPECT_TRUE(Ticks());
  for (int i = 0; i < 3; ++i) {
    Execute("stop");
    const std::uint32_t count = Word(kTickCountAddress);
    EXPECT_EQ(Flip({{kFreeAddress, i}}).error, "");
    EXPECT_EQ(Word(kFreeAddress), (2u << i) - 1);
    EXPECT_THAT(Status(), HasSubstr("\"running\":false"));
    EXPECT_EQ(Word(kTickCountAddress), count);
    Execute("cont");
    EXPECT_TRUE(Ticks());
    EXPECT_EQ(Flip({{kFreeAddress + 4, i}}).error, "") << "and one that runs goes on";
    EXPECT_TRUE(Ticks());
  }
}

TEST_F(EmulatorControlTest, MemoryThatIsNotThereIsAnErrorAndTheBoardGoesOn) {
  Execute("cont");
  const Flipped flipped = Flip({{kFreeAddress, 1}, {0x6000'0000, 1}, {kFreeAddress, 2}});
  EXPECT_THAT(flipped.error, HasSubstr("0x60000000"));
  EXPECT_THAT(flipped.bytes, ElementsAre(FlippedByte{kFreeAddress, 0x00, 0x02}));
  EXPECT_TRUE(Ticks());
}

TEST_F(EmulatorControlTest, ABoardThatRunsIsStoppedAndLookedAt) {
  Execute("cont");
  EXPECT_TRUE(Ticks());
  EXPECT_EQ(Flip({{kFreeAddress, 1}, {kFreeAddress + 3, 7}}).error, "");
  gdb_.reset();
  GdbBoard stopped(debugger_port_.get(), {});
  EXPECT_THAT(Status(), HasSubstr("\"running\":false"));
  EXPECT_THAT(stopped.ReadMemory(kFreeAddress, 4), ElementsAre(2, 0, 0, 0x80));
  EXPECT_THAT(stopped.ReadMemory(0x6000'0000, 4), testing::IsEmpty());
  EXPECT_EQ(stopped.ReadMemory(0x2000'0000, 2048).size(), 2048u);
  // The same registers as QEMU prints by the other socket.
  const auto seen = ParseCpuState(stopped.Registers());
  ASSERT_TRUE(seen.has_value());
  EXPECT_EQ(*seen,
            ParseCpuState(Execute("human-monitor-command", R"({"command-line": "info registers"})").second));
  // `movs r0, #7` and `b .`, over what comes next.
  stopped.WriteCode(seen->pc(), 0xE7FE'2007);
  EXPECT_EQ(Word(seen->pc()), 0xE7FE'2007u);
  EXPECT_TRUE(stopped.Step());
  const auto after = ParseCpuState(stopped.Registers());
  ASSERT_TRUE(after.has_value());
  EXPECT_EQ(after->r[0], 7u);
  EXPECT_EQ(after->pc(), seen->pc() + 2);
}

TEST_F(EmulatorControlTest, ABoardThatStandsStillCanBeLookedAtTwice) {
  for (int i = 0; i < 2; ++i) {
    GdbBoard stopped(debugger_port_.get(), {});
    EXPECT_TRUE(ParseCpuState(stopped.Registers()).has_value());
  }
  EXPECT_THAT(Status(), HasSubstr("\"running\":false"));
}

TEST_F(EmulatorControlTest, LookingAtABoardThatIsGoneEnds) {
  GdbBoard stopped(debugger_port_.get(), {});
  process_->Signal(SIGKILL);
  EXPECT_THROW(stopped.ReadMemory(kFreeAddress, 4), EmulatorTrouble);
}

TEST_F(EmulatorControlTest, ItsEndIsNoticedByBoth) {
  Execute("cont");
  process_->Signal(SIGKILL);
  EXPECT_TRUE(RunUntil(loop_, [&] { return !qmp_lost_.empty() && !gdb_lost_.empty(); }));
  EXPECT_THAT(qmp_lost_, HasSubstr("the other end is gone"));
  EXPECT_THAT(gdb_lost_, HasSubstr("the other end is gone"));
}

TEST_F(EmulatorControlTest, WaitingTellsAnEmulatorThatDoesNotAnswer) {
  Execute("cont");
  process_->Signal(SIGSTOP);
  bool answered = false;
  qmp_->Execute("query-status", "{}", [&](const auto&, const auto&) { answered = true; });
  EXPECT_TRUE(RunUntil(loop_, [&] { return qmp_->Waiting() > 100ms; }));
  EXPECT_FALSE(answered);
  process_->Signal(SIGCONT);
  EXPECT_TRUE(RunUntil(loop_, [&] { return answered; }));
  EXPECT_EQ(qmp_->Waiting(), 0ns);
}

// Peers that are no QEMU.

TEST(QmpClientTest, APeerThatSpeaksSomethingElseIsLostOnce) {
  boost::asio::io_context loop;
  for (const std::string text : {"HTTP/1.1 400 Bad Request\r\n", "[1]\n", "\x01\xff\n", "{\"QMP\": \n"}) {
    const auto [near, far] = SocketPair();
    int lost = 0;
    QmpClient qmp(loop, near, {.event = {}, .lost = [&](const std::string&) { ++lost; }});
    EXPECT_EQ(write(far, text.data(), text.size()), static_cast<ssize_t>(text.size()));
    EXPECT_TRUE(RunUntil(loop, [&] { return lost > 0; })) << text;
    close(far);
    loop.restart();
    loop.run_for(20ms);
    EXPECT_EQ(lost, 1);
  }
}

TEST(QmpClientTest, MayBeDestroyedInItsCallbacks) {
  boost::asio::io_context loop;
  const auto [near, far] = SocketPair();
  std::optional<QmpClient> qmp;
  qmp.emplace(loop, near,
              QmpClient::Callbacks{.event = [&](const auto&, const auto&) { qmp.reset(); }, .lost = {}});
  const std::string text = "{\"event\": \"STOP\"}\r\n{\"event\": \"RESUME\"}\r\n";
  EXPECT_EQ(write(far, text.data(), text.size()), static_cast<ssize_t>(text.size()));
  EXPECT_TRUE(RunUntil(loop, [&] { return !qmp.has_value(); }));
  close(far);
}

// Answers the requests in turn from a script, and checks the checksum of each.
class ScriptedPort {
 public:
  explicit ScriptedPort(std::vector<std::string> answers) {
    const auto [near, far] = SocketPair();
    near_ = link::OwnedDescriptor(near);
    peer_ = std::jthread([this, far = far, answers = std::move(answers)] {
      for (const std::string& answer : answers) {
        std::string request;
        for (char c = 0; request.size() < 3 || request[request.size() - 3] != '#'; request += c)
          if (read(far, &c, 1) != 1) break;
        const auto begin = request.find('$') + 1, end = request.find('#');
        unsigned sum = 0;
        for (std::size_t i = begin; i < end; ++i) sum += static_cast<unsigned char>(request[i]);
        char digits[3];
        std::snprintf(digits, sizeof digits, "%02x", sum & 0xFFU);
        EXPECT_EQ(request.substr(end + 1), digits) << request;
        requests_.push_back(request.substr(begin, end - begin));
        EXPECT_EQ(write(far, answer.data(), answer.size()), static_cast<ssize_t>(answer.size()));
      }
      char c = 0;
      while (read(far, &c, 1) == 1) {
      }
      close(far);
    });
  }
  int socket() const { return near_.get(); }
  // Ends it.
  std::vector<std::string> Requests() {
    shutdown(near_.get(), SHUT_RDWR);
    if (peer_.joinable()) peer_.join();
    return requests_;
  }

 private:
  link::OwnedDescriptor near_;
  std::vector<std::string> requests_;
  std::jthread peer_;
};

TEST(GdbBoardTest, OutputComesInPiecesBeforeTheAnswer) {
  // A stop that is reported, and its answer; two pieces of output.
  ScriptedPort port({"$T02thread:01;#04+$S05#b8", "+$O5230303d#00$O0d0a#00$OK#9a", "+$#00", "+$E14#aa"});
  GdbBoard stopped(port.socket(), {});
  EXPECT_EQ(stopped.Registers(), "R00=\n");
  EXPECT_EQ(stopped.Registers(), "") << "a QEMU without such a command";
  EXPECT_THAT(stopped.ReadMemory(0x10, 2), testing::IsEmpty());
  EXPECT_THAT(port.Requests(), ElementsAre("?", "qRcmd,696e666f20726567697374657273",
                                           "qRcmd,696e666f20726567697374657273", "m10,2"));
}

TEST(GdbBoardTest, APortThatDoesNotAnswerIsNotWaitedForLong) {
  ScriptedPort port({"+"});
  const auto start = std::chrono::steady_clock::now();
  EXPECT_THROW(GdbBoard(port.socket(), {}, 50ms), EmulatorTrouble);
  EXPECT_GE(std::chrono::steady_clock::now() - start, 50ms);
  port.Requests();
}

TEST(GdbBoardTest, NoSocketIsAnError) { EXPECT_THROW(GdbBoard(-1, {}), EmulatorTrouble); }

TEST(GdbClientTest, NoiseIsNoAnswer) {
  boost::asio::io_context loop;
  const auto [near, far] = SocketPair();
  std::string lost;
  GdbClient gdb(loop, near, [&](const std::string& why) { lost = why; });
  // Nothing was asked: acknowledgements and packets mean nothing.
  const std::string noise = "++$T02thread:01;#04+$OK#9a++hello\x03";
  EXPECT_EQ(write(far, noise.data(), noise.size()), static_cast<ssize_t>(noise.size()));
  loop.run_for(20ms);
  EXPECT_EQ(lost, "");
  const std::string endless(10'000, 'x');
  EXPECT_EQ(write(far, "$", 1), 1);
  EXPECT_EQ(write(far, endless.data(), endless.size()), static_cast<ssize_t>(endless.size()));
  EXPECT_TRUE(RunUntil(loop, [&] { return !lost.empty(); }));
  EXPECT_THAT(lost, HasSubstr("more than was asked"));
  close(far);
}

}  // namespace
}  // namespace tiltproof::harness
