#include "harness/emulator/lockstep_self_test.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "harness/emulator/emulator_process.h"
#include "harness/process/child_process.h"

namespace tiltproof::harness {
namespace {

constexpr int kVersionTimeout_ms = 5000;
constexpr std::int64_t kTickNs = 1'000'000;

// A flag on USART2 every millisecond, and before it the byte that has arrived, if one has. In Thumb code:
//
//   reset: ldr r4, =0x40004400; movs r0, #16; str r0, [r4, #8]            USART2: 1 Mbaud of 16 MHz (BRR)
//          movw r0, #0x200C; str r0, [r4, #0xC]                           on, transmitter and receiver (CR1)
//          ldr r1, =0xE000E010; ldr r0, =15999; str r0, [r1, #4]          SysTick reload: 1 ms at 16 MHz
//          movs r0, #0; str r0, [r1, #8]; movs r0, #7; str r0, [r1]       on, with its interrupt
//          movs r5, #0x7E
//   sleep: wfi; b sleep
//   tick:  ldr r0, [r4]; lsls r0, r0, #26; bpl flag                       SR: has a byte arrived?
//          ldr r0, [r4, #4]; str r0, [r4, #4]
//   flag:  str r5, [r4, #4]; bx lr
//   fail:  b fail
constexpr std::array<std::uint32_t, 31> kImage = {
    0x20001000, 0x00000041, 0x00000071, 0x00000071, 0x00000071, 0x00000071, 0x00000071, 0,
    0,          0,          0,          0x00000071, 0x00000071, 0,          0x00000071, 0x00000063,
    0x20104c0c, 0xf24260a0, 0x60e0000c, 0xf643490a, 0x6048607f, 0x60882000, 0x60082007, 0xbf30257e,
    0x6820e7fd, 0xd5010680, 0x60606860, 0x47706065, 0x0000e7fe, 0x40004400, 0xe000e010};

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

struct Sent {
  std::int64_t at_ns;
  std::vector<std::uint8_t> bytes;
  friend bool operator==(const Sent&, const Sent&) = default;
};

constexpr std::uint8_t kBarrier = 0x7E;  // what the firmware above sends

// 20 ms: a byte arrives at 5.5 ms, and the processor stands still from 7.5 to 12.2 ms.
std::vector<Sent> Fly(const std::string& plugin, const std::string& image) {
  EmulatorProcess board({.image = image, .plugin = plugin, .barrier = kBarrier});
  board.Send(lockstep::Kind::kReceive, lockstep::ReceivedByte{.arrival_ns = 5'500'000,
                                                              .usart = lockstep::Usart::kMain,
                                                              .byte = 'A',
                                                              .mark = lockstep::Mark::kNone,
                                                              .waits = false});
  board.Send(lockstep::Kind::kStall, lockstep::Stall{7'500'000, 12'200'000, lockstep::ResetCause::kNone, 0});
  std::vector<Sent> sent;
  for (std::int64_t at = 0; at < 20 * kTickNs;)
    at = board
             .Run(20 * kTickNs,
                  [&](const EmulatorMessage& message) {
                    if (message.kind != lockstep::Kind::kTransmit) return;
                    Sent& now = sent.emplace_back();
                    for (const auto& byte : message.All<lockstep::TransmittedByte>()) {
                      now.at_ns = byte.at_ns;
                      now.bytes.push_back(byte.byte);
                    }
                  })
             .at_ns;
  return sent;
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
    throw NoSuchProgram("there is no qemu-system-arm: install Debian's package of that name");
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
  std::vector<Sent> sent;
  try {
    sent = Fly(plugin, image.path());
    if (Fly(plugin, image.path()) != sent) Refuse("two runs of the same firmware differ");
  } catch (const EmulatorTrouble& trouble) {
    Refuse(trouble.what());
  }
  // Ticks 1 to 7 and 13 to 19; the one that fell due in the stall comes at its end.
  std::vector<std::int64_t> due;
  for (std::int64_t tick = 1; tick < 20; ++tick)
    if (tick <= 7 || tick >= 13) due.push_back(tick * kTickNs);
  due.insert(due.begin() + 7, 12'200'000);
  constexpr std::int64_t kLateMax = 2'000;
  if (sent.size() != due.size())
    Refuse(fmt::format("of {} interrupts of the SysTick {} have come", due.size(), sent.size()));
  for (std::size_t i = 0; i < due.size(); ++i) {
    if (sent[i].at_ns < due[i] - kLateMax || sent[i].at_ns > due[i] + kLateMax)
      Refuse(fmt::format("an interrupt that was due at {} ns has come at {} ns", due[i], sent[i].at_ns));
    const bool echo = i == 5;
    if (sent[i].bytes !=
        (echo ? std::vector<std::uint8_t>{'A', kBarrier} : std::vector<std::uint8_t>{kBarrier}))
      Refuse("a byte has not arrived at its time");
  }
}

}  // namespace tiltproof::harness
