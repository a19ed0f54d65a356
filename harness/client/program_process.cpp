#include "harness/client/program_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <stdexcept>

#include "firmware/tiltproof_program.h"
#include "harness/process/orphans.h"

namespace tiltproof::harness {
namespace {

using Clock = OwnTime::SteadyClock;

constexpr int kOutputBytes = 1 << 20;
// Limit on the lines that a program prints at once. The log of the flight has room for more.
constexpr std::size_t kKeptBytes = kOutputBytes / 2;
constexpr int kLook_ms = 100;
// An answer that comes in more pieces than this is looked at as one that does not come.
constexpr int kReceivesAtOnce = 16;
// A shell reports so that a signal has ended a program.
constexpr int kShellSignal = 128;

[[noreturn]] void ThrowErrno(const char* what) {
  throw std::runtime_error(fmt::format("{}: {}", what, std::strerror(errno)));
}

// Words for a program that speaks the protocol, and for one under the preloaded clock.
constexpr std::array<const char*, 2> kNotConnected = {"has not connected to TILTPROOF_SOCKET",
                                                      "has not loaded the virtual clock"};
constexpr std::array<const char*, 2> kWayOut = {
    "a program that only knows serial ports flies with --client 'clocked:CMD'; one that goes into the "
    "background must stay in the foreground",
    "a script starts its program with `exec`; one that is statically linked, set-user-ID or not for this "
    "processor cannot be held: fly it with process:CMD and --mode realtime"};

// A socket that listens at a path of its own, in a folder that only this user may enter. Both go with this object.
class Listener {
 public:
  Listener() {
    const char* const folder = std::getenv("TMPDIR");
    // Linux has room for 107 characters.
    for (const std::string& place : {std::string(folder == nullptr ? "/tmp" : folder), std::string("/tmp")}) {
      std::string path = place + "/tiltproof-XXXXXX";
      if (path.size() + sizeof kName > sizeof sockaddr_un::sun_path || mkdtemp(path.data()) == nullptr)
        continue;
      folder_ = path;
      break;
    }
    if (folder_.empty()) ThrowErrno("no folder for a program's socket in TMPDIR or /tmp");
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path().c_str(), sizeof address.sun_path - 1);
    descriptor_ = link::OwnedDescriptor(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    if (descriptor_.get() < 0 ||
        bind(descriptor_.get(), reinterpret_cast<sockaddr*>(&address), sizeof address) != 0 ||
        listen(descriptor_.get(), 1) != 0)
      ThrowErrno("no socket for a program");
  }
  ~Listener() {
    unlink(path().c_str());
    rmdir(folder_.c_str());
  }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  std::string path() const { return folder_ + kName; }
  int get() const { return descriptor_.get(); }

 private:
  static constexpr char kName[] = "/socket";
  std::string folder_;
  link::OwnedDescriptor descriptor_;
};

}  // namespace

void ProgramProcess::TrySocket() { const Listener listener; }

ProgramProcess::ProgramProcess(const ProgramSpec& spec, OnLine on_line)
    : name_(spec.name), clocked_(spec.clocked), on_line_(std::move(on_line)), reader_(spec.uart_count) {
  AdoptOrphans();
  const Listener listener;
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) ThrowErrno("no pipe for the program's output");
  output_ = link::OwnedDescriptor(ends[0]);
  const link::OwnedDescriptor write_end(ends[1]);
  fcntl(ends[0], F_SETFL, O_NONBLOCK);
  // Where that is not permitted it holds less.
  fcntl(ends[1], F_SETPIPE_SZ, kOutputBytes);
  ChildSpec child{.command = {"/bin/sh", "-c", spec.command},
                  .environment = spec.environment,
                  .output = ends[1],
                  .error = ends[1],
                  .guard_group = true};
  child.environment.emplace_back("TILTPROOF_SOCKET", listener.path());
  child.environment.emplace_back("TILTPROOF_PROTOCOL", std::to_string(TILTPROOF_PROGRAM_VERSION));
  child_ = std::make_unique<ChildProcess>(child);
  try {
    Accept(listener.get());
  } catch (...) {
    child_.reset();
    EndOrphans();
    throw;
  }
  together_ = std::make_unique<SharedProcessor>(child_->pid());
}

ProgramProcess::~ProgramProcess() {
  socket_ = link::OwnedDescriptor();
  together_.reset();
  child_->Stop(std::chrono::milliseconds(0));
  EndOrphans();
}

