#include "harness/node/emulated_board.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <boost/asio/post.hpp>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <string_view>
#include <utility>

#include "harness/emulator/diagnosis/gdb_board.h"
#include "harness/emulator/diagnosis/post_mortem.h"
#include "harness/emulator/diagnosis/source_lines.h"
#include "harness/emulator/elf_symbols.h"
#include "harness/emulator/usart_rate.h"
#include "link/unix_socket.h"

namespace tiltproof::harness {
namespace {

using link::OwnedDescriptor;
using std::chrono::steady_clock;

// QEMU answers within a millisecond; on a machine that is much too busy, within a second.
constexpr std::chrono::seconds kAnswerLimit{5};
constexpr std::string_view kFatal = "qemu: fatal: ";

std::int64_t Nanoseconds(steady_clock::time_point time) {
  return std::chrono::nanoseconds(time.time_since_epoch()).count();
}

// Ours, and the one that QEMU inherits.
std::pair<OwnedDescriptor, OwnedDescriptor> SocketPair() {
  std::array<int, 2> ends{-1, -1};
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
    throw std::runtime_error(fmt::format("no socket for the emulator: {}", std::strerror(errno)));
  return {OwnedDescriptor(ends[0]), OwnedDescriptor(ends[1])};
}

// QEMU's options separate by commas; one in a value is doubled.
std::string Escaped(std::string_view value) {
  std::string text;
  for (const char c : value) text += c == ',' ? ",," : std::string(1, c);
  return text;
}

std::string Connected(const std::string& port) {
  constexpr std::string_view kAbstract = "unix:@", kPath = "unix:";
  if (port.starts_with(kAbstract))
    return fmt::format("socket,path={},abstract=on", Escaped(port.substr(kAbstract.size())));
  if (port.starts_with(kPath)) return fmt::format("socket,path={}", Escaped(port.substr(kPath.size())));
  throw std::runtime_error(fmt::format("the emulator is offered no socket but '{}'", port));
}

// Memory that is shared with the plug-in, and its place here.
std::pair<OwnedDescriptor, lockstep::RealtimeBoard*> SharedBoard() {
  OwnedDescriptor file(memfd_create("tiltproof-board", MFD_CLOEXEC));
  if (file.get() < 0 || ftruncate(file.get(), sizeof(lockstep::RealtimeBoard)) != 0)
    throw std::runtime_error(fmt::format("no memory for the emulator: {}", std::strerror(errno)));
  void* memory =
      mmap(nullptr, sizeof(lockstep::RealtimeBoard), PROT_READ | PROT_WRITE, MAP_SHARED, file.get(), 0);
  if (memory == MAP_FAILED)
    throw std::runtime_error(fmt::format("no memory for the emulator: {}", std::strerror(errno)));
  return {std::move(file), static_cast<lockstep::RealtimeBoard*>(memory)};
}

// An image that asks which board it is on gets the answer as a user programs the chip: before its first instruction.
std::string PlaceArgument(const EmulatorSpec& spec) {
  const auto place = ElfSymbols(spec.image).FindConstant(kPlaceSymbol);
  return place ? fmt::format(",word_at={},word={}", place->address, spec.place) : "";
}

// Control sockets are descriptors 3 and 4, the memory is 5.
std::vector<std::string> CommandLine(const EmulatorSpec& spec, const BoardWiring& wiring) {
  std::vector<std::string> command = {"qemu-system-arm", "-M",   "netduinoplus2", "-display",        "none",
                                      "-monitor",        "none", "-nodefaults",   "-no-user-config", "-S"};
  const auto add = [&](std::initializer_list<std::string> words) { command.insert(command.end(), words); };
  for (int usart = 1; usart <= kChipUsartCount; ++usart) {
    std::string what = "null";
    if (usart == spec.console_usart) what = "stdio,signal=off";
    if (usart == spec.main_usart) what = Connected(wiring.main_port);
    if (usart == spec.reference_usart && !wiring.reference_port.empty())
      what = Connected(wiring.reference_port);
    const auto line = std::ranges::find(spec.line_usarts, usart);
    if (line != spec.line_usarts.end())
      what = Connected(wiring.line_ports.at(static_cast<std::size_t>(line - spec.line_usarts.begin())));
    add({"-chardev", fmt::format("{},id=usart{}", what, usart), "-serial",
         fmt::format("chardev:usart{}", usart)});
  }
  add({"-chardev", "socket,id=control,fd=3", "-mon", "chardev=control,mode=control"});
  add({"-chardev", "socket,id=debugger,fd=4", "-gdb", "chardev:debugger"});
  const auto plugin = PluginArguments(spec, "realtime=on,memory=5" + PlaceArgument(spec));
  command.insert(command.end(), plugin.begin(), plugin.end());
  add({"-kernel", spec.image});
  return command;
}

}  // namespace

EmulatedBoard::EmulatedBoard(NodeServices& services, const Scenario& scenario, const EmulatorSpec& spec,
                             const BoardWiring& wiring, Callbacks callbacks)
    : services_(services), scenario_(scenario), callbacks_(std::move(callbacks)), spec_(spec) {
  auto [control, control_far] = SocketPair();
  auto [debugger, debugger_far] = SocketPair();
  ChildSpec child;
  child.command = CommandLine(spec, wiring);
  auto [memory_file, memory] = SharedBoard();
  memory_.reset(memory);
  lost_ticks_.emplace(*memory_);
  child.descriptors = {control_far.get(), debugger_far.get(), memory_file.get()};
  process_.emplace(services, child, [this](const std::string& how) { OnEnded(how); });
  const auto lost = [this](const std::string& why) {
    socket_trouble_ = why;
    socket_trouble_since_ = steady_clock::now();
  };
  qmp_.emplace(services.loop(), control.Release(),
               QmpClient::Callbacks{.event =
                                        [this](const std::string& name, const std::string& data) {
                                          if (name == "RESET" && callbacks_.reset)
                                            callbacks_.reset(data.find("\"guest\":true") != data.npos);
                                        },
                                    .lost = lost});
  debugger_port_ = std::move(debugger);
  if (wiring.debugger)
    debugger_.emplace(services.loop(), fcntl(debugger_port_.get(), F_DUPFD_CLOEXEC, 0), lost);
}

EmulatedBoard::~EmulatedBoard() {
  // The thread that reads there has to end.
  shutdown(debugger_port_.get(), SHUT_RDWR);
  if (examiner_.joinable()) examiner_.join();
}

void EmulatedBoard::Unmap::operator()(lockstep::RealtimeBoard* board) const { munmap(board, sizeof *board); }

void EmulatedBoard::PowerOn() {
  // By its answer, all of its threads are there.
  qmp_->Execute("cont", "{}", [this](const std::string&, const std::string&) {
    power_on_ = steady_clock::now();
    processor_.emplace(process_->child().pid());
    hang_watch_.emplace(process_->child().pid());
    wait_watch_.emplace(services_, scenario_, process_->child().pid(), CpuWait::Of::kProcess,
                        [this] { return paused_; });
  });
}

// The whole of QEMU is stopped by a signal, not the processor by a command: that would stop the board's clock, too,
// and its timers would not know that time has passed.
void EmulatedBoard::BeginStall() {
  if (++stalls_count_ > 1 || halted_) return;
  paused_ = true;
  paused_since_ = steady_clock::now();
  process_->child().Signal(SIGSTOP);
}

void EmulatedBoard::EndStall() {
  --stalls_count_;
  Resume();
}

// In reset no clock counts: the processor may be stopped by a command. QEMU itself goes on, and its USARTs, off after
// the reset, lose what arrives.
void EmulatedBoard::BeginReset() {
  ++resets_count_;
  Continue();
  if (!std::exchange(halted_, true)) qmp_->Execute("stop");
  qmp_->Execute("system_reset");
}

void EmulatedBoard::EndReset() {
  --resets_count_;
  Resume();
}

// Once nothing holds it any more: what was reset in a stall stays halted to the stall's end.
void EmulatedBoard::Resume() {
  if (stalls_count_ > 0 || resets_count_ > 0) return;
  Continue();
  if (std::exchange(halted_, false)) qmp_->Execute("cont");
  silent_for_good_reason_ = steady_clock::now();
}

void EmulatedBoard::Continue() {
  if (!std::exchange(paused_, false)) return;
  lost_ticks_->Held(Nanoseconds(paused_since_), Nanoseconds(steady_clock::now()));
  process_->child().Signal(SIGCONT);
}

void EmulatedBoard::Flip(std::vector<MemoryBit> bits, BitFlipper::Done done) {
  if (debugger_) debugger_->Flip(std::move(bits), std::move(done));
}

void EmulatedBoard::ReadWords(std::uint32_t address, int count,
                              std::function<void(const std::vector<std::uint32_t>&)> done) {
  if (paused_ || lost_ || qmp_->Waiting().count() > 0) return;
  const std::string arguments = fmt::format(R"({{"command-line": "xp /{}xw 0x{:x}"}})", count, address);
  // "0000000020000100: 0x00000001 0x00000002\r\n", as a JSON string.
  qmp_->Execute(
      "human-monitor-command", arguments,
      [count, done = std::move(done)](const std::string& error, const std::string& value) {
        std::vector<std::uint32_t> words;
        for (std::size_t at = 0; error.empty() && (at = value.find("0x", at)) != value.npos; at += 2)
          words.push_back(static_cast<std::uint32_t>(std::strtoul(value.c_str() + at, nullptr, 16)));
        if (words.size() == static_cast<std::size_t>(count)) done(words);
      });
}

void EmulatedBoard::Watch(bool started) {
  if (lost_) return;
  NoteLostTicks();
  if (processor_) processor_->Watch();
  if (paused_) silent_for_good_reason_ = steady_clock::now();
  // QEMU that ends closes its sockets some time before. Its end tells the reason.
  if (!socket_trouble_.empty() && steady_clock::now() - socket_trouble_since_ > kAnswerLimit)
    return Lose(EndReason::kNodeLost,
                fmt::format("the emulator accepts no command any more: {}", socket_trouble_));
  const auto waiting =
      std::max(qmp_->Waiting(), debugger_ ? debugger_->Waiting() : std::chrono::nanoseconds(0));
  if (waiting > kAnswerLimit && steady_clock::now() - silent_for_good_reason_ > kAnswerLimit)
    Lose(EndReason::kNodeLost, fmt::format("the emulator has not answered for {} s: it hangs or was stopped",
                                           kAnswerLimit.count()));
  if (!lost_ && hang_watch_ && !examined_) WatchFirmware(started);
}

void EmulatedBoard::NoteLostTicks() {
  const auto boot = [this](std::int64_t ns) {
    return When(steady_clock::time_point(std::chrono::nanoseconds(ns)));
  };
  for (const LostTickLog::Span& span : lost_ticks_->Take()) {
    services_.lateness().NoteDisturbed(boot(span.begin_ns), boot(span.end_ns));
    // Many in a row are a standstill of the board.
    services_.lateness().Note(boot(span.begin_ns), boot(span.end_ns));
  }
}

void EmulatedBoard::WatchFirmware(bool started) {
  if (memory_->broken_limit)
    return Lose(EndReason::kFirmwareCrashed,
                fmt::format("the firmware sets what no chip does: {}", memory_->limit_text));
  HangWatch::Sent sent;
  for (int usart = 1; usart <= kChipUsartCount; ++usart) {
    const steady_clock::time_point at{std::chrono::nanoseconds(memory_->sent_at_ns[usart - 1].load())};
    sent.any = std::max(sent.any, at);
    if (usart == spec_.main_usart) sent.main_line = at;
  }
  const auto now = steady_clock::now();
  hang_watch_->Look(now, sent, paused_ || halted_);
  const bool judged = started || now - power_on_ > std::chrono::nanoseconds(scenario_.start_within_ns);
  const auto is_suspect = [this] {
    return !paused_ && !halted_ && !examined_ && hang_watch_->silent_ns() >= HangWatch::kLimit;
  };
  if (!judged || !is_suspect()) return;
  if (qmp_->Waiting().count() > 0 || (debugger_ && debugger_->Waiting().count() > 0)) return;
  qmp_->Execute("human-monitor-command", R"({"command-line": "info registers"})",
                [this, started, is_suspect](const std::string& error, const std::string& value) {
                  const auto state = ParseCpuState(value);
                  // By now it may have sent something.
                  if (error.empty() && state && is_suspect()) Suspect(*state, started);
                });
}

// A firmware that sleeps waits for something, and is no hang, unless it sleeps in the handler of a fault.
void EmulatedBoard::Suspect(const CpuState& state, bool started) {
  constexpr int kSeenInHandler = 3;
  constexpr TimeNs kAwake = 500 * kNsPerMs;
  in_handler_count_ = state.InFaultHandler() ? in_handler_count_ + 1 : 0;
  if (hang_watch_->busy_ns() > HangWatch::kLimit) return Examine(Condition::kBusy, started);
  if (in_handler_count_ >= kSeenInHandler)
    Examine(hang_watch_->busy_ns() > kAwake ? Condition::kBusy : Condition::kSleeps, started);
}

void EmulatedBoard::Examine(Condition condition, bool started) {
  examined_ = true;
  debugger_.reset();
  // Signals are for the node's thread.
  sigset_t all, old;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &old);
  examiner_ = std::jthread([this, condition, started, usarts = UsartStates(), alive = std::weak_ptr(alive_)] {
    auto examined = std::make_shared<Examined>();
    examined->found.in_fault_handler = in_handler_count_ > 0;
    try {
      GdbBoard stopped(debugger_port_.get(), usarts, GdbBoard::kLimit);
      const UsartRoles roles{spec_.main_usart, spec_.reference_usart, spec_.console_usart};
      examined->usarts = UsartSummary(stopped, roles);
      examined->found =
          harness::Examine(stopped, ElfSymbols(spec_.image), SourceLines(spec_.image), roles, condition);
    } catch (const std::exception& error) {
      // The hang is known; only its place is missing.
      examined->found.lines.push_back(error.what());
    }
    boost::asio::post(services_.loop(), [this, examined, started, alive] {
      if (!alive.expired()) Tell(*examined, started);
    });
  });
  pthread_sigmask(SIG_SETMASK, &old, nullptr);
}

