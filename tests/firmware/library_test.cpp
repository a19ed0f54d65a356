// The shared libraries as files: what they show, what they refuse, what they allocate, that they repeat
// themselves.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <limits>
#include <set>
#include <sstream>

#include "tests/firmware/allocation_counter.h"
#include "tests/firmware/fake_board.h"

namespace tiltproof::firmware {
namespace {

using ::testing::IsSubsetOf;

constexpr TimeNs kMs = kNsPerMs;

std::string OutputOf(const std::string& command) {
  FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) throw std::runtime_error("cannot run " + command);
  std::string output;
  std::array<char, 4096> buffer;
  while (const std::size_t count = std::fread(buffer.data(), 1, buffer.size(), pipe))
    output.append(buffer.data(), count);
  if (pclose(pipe) != 0) throw std::runtime_error("failed: " + command);
  return output;
}

// The names in the last column of `nm`'s output.
std::set<std::string> Symbols(const std::string& nm_arguments) {
  std::set<std::string> names;
  std::istringstream lines(OutputOf("nm " + nm_arguments));
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line.back() == ':') continue;
    names.insert(line.substr(line.rfind(' ') + 1));
  }
  return names;
}

const std::set<std::string> kInterface = {
    "tiltproof_client_abi_version", "tiltproof_client_create",  "tiltproof_client_destroy",
    "tiltproof_client_start",       "tiltproof_client_receive", "tiltproof_client_grant",
    "tiltproof_client_reset",       "tiltproof_client_status",  "tiltproof_client_role"};

class LibraryTest : public ::testing::TestWithParam<const char*> {
 protected:
  ClientLibrary library_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Files, LibraryTest,
                         ::testing::Values(TILTPROOF_FIRMWARE_LIBRARY, MINIMAL_FIRMWARE_LIBRARY),
                         [](const auto& file) { return file.index == 0 ? "own" : "minimal_c"; });

TEST_P(LibraryTest, ShowsTheInterfaceAndNothingElse) {
  std::set<std::string> shown = Symbols("-D --defined-only " + std::string(GetParam()));
  // The linker adds the bounds of the sections in which a fuzzer counts.
  std::erase_if(shown, [](const std::string& name) {
    return name.starts_with("__start___sancov") || name.starts_with("__stop___sancov");
  });
  EXPECT_THAT(shown, IsSubsetOf(kInterface));
  EXPECT_GE(shown.size(), kInterface.size() - 2);  // status and role are optional
}

TEST_P(LibraryTest, RefusesWhatItCannotBe) {
  const auto transmit = [](void*, int, std::int64_t now_ns, const std::uint8_t*, std::size_t) {
    return now_ns;
  };
  const TiltproofHost good{
      TILTPROOF_CLIENT_ABI_VERSION, "paper", "paper", nullptr, transmit, nullptr, nullptr, nullptr};
  TiltproofClient* client = library_.create(&good);
  ASSERT_NE(client, nullptr);
  library_.start(client, 0);  // there is no log
  library_.destroy(client);

  TiltproofHost other_version = good;
  other_version.abi_version = TILTPROOF_CLIENT_ABI_VERSION + 1;
  EXPECT_EQ(library_.create(&other_version), nullptr);
  TiltproofHost other_dialect = good;
  other_dialect.dialect = "klingon";
  EXPECT_EQ(library_.create(&other_dialect), nullptr);
  EXPECT_EQ(library_.abi_version(), TILTPROOF_CLIENT_ABI_VERSION);
}

// A server that answers with noise, good replies and damaged ones; the same seed gives the same script,
// `piece_bytes` at a time.
std::vector<Sent> PlayNoise(const ClientLibrary& library, const char* firmware, std::size_t piece_bytes) {
  FakeBoard board(library, firmware, "paper");
  std::uint32_t state = 12345;
  const auto random = [&state](std::uint32_t bound) {
    state = state * 1664525U + 1013904223U;
    return (state >> 16) % bound;
  };
  std::vector<Sent> sent;
  TimeNs wake = board.Start(0);
  for (int period = 0; period < 3000; ++period) {
    const TimeNs now = period * 12 * kMs + kMs;
    std::array<float, 16> values{};
    for (float& value : values) value = static_cast<float>(random(2000)) * 1e-3F - 1.0F;
    Bytes bytes = Frame(values);
    for (std::uint32_t damage = random(4); damage > 0; --damage) {
      bytes[random(static_cast<std::uint32_t>(bytes.size()))] = static_cast<std::uint8_t>(random(256));
    }
    if (random(3) == 0) bytes.resize(random(static_cast<std::uint32_t>(bytes.size())));
    const int uart = random(4) == 0 ? TILTPROOF_UART_REFERENCE : TILTPROOF_UART_MAIN;
    for (std::size_t i = 0; i < bytes.size(); i += piece_bytes) {
      const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(i);
      wake = board.Receive(
          now, Bytes(begin, begin + static_cast<std::ptrdiff_t>(std::min(piece_bytes, bytes.size() - i))),
          uart);
    }
    while (wake <= (period + 1) * 12 * kMs) {
      const TimeNs next = board.Grant(wake);
      EXPECT_GT(next, wake);
      wake = next;
    }
    for (Sent& one : board.TakeSent()) sent.push_back(std::move(one));
  }
  return sent;
}