void ProgramProcess::Accept(int listener) {
  OwnTime own(child_->pid());
  for (;;) {
    const bool over = own.Look(Clock::now()) >= kHungAfterNs;
    const bool alive = child_->Alive();
    std::array<pollfd, 2> polled = {{{listener, POLLIN, 0}, {child_->pidfd(), POLLIN, 0}}};
    poll(polled.data(), polled.size(), over || !alive ? 0 : kLook_ms);
    if (alive) DrainOutput();
    socket_ = link::OwnedDescriptor(accept4(listener, nullptr, nullptr, SOCK_CLOEXEC));
    if (socket_.get() >= 0) break;
    if (!alive) {
      std::string last;
      on_line_ = [&last, log = on_line_](std::string line) {
        if (!line.empty()) last = line;
        log(std::move(line));
      };
      TakeOutput(true);
      throw std::runtime_error(fmt::format(
          "{} {} and {} (docs/program.md){}", name_, child_->ExitText().value_or("has ended"),
          kNotConnected[clocked_], last.empty() ? fmt::format("; {}", kWayOut[clocked_]) : ": " + last));
    }
    if (over)
      throw std::runtime_error(fmt::format("{} {} within {} s of its own time (docs/program.md); {}", name_,
                                           kNotConnected[clocked_], ToSeconds(kHungAfterNs),
                                           kWayOut[clocked_]));
  }
  const timeval look{0, kLook_ms * 1000L};
  setsockopt(socket_.get(), SOL_SOCKET, SO_RCVTIMEO, &look, sizeof look);
}

void ProgramProcess::Send(std::span<const std::uint8_t> bytes, const char* what) {
  what_ = what;
  began_at_ = reader_.offset();
  receives_count_ = 0;
  own_.reset();
  together_->BeginTurn();
  turn_ended_ = false;
  SendAll(bytes);
}

void ProgramProcess::SendAll(std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = send(socket_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (count > 0) {
      bytes = bytes.subspan(static_cast<std::size_t>(count));
    } else if (errno == EAGAIN) {
      // It does not read: perhaps since it writes.
      pollfd polled{socket_.get(), POLLIN | POLLOUT, 0};
      poll(&polled, 1, kLook_ms);
      if ((polled.revents & POLLIN) != 0) Receive(MSG_DONTWAIT);
      DrainOutput();
      LookAtTime();
    } else if (errno != EINTR) {
      ThrowEnded();
    }
  }
}

ProgramMessage ProgramProcess::Next() {
  try {
    for (;;) {
      if (const auto message = reader_.Next()) return *message;
      if (reader_.offset() - began_at_ > kAnswerBytesMax)
        throw FirmwareTrouble(true,
                              fmt::format("the firmware lets no time pass: it sent more than {} MiB in {}",
                                          kAnswerBytesMax >> 20, what_));
      if (++receives_count_ > kReceivesAtOnce) {
        DrainOutput();
        LookAtTime();
      }
      if (Receive(0)) continue;
      DrainOutput();
      LookAtTime();
    }
  } catch (const BrokenProtocol& broken) {
    throw FirmwareTrouble(false, fmt::format("the firmware broke the protocol of docs/program.md in {}: {}",
                                             what_, broken.what()));
  }
}

void ProgramProcess::EndAnswer() const {
  if (!reader_.empty())
    throw FirmwareTrouble(
        false,
        fmt::format("the firmware broke the protocol of docs/program.md in {}: it sent more behind `waiting`",
                    what_));
}

// False when nothing came.
bool ProgramProcess::Receive(int flags) {
  std::array<std::uint8_t, 65536> buffer;
  const ssize_t count = recv(socket_.get(), buffer.data(), buffer.size(), flags);
  if (count < 0 && (errno == EAGAIN || errno == EINTR)) return false;
  if (count <= 0) ThrowEnded();
  if (!std::exchange(turn_ended_, true)) together_->EndTurn();
  reader_.Add(std::span(buffer).first(static_cast<std::size_t>(count)));
  return true;
}

void ProgramProcess::LookAtTime() {
  if (!own_) own_.emplace(child_->pid());
  if (own_->Look(Clock::now()) < kHungAfterNs) return;
  // Once more before giving up.
  pollfd polled{socket_.get(), POLLIN, 0};
  if (poll(&polled, 1, 0) > 0 && receives_count_ <= kReceivesAtOnce) return;
  if (own_->stopped_itself())
    throw FirmwareTrouble(true, fmt::format("the firmware stopped itself in {}", what_));
  throw FirmwareTrouble(true, fmt::format("the firmware did not return from {} within {} s of its own time",
                                          what_, ToSeconds(kHungAfterNs)));
}

