#include "harness/emulator/emulator_process.h"

#include <poll.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include "harness/emulator/frame_end_text.h"
#include "harness/process/child_process.h"
#include "harness/process/own_time.h"
#include "harness/process/shared_processor.h"
#include "link/check.h"
#include "link/unix_socket.h"

namespace tiltproof::harness {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t kErrorBytesMax = 65536;
constexpr std::size_t kReadBytes = 65536;

std::vector<std::string> CommandLine(const EmulatorSpec& spec) {
  // shift=3: every instruction takes 8 ns, as on a chip that executes 125 million a second. A chip at 168 MHz comes
  // near that, with its wait states and its instructions of more than one cycle.
  std::vector<std::string> command = {
      "qemu-system-arm", "-M",   "netduinoplus2", "-display", "none",
      "-monitor",        "none", "-nodefaults",   "-icount",  "shift=3,sleep=off"};
  std::string lines;
  for (std::size_t i = 0; i < spec.line_usarts.size(); ++i)
    lines += ",line" + std::to_string(i) + "=" + std::to_string(spec.line_usarts[i]);
  const auto plugin = PluginArguments(
      spec, "socket=3,barrier=" + FrameEndText(spec.frame_end) + ",main=" + std::to_string(spec.main_usart) +
                ",reference=" + std::to_string(spec.reference_usart) + ",console=" +
                std::to_string(spec.console_usart) + lines + (spec.ideal_lines ? ",ideal=on" : "") +
                (spec.coverage ? ",coverage=4" : "") + (spec.gdb_port != 0 ? ",debugged=on" : ""));
  command.insert(command.end(), plugin.begin(), plugin.end());
  if (spec.gdb_port != 0)
    command.insert(command.end(), {"-gdb", "tcp:127.0.0.1:" + std::to_string(spec.gdb_port)});
  if (spec.halted) command.push_back("-S");
  command.insert(command.end(), {"-kernel", spec.image});
  return command;
}

}  // namespace

std::vector<std::string> PluginArguments(const EmulatorSpec& spec, const std::string& arguments) {
  return {"-plugin", spec.plugin + "," + arguments + ",hse=" + std::to_string(spec.hse_hz)};
}

std::string FatalLine(std::string_view errors) {
  constexpr std::string_view kFatal = "qemu: fatal: ";
  const std::size_t fatal = errors.find(kFatal);
  if (fatal == errors.npos) return {};
  errors.remove_prefix(fatal + kFatal.size());
  return std::string(errors.substr(0, errors.find('\n')));
}

std::string_view Name(lockstep::ResetCause cause) {
  switch (cause) {
    case lockstep::ResetCause::kPin:
      return "pin";
    case lockstep::ResetCause::kWatchdog:
      return "watchdog";
    case lockstep::ResetCause::kSoftware:
      return "the firmware itself";
    case lockstep::ResetCause::kNone:
      break;
  }
  return "unknown";
}

EmulatorProcess::EmulatorProcess(const EmulatorSpec& spec)
    : hung_after_ns_(spec.gdb_port == 0 ? kHungAfterNs : kNever) {
  std::array<int, 2> ends{};
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
    throw EmulatorTrouble(std::string("no socket for the emulator: ") + std::strerror(errno));
  socket_ = ends[0];
  try {
    ChildSpec child;
    child.command = CommandLine(spec);
    child.output = ChildSpec::kNull;
    child.error = ChildSpec::kPipe;
    child.descriptors = {ends[1]};
    link::OwnedDescriptor counts;
    if (spec.coverage) {
      counts = link::OwnedDescriptor(memfd_create("coverage", MFD_CLOEXEC));
      void* memory = MAP_FAILED;
      if (counts.get() >= 0 && ftruncate(counts.get(), sizeof(lockstep::BlockCounts)) == 0)
        memory = mmap(nullptr, sizeof(lockstep::BlockCounts), PROT_READ, MAP_SHARED, counts.get(), 0);
      if (memory == MAP_FAILED)
        throw EmulatorTrouble(std::string("no memory for the emulator's coverage: ") + std::strerror(errno));
      block_counts_.reset(static_cast<lockstep::BlockCounts*>(memory));
      child.descriptors.push_back(counts.get());
    }
    process_ = std::make_unique<ChildProcess>(child);
    close(ends[1]);
    ends[1] = -1;
    together_ = std::make_unique<SharedProcessor>(process_->pid());
    const EmulatorMessage hello = Next();
    if (hello.kind != lockstep::Kind::kHello ||
        hello.As<lockstep::Hello>().protocol_version != lockstep::kProtocolVersion)
      throw EmulatorTrouble("the plug-in " + spec.plugin + " is of another build of tiltproof");
  } catch (...) {
    if (ends[1] >= 0) close(ends[1]);
    close(socket_);
    throw;
  }
}

EmulatorProcess::~EmulatorProcess() {
  close(socket_);
  // It leaves at the end of its socket; while it computes, it would not hear SIGTERM.
  process_->Stop(milliseconds(0));
}

