// A program that flies in lockstep, as a process with a socket: started, listened to, watched, and ended with all that
// it has started.
//
//   ProgramProcess process({.name = "program:python3 controller.py", .command = "python3 controller.py"}, on_line);
//   process.Send(bytes, "grant");
//   const ProgramMessage message = process.Next();   // waits; throws FirmwareTrouble when none comes
#pragma once

#include <chrono>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "harness/client/firmware_end.h"
#include "harness/client/line_splitter.h"
#include "harness/client/program_messages.h"
#include "harness/process/child_process.h"
#include "harness/process/own_time.h"
#include "harness/process/shared_processor.h"
#include "link/time.h"
#include "link/unix_socket.h"

namespace tiltproof::harness {

struct ProgramSpec {
  std::string name;                                                   // as the user wrote it: "program:./fw"
  std::string command;                                                // for sh -c
  std::vector<std::pair<std::string, std::string>> environment = {};  // added to ours
  // The preloaded clock connects, not the program, which a reset starts again.
  bool clocked = false;
  int uart_count = 2;  // on which it may send
};

class ProgramProcess {
 public:
  // As for a library: the program's own time (harness/process/own_time.h) until it must have answered.
  static constexpr TimeNs kHungAfterNs = 5 * kNsPerS;
  // Its own time until it must have ended, after the flight.
  static constexpr TimeNs kEndsWithinNs = kNsPerS;
  // A longer answer lets no time pass.
  static constexpr std::uint64_t kAnswerBytesMax = std::uint64_t{64} << 20;

  // `on_line`: gets each line that the program prints, within calls of TakeOutput().
  using OnLine = std::function<void(std::string)>;

  // Throws std::runtime_error when this machine has no place for a program's socket.
  static void TrySocket();

  // Returns when it has connected. Throws std::runtime_error when it does not: with the way out, for a user.
  ProgramProcess(const ProgramSpec& spec, OnLine on_line);
  ~ProgramProcess();
  ProgramProcess(const ProgramProcess&) = delete;
  ProgramProcess& operator=(const ProgramProcess&) = delete;

  // Begins an exchange. `what`: its name, for messages: "grant".
  void Send(std::span<const std::uint8_t> bytes, const char* what);
  // Adds to the exchange under way.
  void Answer(std::span<const std::uint8_t> bytes) { SendAll(bytes); }
  // The next message of the answer. Throws FirmwareTrouble: it ended, hung, stopped itself or broke the protocol.
  ProgramMessage Next();
  // Ends the exchange. Throws FirmwareTrouble when the answer goes on.
  void EndAnswer() const;

  // Passes on what it has printed: complete lines, or everything. Of what it prints between two calls, the last 0.5 MiB
  // are kept.
  void TakeOutput(bool all);

  // A message of the kind kRefused, in what it has sent and was not taken; after a FirmwareTrouble.
  std::optional<ProgramMessage> FindRefusal();

  // True: it has ended by itself, and no signal ended it.
  bool has_exited() const {
    bool crashed = false;
    return HowEnded(crashed) && !crashed;
  }

  // Waits until it has ended of its own accord. Nullopt: it did, with code 0. Otherwise what it did instead.
  std::optional<FirmwareTrouble> AwaitEnd();

 private:
  void Accept(int listener);
  void SendAll(std::span<const std::uint8_t> bytes);
  bool Receive(int flags);
  void LookAtTime();
  void DrainOutput();
  // False: it lives on, and has had this much time.
  bool EndsWithin(TimeNs own_ns);
  [[noreturn]] void ThrowEnded();
  std::optional<std::string> HowEnded(bool& crashed) const;

  std::string name_;
  bool clocked_;
  OnLine on_line_;
  LineSplitter splitter_;
  std::deque<std::string> lines_;  // printed, and not passed on
  std::size_t lines_bytes_ = 0, dropped_count_ = 0;
  link::OwnedDescriptor output_, socket_;
  std::unique_ptr<ChildProcess> child_;
  std::unique_ptr<SharedProcessor> together_;
  ProgramReader reader_;
  const char* what_ = "hello";
  // The exchange under way.
  std::uint64_t began_at_ = 0;  // bytes received before it
  int receives_count_ = 0;
  bool turn_ended_ = true;
  std::optional<OwnTime> own_;
};

}  // namespace tiltproof::harness