// Printing may be what it waits for. Lines are passed on when they are asked for: when depends on no clock of the machine.
void ProgramProcess::DrainOutput() {
  std::array<char, 4096> buffer;
  ssize_t count = 0;
  const auto keep = [this](std::string line) {
    lines_bytes_ += line.size() + 1;
    lines_.push_back(std::move(line));
    // The last lines count: they hold the reason of a crash.
    for (; lines_bytes_ > kKeptBytes; ++dropped_count_) {
      lines_bytes_ -= lines_.front().size() + 1;
      lines_.pop_front();
    }
  };
  // At a time: one that prints without end must not keep this process from its limits.
  for (int reads = 0;
       reads < kOutputBytes / 4096 && (count = read(output_.get(), buffer.data(), buffer.size())) > 0;
       ++reads)
    splitter_.Add({buffer.data(), static_cast<std::size_t>(count)}, keep);
}

void ProgramProcess::TakeOutput(bool all) {
  DrainOutput();
  if (const std::size_t count = std::exchange(dropped_count_, 0); count > 0)
    on_line_(fmt::format("tiltproof: {} lines before this one are not kept: they came at once", count));
  for (std::string& line : lines_) on_line_(std::move(line));
  lines_.clear();
  lines_bytes_ = 0;
  if (all) splitter_.End(on_line_);
}

bool ProgramProcess::EndsWithin(TimeNs own_ns) {
  OwnTime own(child_->pid());
  // Printing must not hold it up.
  while (child_->Alive()) {
    const bool over = own.Look(Clock::now()) >= own_ns || own.excuse() == OwnTime::Excuse::kStopped;
    pollfd polled{child_->pidfd(), POLLIN, 0};
    if (poll(&polled, 1, over ? 0 : kLook_ms) == 0 && over) return false;
    DrainOutput();
  }
  return true;
}

// Nullopt: it lives, and has closed its socket.
std::optional<std::string> ProgramProcess::HowEnded(bool& crashed) const {
  siginfo_t info{};
  if (waitid(P_PID, static_cast<id_t>(child_->pid()), &info, WEXITED | WNOHANG | WNOWAIT) != 0 ||
      info.si_pid == 0)
    return std::nullopt;
  const bool exited = info.si_code == CLD_EXITED;
  const int number = !exited                         ? info.si_status
                     : info.si_status > kShellSignal ? info.si_status - kShellSignal
                                                     : 0;
  const char* const name = number == 0 ? nullptr : sigdescr_np(number);
  crashed = name != nullptr;
  return crashed ? std::string(name) : fmt::format("exited with code {}", info.si_status);
}

void ProgramProcess::ThrowEnded() {
  // Its last words are there once it is gone.
  EndsWithin(kNsPerS);
  bool crashed = false;
  const auto how = HowEnded(crashed);
  throw FirmwareTrouble(false, crashed ? fmt::format("the firmware crashed in {}: {}", what_, *how)
                               : how   ? fmt::format("the firmware {} in {}", *how, what_)
                                       : fmt::format("the firmware closed its socket in {}", what_));
}

std::optional<ProgramMessage> ProgramProcess::FindRefusal() {
  std::array<std::uint8_t, 4096> buffer;
  for (int reads = 0; reads < kReceivesAtOnce; ++reads) {
    const ssize_t count = recv(socket_.get(), buffer.data(), buffer.size(), MSG_DONTWAIT);
    if (count <= 0) break;
    reader_.Add(std::span(buffer).first(static_cast<std::size_t>(count)));
  }
  try {
    while (const auto message = reader_.Next())
      if (message->kind == ProgramMessage::Kind::kRefused) return message;
  } catch (const BrokenProtocol&) {
    // The broken message is reported instead.
  }
  return std::nullopt;
}

std::optional<FirmwareTrouble> ProgramProcess::AwaitEnd() {
  if (!EndsWithin(kEndsWithinNs))
    return FirmwareTrouble(
        true, fmt::format("the firmware did not end within {} s of its own time", ToSeconds(kEndsWithinNs)));
  bool crashed = false;
  const auto how = HowEnded(crashed);
  TakeOutput(true);
  if (!crashed && (!how || how == "exited with code 0")) return std::nullopt;
  return FirmwareTrouble(false, crashed ? fmt::format("the firmware crashed in end: {}", how.value_or(""))
                                        : fmt::format("the firmware {}", *how));
}

}  // namespace tiltproof::harness
