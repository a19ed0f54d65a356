// A terminal that is not in raw mode, held against the kernel's: a pseudo-terminal with the same flag.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <stdexcept>
#include <string>
#include <string_view>

#include "faults/random.h"
#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

// The flag and nothing else: no canonical mode, no echo, no signals.
class KernelTerminal {
 public:
  explicit KernelTerminal(const std::string& flag) : writes_(flag == "onlcr") {
    master_ = posix_openpt(O_RDWR | O_NOCTTY);
    if (master_ < 0 || grantpt(master_) != 0 || unlockpt(master_) != 0) throw std::runtime_error("no pty");
    char name[100];
    if (ptsname_r(master_, name, sizeof name) != 0) throw std::runtime_error("no name of the pty");
    slave_ = open(name, O_RDWR | O_NOCTTY);
    termios settings{};
    if (slave_ < 0 || tcgetattr(slave_, &settings) != 0) throw std::runtime_error("no slave of the pty");
    const std::map<std::string, tcflag_t> input = {
        {"ixon", IXON}, {"igncr", IGNCR}, {"icrnl", ICRNL}, {"inlcr", INLCR}, {"istrip", ISTRIP}};
    settings.c_iflag = writes_ ? 0 : input.at(flag);
    settings.c_oflag = writes_ ? OPOST | ONLCR : 0;
    settings.c_lflag = 0;
    settings.c_cc[VMIN] = 1;
    settings.c_cc[VTIME] = 0;
    if (tcsetattr(slave_, TCSANOW, &settings) != 0) throw std::runtime_error("the pty refuses the flag");
  }
  ~KernelTerminal() {
    close(slave_);
    close(master_);
  }
  KernelTerminal(const KernelTerminal&) = delete;
  KernelTerminal& operator=(const KernelTerminal&) = delete;

  // Up to the end mark, which no flag changes.
  Bytes Pass(const Bytes& bytes) const {
    Bytes marked = bytes;
    marked.insert(marked.end(), kEnd.begin(), kEnd.end());
    if (write(writes_ ? slave_ : master_, marked.data(), marked.size()) !=
        static_cast<ssize_t>(marked.size()))
      throw std::runtime_error("the pty takes no bytes");
    Bytes passed;
    while (passed.size() < kEnd.size() || !std::equal(kEnd.rbegin(), kEnd.rend(), passed.rbegin())) {
      pollfd readable{.fd = writes_ ? master_ : slave_, .events = POLLIN, .revents = 0};
      Bytes block(4096);
      const ssize_t got =
          poll(&readable, 1, 10'000) == 1 ? read(readable.fd, block.data(), block.size()) : -1;
      if (got <= 0) throw std::runtime_error("the pty gives no bytes");
      passed.insert(passed.end(), block.begin(), block.begin() + got);
    }
    passed.resize(passed.size() - kEnd.size());
    return passed;
  }

 private:
  static constexpr std::string_view kEnd = "<end of this block>";
  bool writes_;  // the flag acts on what the terminal writes
  int master_ = -1, slave_ = -1;
};

Bytes ModelOf(const std::string& flag, const Bytes& bytes) {
  const auto out = SendWithoutPause(Spec("wire.terminal", {{"flag", flag}}), bytes, 1);
  return out.at(0).empty() ? Bytes{} : out[0].at(0).bytes;
}

class TerminalTest : public ::testing::TestWithParam<const char*> {};

TEST_P(TerminalTest, DoesWhatTheKernelsTerminalDoes) {
  const std::string flag = GetParam();
  const KernelTerminal terminal(flag);
  Random random(11);
  std::size_t changed_count = 0;
  for (int block = 0; block < 200; ++block) {
    Bytes bytes(1000);
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random.Below(256));
    const Bytes expected = terminal.Pass(bytes);
    ASSERT_EQ(ModelOf(flag, bytes), expected) << flag << ", block " << block;
    changed_count += expected != bytes ? 1 : 0;
  }
  EXPECT_GT(changed_count, 150U);
}

// Bytes that follow each other meet no state: all pairs of the bytes that any flag knows.
TEST_P(TerminalTest, PairsOfBytesToo) {
  const std::string flag = GetParam();
  const KernelTerminal terminal(flag);
  const Bytes known = {0x00, 0x0A, 0x0D, 0x11, 0x13, 0x7F, 0x80, 0x8A, 0x8D, 0x91, 0x93, 0xFF};
  Bytes pairs;
  for (const std::uint8_t first : known)
    for (const std::uint8_t second : known) pairs.insert(pairs.end(), {first, second});
  EXPECT_EQ(ModelOf(flag, pairs), terminal.Pass(pairs));
}

INSTANTIATE_TEST_SUITE_P(Flags, TerminalTest,
                         ::testing::Values("ixon", "igncr", "icrnl", "inlcr", "istrip", "onlcr"),
                         [](const auto& flag) { return std::string(flag.param); });

TEST(TerminalRecordTest, SaysWhichBytesItChanged) {
  const auto what = [](const char* flag, const Bytes& bytes) {
    FaultSchedule schedule = AtTheLine({Spec("wire.terminal", {{"flag", flag}})}, 1);
    schedule.SetOrigin(kOriginAtPowerOn);
    std::vector<link::Chunk> chunks = {Frame(0)};
    chunks[0].bytes = bytes;
    schedule.Filter(link::Direction::kToClient)->Apply(chunks);
    const std::vector<Activation> activations = schedule.TakeActivations(kOriginAtPowerOn);
    return activations.empty() ? "nothing" : activations[0].what;
  };
  EXPECT_EQ(what("ixon", {0x7E, 0x11, 5, 0x13}), "byte 1 11 eaten, byte 3 13 eaten");
  EXPECT_EQ(what("icrnl", {0x0D}), "byte 0 0d -> 0a");
  EXPECT_EQ(what("onlcr", {1, 0x0A}), "byte 1 0a -> 0d 0a");
  EXPECT_EQ(what("istrip", {0x7E, 1, 0x7F}), "nothing");
}

TEST(TerminalRecordTest, AFrameThatLosesAllVanishes) {
  EXPECT_TRUE(SendWithoutPause(Spec("wire.terminal", {{"flag", "igncr"}}), Bytes(5, 0x0D), 1).at(0).empty());
}

}  // namespace
}  // namespace tiltproof::faults
