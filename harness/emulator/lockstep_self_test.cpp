#include "harness/emulator/lockstep_self_test.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include "harness/emulator/emulator_process.h"
#include "harness/process/child_process.h"

namespace tiltproof::harness {
namespace {

constexpr int kVersionTimeout_ms = 5000;
constexpr std::int64_t kTickNs = 1'000'000;

// A flag on USART2 every millisecond, and before it the byte that has arrived, if one has. In Thumb code:
//
//   reset: ldr r4, =0x40023840; movs r0, #1; lsls r0, r0, #17; str r0, [r4]   USART2's clock (RCC_APB1ENR)
//          ldr r4, =0x40004400; movs r0, #16; str r0, [r4, #8]            USART2: 1 Mbaud of 16 MHz (BRR)
//          movw r0, #0x200C; str r0, [r4, #0xC]                           on, transmitter and receiver (CR1)
//          ldr r1, =0xE000E010; ldr r0, =15999; str r0, [r1, #4]          SysTick reload: 1 ms at 16 MHz
//          movs r0, #0; str r0, [r1, #8]; movs r0, #7; str r0, [r1]       on, with its interrupt
//          movs r5, #0x7E
//   sleep: wfi; b sleep
//   tick:  ldr r0, [r4]; lsls r0, r0, #26; bpl flag                       SR: has a byte arrived?
//          ldr r0, [r4, #4]; str r0, [r4, #4]
//   flag:  str r5, [r4, #4]; bx lr
//   fail:  b fail
constexpr std::array<std::uint32_t, 34> kImage = {
    0x20001000, 0x00000041, 0x00000079, 0x00000079, 0x00000079, 0x00000079, 0x00000079,
    0,          0,          0,          0,          0x00000079, 0x00000079, 0,
    0x00000079, 0x0000006b, 0x20014c0e, 0x60200440, 0x20104c0d, 0xf24260a0, 0x60e0000c,
    0xf643490b, 0x6048607f, 0x60882000, 0x60082007, 0xbf30257e, 0x6820e7fd, 0xd5010680,
    0x60606860, 0x47706065, 0xbf00e7fe, 0x40023840, 0x40004400, 0xe000e010};

[[noreturn]] void Refuse(const std::string& why) {
  throw std::runtime_error(
      fmt::format("lockstep with the emulator does not work here: {}. Fly it by the clock on the wall "
                  "(--client qemu --mode realtime), "
                  "or fly the host's build (--client host)",
                  why));
}

// In memory, under a name that another process can open.
class ImageFile {
 public:
  ImageFile() : descriptor_(memfd_create("tiltproof-self-test", MFD_CLOEXEC)) {
    const auto bytes = std::as_bytes(std::span(kImage));
    if (descriptor_ < 0 ||
        write(descriptor_, bytes.data(), bytes.size()) != static_cast<ssize_t>(bytes.size()))
      throw std::runtime_error("no memory for the self-test of the emulator");
  }
  ~ImageFile() { close(descriptor_); }
  ImageFile(const ImageFile&) = delete;
  ImageFile& operator=(const ImageFile&) = delete;
  std::string path() const { return fmt::format("/proc/{}/fd/{}", getpid(), descriptor_); }