void EmulatedBoard::Tell(const Examined& examined, bool started) {
  Keep(examined.found);
  const bool in_handler = examined.found.in_fault_handler;
  const auto since = in_handler ? hang_watch_->spoke() : hang_watch_->active();
  const TimeNs for_ns = in_handler ? hang_watch_->silent_ns() : hang_watch_->busy_ns();
  std::string text = HangText(examined.found, for_ns, callbacks_.time_text(When(since)));
  if (!started && !examined.usarts.empty()) text += "; " + examined.usarts;
  Lose(EndReason::kFirmwareHung, text + " (more in firmware.log)");
}

std::string EmulatedBoard::State(bool started) {
  if (lost_ || paused_ || !hang_watch_ || std::exchange(examined_, true)) return "";
  debugger_.reset();
  try {
    GdbBoard stopped(debugger_port_.get(), UsartStates(), GdbBoard::kLimit);
    const auto state = ParseCpuState(stopped.Registers());
    if (!state || (started && !state->InFaultHandler())) return "";
    const UsartRoles roles{spec_.main_usart, spec_.reference_usart, spec_.console_usart};
    const Findings found = harness::Examine(stopped, ElfSymbols(spec_.image), SourceLines(spec_.image), roles,
                                            Condition::kSleeps);
    Keep(found);
    return found.reason + (started ? "" : "; " + UsartSummary(stopped, roles));
  } catch (const EmulatorTrouble&) {
    // The flight has been flown; only these words are missing.
    return "";
  }
}