void EmulatorProcess::Append(lockstep::Kind kind, std::span<const std::byte> body) {
  Check(body.size() <= lockstep::kBodyBytesMax, "a command to the plug-in has a body of the allowed size");
  if (kind != lockstep::Kind::kReadMemory) sleeps_until_ns_ = 0;
  const lockstep::Header header{kind, static_cast<std::uint32_t>(body.size())};
  const auto bytes = std::as_bytes(std::span(&header, 1));
  out_.insert(out_.end(), bytes.begin(), bytes.end());
  out_.insert(out_.end(), body.begin(), body.end());
}

void EmulatorProcess::Flush() {
  for (std::size_t sent = 0; sent < out_.size();) {
    const ssize_t n = send(socket_, out_.data() + sent, out_.size() - sent, MSG_NOSIGNAL);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) ThrowEnded();
    sent += static_cast<std::size_t>(n);
  }
  out_.clear();
}

void EmulatorProcess::Read(std::span<std::uint8_t> into) {
  while (!into.empty()) {
    if (in_taken_ < in_.size()) {
      const std::size_t n = std::min(into.size(), in_.size() - in_taken_);
      CheckPart(in_taken_, n, in_.size(), "bytes of the plug-in are taken from those that came");
      std::copy_n(in_.begin() + static_cast<std::ptrdiff_t>(in_taken_), n, into.begin());
      in_taken_ += n;
      into = into.subspan(n);
      continue;
    }
    if (AwaitInput(socket_, process_->pid(), hung_after_ns_) != Input::kReady)
      throw EmulatorTrouble("the emulator has not come to the end of its turn within " +
                            std::to_string(kHungAfterNs / kNsPerS) + " s of its own time");
    in_.resize(kReadBytes);
    in_taken_ = 0;
    const ssize_t n = recv(socket_, in_.data(), in_.size(), 0);
    in_.resize(n > 0 ? static_cast<std::size_t>(n) : 0);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) ThrowEnded();
  }
}

EmulatorMessage EmulatorProcess::Next() {
  lockstep::Header header{};
  Read({reinterpret_cast<std::uint8_t*>(&header), sizeof(header)});
  if (header.body_bytes > lockstep::kBodyBytesMax)
    throw EmulatorTrouble("the emulator's plug-in sent a damaged message");
  EmulatorMessage message{header.kind, std::vector<std::uint8_t>(header.body_bytes)};
  Read(message.body);
  return message;
}

lockstep::Stopped EmulatorProcess::Run(const lockstep::Run& run,
                                       const std::function<void(const EmulatorMessage&)>& on_message) {
  Send(lockstep::Kind::kRun, run);
  together_->BeginTurn();
  Flush();
  for (bool first = true;; first = false) {
    const EmulatorMessage message = Next();
    if (first) together_->EndTurn();
    if (message.kind == lockstep::Kind::kStopped) {
      const auto stopped = message.As<lockstep::Stopped>();
      sleeps_until_ns_ = stopped.sleeps_until_ns;
      return stopped;
    }
    on_message(message);
  }
}

TimeNs EmulatorProcess::ProcessorTime() const { return harness::ProcessorTime(process_->pid()); }

std::vector<std::uint8_t> EmulatorProcess::ReadMemory(std::uint32_t address, std::uint32_t size) {
  Send(lockstep::Kind::kReadMemory, lockstep::ReadMemory{address, size});
  Flush();
  return Next().body;
}

std::string EmulatorProcess::Registers() {
  Append(lockstep::Kind::kDumpState, {});
  Flush();
  const EmulatorMessage state = Next();
  return {state.body.begin(), state.body.end()};
}

lockstep::UsartStates EmulatorProcess::UsartStates() {
  Append(lockstep::Kind::kReadUsarts, {});
  Flush();
  return Next().As<lockstep::UsartStates>();
}

std::vector<std::uint32_t> EmulatorProcess::LowestStackAddresses() {
  Append(lockstep::Kind::kReadStacks, {});
  Flush();
  return Next().All<std::uint32_t>();
}

void EmulatorProcess::Unmap::operator()(lockstep::BlockCounts* counts) const {
  munmap(counts, sizeof *counts);
}

std::span<const std::uint8_t> EmulatorProcess::BlockCounts() const {
  if (!block_counts_) return {};
  return block_counts_->counts;
}

const std::string& EmulatorProcess::Errors() {
  std::array<char, 4096> buffer;
  for (ssize_t n;
       errors_.size() < kErrorBytesMax && (n = read(process_->error(), buffer.data(), buffer.size())) > 0;)
    errors_.append(buffer.data(), static_cast<std::size_t>(n));
  return errors_;
}

void EmulatorProcess::ThrowEnded() {
  // Its last words are there once it is gone.
  pollfd ended{process_->pidfd(), POLLIN, 0};
  poll(&ended, 1, 1000);
  const std::string errors = Errors();
  const std::string how = process_->ExitText().value_or("has closed its socket");
  throw EmulatorTrouble("the emulator " + how + (errors.empty() ? "" : ": " + errors));
}

}  // namespace tiltproof::harness