TEST_P(LibraryTest, RepeatsItselfThroughNoiseInAnyPieces) {
  for (const char* firmware : {"paper", "tolerant"}) {
    const std::vector<Sent> whole = PlayNoise(library_, firmware, 1000);
    EXPECT_GT(whole.size(),
              3200U);  // a request each period, and actuators for the one reply in eight that survives
    EXPECT_EQ(PlayNoise(library_, firmware, 1000), whole);
    EXPECT_EQ(PlayNoise(library_, firmware, 7), whole);
    EXPECT_EQ(PlayNoise(library_, firmware, 1), whole);
  }
}

struct CountingHost {
  std::size_t sent_count = 0;
  static std::int64_t Transmit(void* context, int, std::int64_t now_ns, const std::uint8_t*, std::size_t) {
    ++static_cast<CountingHost*>(context)->sent_count;
    return now_ns;
  }
};

TEST(HostLibraryTest, AllocatesInCreateOnly) {
  const ClientLibrary library(TILTPROOF_FIRMWARE_LIBRARY);
  CountingHost counter;
  const TiltproofHost host{TILTPROOF_CLIENT_ABI_VERSION, "tolerant", "paper", &counter,
                           &CountingHost::Transmit,      nullptr,    nullptr, nullptr};
  const Bytes reply = Frame(std::array<float, 16>{});
  const Bytes reference = Frame(std::array<float, 7>{});
  // Faults: a height that jumps, one that is no number, a turn that nothing explains, a reference far away.
  std::array<float, 16> values{};
  values[2] = 3;
  const Bytes jump = Frame(values);
  values[2] = std::numeric_limits<float>::quiet_NaN();
  const Bytes no_number = Frame(values);
  values = {};
  values[11] = 30;
  const Bytes turn = Frame(values);
  const Bytes far_away = Frame(std::array<float, 7>{50, 0, 0, 0, 0, 0, 0});
  const std::array replies = {&reply, &jump, &no_number, &turn};
  const std::size_t before_create = AllocationCount();
  TiltproofClient* client = library.create(&host);
  ASSERT_NE(client, nullptr);

  const std::size_t before = AllocationCount();
  EXPECT_GT(before, before_create);
  library.start(client, 0);
  for (int period = 0; period < 100; ++period) {
    const TimeNs now = period * 12 * kMs;
    library.grant(client, now);
    const Bytes& follow = period % 50 < 30 ? reference : far_away;
    library.receive(client, TILTPROOF_UART_REFERENCE, now, follow.data(), follow.size());
    const Bytes& answer =
        period < 20 ? reply : *replies[static_cast<std::size_t>(period) / 4 % replies.size()];
    if (period % 5 != 0)
      library.receive(client, TILTPROOF_UART_MAIN, now + kMs, answer.data(), answer.size());
    library.grant(client, now + kMs);
    library.grant(client, now + 6 * kMs);
  }
  library.reset(client, 2000 * kMs);
  EXPECT_EQ(AllocationCount(), before);
  EXPECT_GT(counter.sent_count, 150U);
  library.destroy(client);
}

// The objects that go on the board ask for no heap, no exceptions, no run-time types, and no clock.
TEST(CoreTest, NeedsNoRunTimeSystem) {
  for (const std::string& name : Symbols("-u " FIRMWARE_CORE_ARCHIVE)) {
    for (const char* forbidden : {"_Zn", "malloc", "calloc", "realloc", "__cxa_throw", "__cxa_begin_catch",
                                  "__dynamic_cast", "_ZTI", "__cxa_guard", "_ZSt", "clock", "time"}) {
      EXPECT_NE(name.rfind(forbidden, 0), 0U) << name;
    }
  }
}

// The elementary functions differ between C libraries and processors: with one of them, the firmware would not compute
// the same bits on every board.
TEST(CoreTest, CallsNoFunctionOfMath) {
  std::ifstream list(TILTPROOF_SOURCE_DIR "/link/deterministic_math.list");
  const std::string text{std::istreambuf_iterator<char>(list), {}};
  std::set<std::string> functions;
  for (std::size_t end = 0; (end = text.find(";\n", end)) != std::string::npos; ++end)
    functions.insert(text.substr(text.rfind(' ', end) + 1, end - text.rfind(' ', end) - 1));
  ASSERT_TRUE(functions.contains("sin") && functions.contains("atan2f") && functions.contains("pow"));
  for (const std::string& name : Symbols("-u " FIRMWARE_CORE_ARCHIVE))
    EXPECT_FALSE(functions.contains(name)) << name;
}

TEST(HostLibraryTest, KnowsItsBuilds) {
  const ClientLibrary library(TILTPROOF_FIRMWARE_LIBRARY);
  EXPECT_THROW(FakeBoard(library, "no-such-build", "paper"), std::runtime_error);
  for (const char* build : {"paper", "paper_published", "tolerant"}) {
    for (const char* dialect : {"paper", "provant", "hardened"}) {
      EXPECT_NO_THROW(FakeBoard(library, build, dialect));
    }
  }
  EXPECT_EQ(library.create(nullptr), nullptr);
}

}  // namespace
}  // namespace tiltproof::firmware
