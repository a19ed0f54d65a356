// QEMU with the lockstep plug-in as a child process: an emulated STM32F405 that runs only when and as far as
// it is told.
//
//   EmulatorProcess board({.image = "executive-paper.elf", .plugin = "tiltproof_lockstep.so"});
//   board.Send(lockstep::Kind::kReceive, bytes);
//   const lockstep::Stopped stopped = board.Run({12'000'000, 0, 0, 0}, [](const EmulatorMessage& message) { ... });
//
// An emulator that does not answer within kHungAfterNs of its own time (harness/process/own_time.h), or ends
// by itself, causes EmulatorTrouble, with QEMU's last output. Times are virtual
// (harness/emulator/lockstep_protocol.h).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "harness/emulator/lockstep_protocol.h"
#include "link/frame_cutter.h"
#include "link/time.h"

namespace tiltproof::harness {

class ChildProcess;
class SharedProcessor;

struct EmulatorSpec {
  std::string image;   // an ELF file for the machine, or a raw image for address 0
  std::string plugin;  // the lockstep plug-in
  // Numbers of the USARTs (1 to 6); 0: none.
  int main_usart = 2, reference_usart = 3, console_usart = 1;
  // The same of lines to other boards, in their order; at most lockstep::kLineUsartsMax.
  std::vector<int> line_usarts = {};
  int hse_hz = 8'000'000;   // the crystal's; 0: there is none
  std::uint32_t place = 0;  // of the board among several, for an image that asks
  // The processor stops when it has sent such an end of a frame on the main line.
  link::FrameEnd frame_end = std::uint8_t{0};
  // For a debugger: the port of QEMU's gdb server on this machine, 0 for none. The emulator then waits for no one's
  // time limit, and `halted` for the debugger's word before the first instruction.
  int gdb_port = 0;
  bool halted = false;
  // The lines have no rate: sending takes no time.
  bool ideal_lines = false;
  // Blocks of code that are executed are counted: EmulatorProcess::BlockCounts().
  bool coverage = false;
};

// Arguments of QEMU that load the plug-in with the rest of its own arguments, "a=1,b=2".
std::vector<std::string> PluginArguments(const EmulatorSpec& spec, const std::string& arguments);

// QEMU's reason to give up the processor, from its output: "Lockup: can't escalate 3 to HardFault ..."; empty when it
// did not.
std::string FatalLine(std::string_view errors);
// As a user reads it: "reset by ...".
std::string_view Name(lockstep::ResetCause cause);

// The emulated board or its emulator failed.
struct EmulatorTrouble : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct EmulatorMessage {
  lockstep::Kind kind{};
  std::vector<std::uint8_t> body;

  // Throws EmulatorTrouble when the body is too short for it.
  template <class Body>
  Body As() const;
  // As many as fit.
  template <class Body>
  std::vector<Body> All() const;
};

class EmulatorProcess {
 public:
  static constexpr TimeNs kHungAfterNs = 5 * kNsPerS;

  // Starts QEMU and waits for the plug-in's greeting, before the first instruction. Throws EmulatorTrouble.
  explicit EmulatorProcess(const EmulatorSpec& spec);
  ~EmulatorProcess();
  EmulatorProcess(const EmulatorProcess&) = delete;
  EmulatorProcess& operator=(const EmulatorProcess&) = delete;

  // Queues a command; it is sent with the next Run(). More bodies than a message may have go in several.
  template <class Body>
  void Send(lockstep::Kind kind, std::span<const Body> bodies) {
    constexpr std::size_t kBodiesMax = lockstep::kBodyBytesMax / sizeof(Body);
    do {
      const auto part = bodies.first(std::min(bodies.size(), kBodiesMax));
      Append(kind, std::as_bytes(part));
      bodies = bodies.subspan(part.size());
    } while (!bodies.empty());
  }
  template <class Body>
  requires std::is_trivially_copyable_v<Body>
  void Send(lockstep::Kind kind, const Body& body) { Send(kind, std::span<const Body>(&body, 1)); }

  // Lets it run until it stops, and passes on the messages that it sends before that.
  lockstep::Stopped Run(const lockstep::Run& run,
                        const std::function<void(const EmulatorMessage&)>& on_message);

  // A turn until then changes nothing and may be left out: the processor sleeps, by itself for longer than that, and has been sent
  // nothing since its last turn.
  bool SleepsBeyond(TimeNs until_ns) const { return sleeps_until_ns_ > until_ns; }

  // Processor time that it has used since its start, with all of its threads (harness/process/own_time.h).
  TimeNs ProcessorTime() const;

  // Only while it is stopped.
  std::vector<std::uint8_t> ReadMemory(std::uint32_t address, std::uint32_t size);
  std::string Registers();
  lockstep::UsartStates UsartStates();
  // The lowest address in use so far in each watched stack (lockstep::Kind::kWatchStacks).
  std::vector<std::uint32_t> LowestStackAddresses();

  // The number of executions of each block of code, by its place (lockstep::BlockCounts); also when the emulator has
  // ended. Empty unless its spec asks for coverage.
  std::span<const std::uint8_t> BlockCounts() const;

  // QEMU's output so far: empty, unless something is wrong.
  const std::string& Errors();

 private:
  void Append(lockstep::Kind kind, std::span<const std::byte> body);
  void Flush();
  EmulatorMessage Next();
  void Read(std::span<std::uint8_t> into);
  [[noreturn]] void ThrowEnded();

  struct Unmap {
    void operator()(lockstep::BlockCounts* counts) const;
  };

  int socket_ = -1;
  std::unique_ptr<lockstep::BlockCounts, Unmap> block_counts_;
  TimeNs hung_after_ns_;
  std::unique_ptr<ChildProcess> process_;
  std::unique_ptr<SharedProcessor> together_;
  std::vector<std::byte> out_;
  std::vector<std::uint8_t> in_;
  std::size_t in_taken_ = 0;
  TimeNs sleeps_until_ns_ = 0;
  std::string errors_;
};

template <class Body>
Body EmulatorMessage::As() const {
  static_assert(std::is_trivially_copyable_v<Body>);
  if (body.size() < sizeof(Body)) throw EmulatorTrouble("the emulator's plug-in sent a damaged message");
  Body value;
  std::copy_n(body.begin(), sizeof(Body), reinterpret_cast<std::uint8_t*>(&value));
  return value;
}

template <class Body>
std::vector<Body> EmulatorMessage::All() const {
  static_assert(std::is_trivially_copyable_v<Body>);
  std::vector<Body> values(body.size() / sizeof(Body));
  std::copy_n(body.begin(), values.size() * sizeof(Body), reinterpret_cast<std::uint8_t*>(values.data()));
  return values;
}

}  // namespace tiltproof::harness