std::vector<std::pair<BootTime, UnmodelledBlocks::Block>> EmulatedBoard::Unmodelled() const {
  std::vector<std::pair<BootTime, UnmodelledBlocks::Block>> used;
  const std::uint32_t count = memory_->unmodelled_count;
  if (count == 0) return used;
  const SourceLines source(spec_.image);
  UnmodelledBlocks blocks;
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto& [at_ns, address, pc, is_write] = memory_->unmodelled[i];
    if (auto block = blocks.Take({address, is_write, pc}, source))
      used.emplace_back(When(steady_clock::time_point(std::chrono::nanoseconds(at_ns))), std::move(*block));
  }
  return used;
}

void EmulatedBoard::Keep(const Findings& found) {
  for (const std::string& line : found.lines) lines_.push_back({services_.clock().Now(), line, false});
}

lockstep::UsartStates EmulatedBoard::UsartStates() const {
  lockstep::UsartStates states{};
  for (int i = 0; i < kChipUsartCount; ++i) {
    states.sent_count[i] = memory_->sent_count[i];
    states.clock_hz[i] = memory_->clock_hz[i];
  }
  return states;
}

BootTime EmulatedBoard::When(steady_clock::time_point time) const {
  return services_.clock().Now() - std::chrono::nanoseconds(steady_clock::now() - time).count();
}