 private:
  int descriptor_;
};

struct Flown {
  std::vector<std::pair<std::int64_t, std::uint8_t>> sent;  // each byte, and when
  std::vector<std::int64_t> stops_ns;
  friend bool operator==(const Flown&, const Flown&) = default;
};

constexpr std::uint8_t kBarrier = 0x7E;  // what the firmware above sends

// 20 ms: a byte arrives at 5.5 ms, and the processor stands still from 7.5 to 12.2 ms.
Flown Fly(const std::string& plugin, const std::string& image) {
  EmulatorProcess board({.image = image, .plugin = plugin, .frame_end = kBarrier});
  board.Send(lockstep::Kind::kReceive, lockstep::ReceivedByte{.arrival_ns = 5'500'000,
                                                              .word = 'A',
                                                              .usart = lockstep::Usart::kMain,
                                                              .mark = lockstep::Mark::kNone,
                                                              .waits = false});
  board.Send(lockstep::Kind::kStall, lockstep::Stall{7'500'000, 12'200'000, lockstep::ResetCause::kNone, 0});
  Flown flown;
  do {
    const auto stopped = board.Run({20 * kTickNs, 0, 0, 0}, [&](const EmulatorMessage& message) {
      if (message.kind != lockstep::Kind::kTransmit) return;
      for (const auto& byte : message.All<lockstep::TransmittedByte>())
        flown.sent.emplace_back(byte.at_ns, byte.byte);
    });
    flown.stops_ns.push_back(stopped.at_ns);
  } while (flown.stops_ns.back() < 20 * kTickNs);
  return flown;
}

}  // namespace

std::string QemuVersion() {
  ChildSpec spec;
  spec.command = {"qemu-system-arm", "--version"};
  spec.output = ChildSpec::kPipe;
  spec.error = ChildSpec::kNull;
  std::string text;
  try {
    ChildProcess process(spec);
    pollfd ended{process.pidfd(), POLLIN, 0};
    poll(&ended, 1, kVersionTimeout_ms);
    std::array<char, 4096> buffer;
    for (ssize_t n; (n = read(process.output(), buffer.data(), buffer.size())) > 0;)
      text.append(buffer.data(), static_cast<std::size_t>(n));
  } catch (const NoSuchProgram&) {
    throw NoSuchProgram(
        "there is no qemu-system-arm: sudo apt-get install --no-install-recommends qemu-system-arm");
  }
  constexpr std::string_view kBefore = "version ";
  const std::size_t at = text.find(kBefore);
  if (at == text.npos) throw std::runtime_error("qemu-system-arm --version names no version");
  const std::size_t begin = at + kBefore.size();
  return text.substr(begin, text.find_first_of(" \n", begin) - begin);
}

void CheckRelease() {
  const std::string version = QemuVersion();
  if (!version.starts_with(std::string(kLockstepQemuRelease) + "."))
    throw std::runtime_error(fmt::format(
        "the emulated board needs QEMU {}, whose chip the plug-in completes, and this is {}. Fly the host's "
        "build (--client host)",
        kLockstepQemuRelease, version));
}

void TestLockstep(const std::string& plugin) {
  CheckRelease();
  const ImageFile image;
  Flown flown;
  try {
    flown = Fly(plugin, image.path());
    if (Fly(plugin, image.path()) != flown) Refuse("two runs of the same firmware differ");
  } catch (const EmulatorTrouble& trouble) {
    Refuse(trouble.what());
  }
  // Ticks 1 to 7 and 13 to 19; the one that fell due in the stall comes at its end. With the sixth the byte comes back.
  std::vector<std::pair<std::int64_t, std::uint8_t>> due;
  for (std::int64_t tick = 1; tick < 20; ++tick) {
    if (tick == 6) due.emplace_back(tick * kTickNs, 'A');
    if (tick <= 7 || tick >= 13) due.emplace_back(tick * kTickNs, kBarrier);
    if (tick == 7) due.emplace_back(12'200'000, kBarrier);
  }
  constexpr std::int64_t kLateMax = 2'000;
  const auto is_at = [](std::int64_t at_ns, std::int64_t due_ns) {
    return at_ns >= due_ns - kLateMax && at_ns <= due_ns + kLateMax;
  };
  if (flown.sent.size() != due.size())
    Refuse(fmt::format("of {} bytes that were due {} have been sent", due.size(), flown.sent.size()));
  for (std::size_t i = 0; i < due.size(); ++i) {
    if (!is_at(flown.sent[i].first, due[i].first))
      Refuse(
          fmt::format("a byte that was due at {} ns was sent at {} ns", due[i].first, flown.sent[i].first));
    if (flown.sent[i].second != due[i].second) Refuse("a byte has not arrived at its time");
  }
  // At the end of a frame and of the time; the other flags end none.
  if (flown.stops_ns.size() != 2 || !is_at(flown.stops_ns.front(), 6 * kTickNs))
    Refuse("the processor does not stop where a frame ends");
}

}  // namespace tiltproof::harness