std::vector<FirmwareProcess::OutputLine> EmulatedBoard::TakeLines(bool last) {
  if (last) process_->ReadAll();
  for (auto& line : process_->TakeLines()) {
    if (line.error && !line.text.empty()) {
      if (fatal_.empty() && line.text.starts_with(kFatal)) fatal_ = line.text.substr(kFatal.size());
      if (!fatal_.empty()) last_words_ += line.text + "\n";
      last_error_ = line.text;
    }
    lines_.push_back(std::move(line));
  }
  return std::exchange(lines_, {});
}

void EmulatedBoard::OnEnded(const std::string& how) {
  lines_ = TakeLines(true);
  if (!fatal_.empty()) {
    if (!memory_->locked_up)
      return Lose(EndReason::kFirmwareCrashed,
                  fmt::format("the firmware crashed: {} (registers in firmware.log)", fatal_));
    LockedUpBoard board(last_words_, memory_->last_words);
    const Findings found =
        harness::Examine(board, ElfSymbols(spec_.image), SourceLines(spec_.image), {}, Condition::kLockedUp);
    Keep(found);
    return Lose(EndReason::kFirmwareCrashed, CrashText(found, callbacks_.time_text(services_.clock().Now())));
  }
  Lose(EndReason::kNodeLost,
       fmt::format("the emulator {}{}{}", how, last_error_.empty() ? "" : ": ", last_error_));
}

void EmulatedBoard::Lose(EndReason reason, const std::string& text) {
  if (std::exchange(lost_, true)) return;
  callbacks_.lost(reason, text);
}

}  // namespace tiltproof::harness
