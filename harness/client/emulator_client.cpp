#include "harness/client/emulator_client.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <deque>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include "firmware/tiltproof_client.h"
#include "harness/client/board_stacks.h"
#include "harness/client/device_clock.h"
#include "harness/client/emulator_limits.h"
#include "harness/client/firmware_guard.h"
#include "harness/client/rated_line.h"
#include "harness/emulator/diagnosis/cpu_state.h"
#include "harness/emulator/diagnosis/post_mortem.h"
#include "harness/emulator/diagnosis/source_lines.h"
#include "harness/emulator/diagnosis/unmodelled_blocks.h"
#include "harness/emulator/diagnosis/watched_variable.h"
#include "harness/emulator/elf_symbols.h"
#include "harness/emulator/image_check.h"
#include "link/overloaded.h"

namespace tiltproof::harness {
namespace {

// A processor that has neither slept nor sent anything for this long (virtual time) is caught in a loop.
constexpr TimeNs kBusyMax = 2 * kNsPerS;
// Nor may it fill the log with one line.
constexpr std::size_t kLineBytesMax = 1000;
// The last exception that is a fault (ARMv7-M ARM, table B1-4).
constexpr int kUsageFault = 6;

lockstep::Mark ToMark(faults::ReceiveMark mark) {
  switch (mark) {
    case faults::ReceiveMark::kOverrun:
      return lockstep::Mark::kOverrun;
    case faults::ReceiveMark::kFraming:
      return lockstep::Mark::kFraming;
    case faults::ReceiveMark::kNoise:
      return lockstep::Mark::kNoise;
    case faults::ReceiveMark::kParity:
      return lockstep::Mark::kParity;
    case faults::ReceiveMark::kNone:
      break;
  }
  return lockstep::Mark::kNone;
}

// Bytes that a receiver lost since the one before had not been read. A row of lost bytes is one event, which is known
// when the row is over.
class OverrunRows {
 public:
  explicit OverrunRows(std::string line) : line_(std::move(line)) {}

  // Takes a lost byte; gives the row before, if this byte is not of it.
  std::optional<DeviceEvent> Take(BootTime at) {
    std::optional<DeviceEvent> before;
    if (count_ > 0 && at - last_ > kGap) before = End();
    if (count_++ == 0) first_ = at;
    last_ = at;
    return before;
  }

  std::optional<DeviceEvent> End() {
    const std::int64_t count = std::exchange(count_, 0);
    if (count == 0) return std::nullopt;
    return DeviceEvent{.time_ns = first_,
                       .fault = std::nullopt,
                       .kind = kOverrunEvent,
                       .text = fmt::format("{} line: {} byte{} lost within {:.3f} ms", line_, count,
                                           count == 1 ? "" : "s", ToSeconds(last_ - first_) * 1e3),
                       .overruns_count = count};
  }

 private:
  // Bytes lost further apart than this are different stories.
  static constexpr TimeNs kGap = 24 * kNsPerMs;

  std::string line_;
  std::int64_t count_ = 0;  // of the present row
  BootTime first_, last_;
};

// The plug-in receives and sends times of the board's clock: plain numbers, which clock_ makes boot time.
class EmulatorClient final : public Client {
 public:
  EmulatorClient(const EmulatorSpec& spec, const EmulatorLines& lines, TimeNs start_within_ns,
                 const std::vector<std::string>& watch, std::optional<TimeNs> break_at_ns, ClientHost host)
      : spec_(spec),
        lines_(lines),
        start_within_ns_(start_within_ns),
        break_at_ns_(break_at_ns),
        host_(std::move(host)),
        rated_{RatedLine(lines.main), RatedLine(lines.reference)},
        overruns_{OverrunRows("main"), OverrunRows("reference")} {
    for (const auto& [id, rate] : lines.between) {
      rated_.emplace_back(rate);
      overruns_.emplace_back(id);
    }
    troubles_.resize(rated_.size());
    for (const auto& file : {spec.image, spec.plugin})
      if (!std::filesystem::is_regular_file(file))
        throw std::runtime_error(fmt::format("no such file: {}", file));
    CheckImage(spec.image);
    symbols_.emplace(spec.image);
    source_.emplace(spec.image);
    status_ = symbols_->FindRegion(kStatusSymbol);
    role_ = symbols_->FindRegion(kRoleSymbol);
    for (const std::string& name : watch) watched_.push_back(FindVariable(spec.image, name));
    spec_.ideal_lines = lines.main.baud == 0;
    board_.emplace(spec_);
    // As a user programs the chip, before its first instruction.
    if (const auto place = symbols_->FindConstant(kPlaceSymbol))
      board_->Send(lockstep::Kind::kWriteCode, lockstep::WriteCode{place->address, spec_.place});
    stacks_.emplace(*symbols_);
    stacks_->Watch(*board_);
  }

  bool RunsOn() const override { return true; }

  // Nothing has been executed yet: the first Grant() begins.
  BootTime Start(BootTime now) override { return now; }

  void Receive(Uart uart, BootTime arrival, std::span<const std::uint8_t> bytes,
               std::span<const faults::ReceiveMark> marks) override {
    RatedLine& rated = rated_[static_cast<std::size_t>(uart)];
    const link::LineRate& line = rated.line();
    const lockstep::Usart usart = UsartOf(uart);
    if (rated.DamagesReceived()) {
      for (std::size_t i = 0; i < bytes.size(); ++i) {
        const auto left = static_cast<std::int64_t>(bytes.size() - i);
        rated.Receive(clock_.At(arrival - line.BytesTime(left)), bytes[i],
                      !marks.empty() && marks[i] == faults::ReceiveMark::kParity);
      }
      return;
    }
    received_.clear();
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      const TimeNs before_last = line.BytesTime(static_cast<std::int64_t>(bytes.size() - 1 - i));
      lockstep::Mark mark = marks.empty() ? lockstep::Mark::kNone : ToMark(marks[i]);
      const bool parity_error = mark == lockstep::Mark::kParity;
      if (parity_error && !rated.format().has_parity()) mark = lockstep::Mark::kNone;  // on an ideal line
      received_.push_back({.arrival_ns = clock_.At(arrival - before_last),
                           .word = rated.format().WordOf(bytes[i], parity_error),
                           .usart = usart,
                           .mark = mark,
                           .waits = line.baud == 0});
    }
    board_->Send(lockstep::Kind::kReceive, std::span<const lockstep::ReceivedByte>(received_));
  }

  BootTime Grant(BootTime now, BootTime horizon) override {
    for (; !drifts_.empty() && now >= drifts_.front().time_ns; drifts_.pop_front())
      host_.event(drifts_.front());
    try {
      const TimeNs until = clock_.At(horizon);
      DeliverDamaged(until);
      if (until < now_) return clock_.When(now_);  // it ran on while there was no answer yet
      if (MayLeaveOut(until)) {
        LeaveOut(until);
        return horizon;
      }
      const lockstep::Stopped stopped = board_->Run(
          {until, AnswerAfter(), LineAnswerAfter(), spec_.gdb_port == 0 ? limits_.LeftForTurn() : 0},
          [this](const EmulatorMessage& message) { OnMessage(message); });
      now_ = stopped.at_ns;
      last_active_ = std::max(last_active_, stopped.last_slept_ns);
      if (stopped.locked_up) ThrowLockedUp(stopped.at_ns);
      if (const auto broken = limits_.Broken([this](TimeNs at) { return TimeText(at); }); !broken.empty()) {
        TellStacks();
        throw FirmwareTrouble(false, broken);
      }
      TransmitDamaged(stopped.at_ns);
      if (stopped.at_ns - last_active_ > kBusyMax && (started() || stopped.at_ns > start_within_ns_))
        ThrowHangs(stopped.at_ns);
      if (spec_.gdb_port == 0 && limits_.CostsTooMuch(now_, board_->ProcessorTime())) ThrowCostsTooMuch();
      return stopped.at_ns >= until ? horizon : std::clamp(clock_.When(stopped.at_ns), now, horizon);
    } catch (const EmulatorTrouble& trouble) {
      lost_ = true;
      Log(last_active_, trouble.what());
      // QEMU gives up when the processor is past all help: that is the firmware's doing. Its own end is not.
      const std::string fatal = FatalLine(board_->Errors());
      if (!fatal.empty())
        throw FirmwareTrouble(false, "the firmware crashed: " + fatal + " (registers in firmware.log)");
      throw std::runtime_error(trouble.what());
    }
  }

  void Command(const std::vector<faults::DeviceCommand>& commands, Origin origin) override {
    origin_ = origin;
    // First of all the clock, by which all other times are told.
    drifts_ = clock_.Follow(commands, origin);
    for (const faults::DeviceCommand& command : commands) Send(command, origin);
    if (break_at_ns_)
      board_->Send(lockstep::Kind::kBreak, lockstep::Break{clock_.At(origin.ToBootTime(*break_at_ns_))});
  }

  BootTime Add(const std::vector<faults::DeviceCommand>& commands) override {
    for (const faults::DeviceCommand& command : commands) Send(command, origin_);
    return clock_.When(now_);
  }

  std::optional<ClientStatus> Status() override {
    for (OverrunRows& rows : overruns_)
      if (const auto row = rows.End()) host_.event(*row);
    if (lost_) return std::nullopt;
    TellStacks();
    TellState();
    try {
      if (const auto status = ReadStatus())
        return ClientStatus{status->supervisor_state, status->failsafe_count};
    } catch (const EmulatorTrouble&) {
      // The flight has been flown; only this word is missing.
    }
    return std::nullopt;
  }

  ClientSample Sample() override {
    ClientSample sample;
    try {
      if (const auto status = ReadStatus()) sample.supervisor_state = status->supervisor_state;
      sample.role = ReadRole();
      for (const WatchedVariable& variable : watched_)
        sample.watched.push_back(variable.Value(board_->ReadMemory(variable.address, variable.size_bytes)));
    } catch (const EmulatorTrouble& trouble) {
      lost_ = true;
      throw std::runtime_error(trouble.what());
    }
    return sample;
  }

  Coverage CodeCoverage() override {
    Coverage coverage;
    const auto counts = board_->BlockCounts();
    if (!counts.empty()) coverage.kind = CoverageKind::kBlocks;
    AddFeatures(counts, 0, coverage.features);
    return coverage;
  }

 private:
  // Throws EmulatorTrouble.
  std::optional<TiltproofClientStatus> ReadStatus() {
    TiltproofClientStatus status{};
    if (!status_ || status_->size_bytes < sizeof(status)) return std::nullopt;
    const std::vector<std::uint8_t> bytes = board_->ReadMemory(status_->address, sizeof(status));
    if (bytes.size() < sizeof(status)) return std::nullopt;
    std::memcpy(&status, bytes.data(), sizeof(status));
    return status;
  }

  // Throws EmulatorTrouble.
  std::optional<std::uint32_t> ReadRole() {
    if (!role_) return std::nullopt;
    std::uint32_t role = 0, shift = 0;
    for (const std::uint8_t byte :
         board_->ReadMemory(role_->address, std::min<std::uint32_t>(role_->size_bytes, sizeof(role)))) {
      role |= static_cast<std::uint32_t>(byte) << shift;
      shift += 8;
    }
    return role;
  }

  void Send(const faults::DeviceCommand& command, Origin origin) {
    const TimeNs begin = clock_.At(origin.ToBootTime(command.at_ns));
    const TimeNs end = clock_.At(origin.ToBootTime(command.until_ns));
    const auto fault = static_cast<std::uint32_t>(command.fault);
    const auto stall = [&](lockstep::ResetCause reset) {
      board_->Send(lockstep::Kind::kStall, lockstep::Stall{begin, end, reset, fault});
    };
    std::visit(Overloaded{[&](const faults::ResetProcessor&) { stall(lockstep::ResetCause::kPin); },
                          [&](const faults::ResetByWatchdog&) { stall(lockstep::ResetCause::kWatchdog); },
                          [&](const faults::HangProcessor&) { stall(lockstep::ResetCause::kNone); },
                          [&](const faults::StallProcessor&) { stall(lockstep::ResetCause::kNone); },
                          [&](const faults::DelayTask& work) {
                            board_->Send(
                                lockstep::Kind::kDelayTask,
                                lockstep::DelayTask{begin, end, work.delay_ns, work.every_ns, fault});
                          },
                          [&](const faults::FlipBits& flips) { Flip(flips, begin, fault); },
                          // Refused before the flight.
                          [](const faults::SlowProcessor&) {},
                          // In force already, in clock_; and refused before the flight.
                          [](const faults::DriftClock&) {}, [](const faults::JumpClock&) {}},
               command.action);
  }

  bool started() const { return origin_.known(); }

  // A line to another board allows turns of a byte's time at most, and in nearly all of them the processor sleeps. A debugger may
  // wake it.
  bool MayLeaveOut(TimeNs until) const {
    return !lines_.between.empty() && spec_.gdb_port == 0 && board_->SleepsBeyond(until);
  }
  // As after such a turn. The board comes as far with the next one that it flies.
  void LeaveOut(TimeNs until) {
    last_active_ = std::max(last_active_, now_);
    now_ = until;
    TransmitDamaged(until);
  }

  // The frame's last byte takes a byte's time to the plant, and so does the answer's first byte on its way back. That
  // does not hold for a board whose clock drifts, nor for lines with faults, which may lose other bytes of the frame.
  // Before t = 0 nothing may run on: the board receives the faults of t = 0 only then.
  TimeNs AnswerAfter() const {
    if (!started() || lines_.main.baud == 0 || lines_.faulty || clock_.drifts()) return 0;
    return lines_.main.BytesTime(2);
  }

  // The same for a byte to another board, and that board's first byte: Wire's least latency holds with faults, too.
  TimeNs LineAnswerAfter() const {
    if (!started() || clock_.drifts()) return 0;
    TimeNs after = kNever;
    for (const auto& [id, rate] : lines_.between) after = std::min(after, rate.BytesTime(2));
    return after;
  }

  // The rates' places are those of the UARTs.
  static lockstep::Usart UsartOf(Uart uart) {
    if (uart < Uart::kFirstLine) return static_cast<lockstep::Usart>(uart);
    const int line = static_cast<int>(uart) - static_cast<int>(Uart::kFirstLine);
    return static_cast<lockstep::Usart>(static_cast<int>(lockstep::Usart::kFirstLine) + line);
  }
  static Uart UartOf(lockstep::Usart usart) {
    if (usart < lockstep::Usart::kFirstLine) return static_cast<Uart>(usart);
    return LineUart(static_cast<std::size_t>(usart) - static_cast<std::size_t>(lockstep::Usart::kFirstLine));
  }

  // As a user reads it: in the flight's time, once there is one.
  std::string TimeText(TimeNs at) {
    const BootTime time = clock_.When(at);
    return started() ? fmt::format("t = {:.3f} s", ToSeconds(origin_.SimulationTime(time)))
                     : fmt::format("{:.3f} s after power-on", ToSeconds(time.ns()));
  }

  Findings Examine(Condition condition, TimeNs now) {
    TellStacks();  // before it is run on
    StoppedInLockstep stopped(*board_, now);
    const Findings found = harness::Examine(stopped, *symbols_, *source_, Roles(), condition);
    for (const std::string& line : found.lines) Log(now, line);
    return found;
  }
  std::string Usarts() {
    StoppedInLockstep stopped(*board_, now_);
    return UsartSummary(stopped, Roles());
  }
  UsartRoles Roles() const { return {spec_.main_usart, spec_.reference_usart, spec_.console_usart}; }

  [[noreturn]] void ThrowHangs(TimeNs now) {
    const Findings found = Examine(Condition::kBusy, now);
    std::string text = HangText(found, now - last_active_, TimeText(last_active_));
    if (!started()) text += "; " + Usarts();
    throw FirmwareTrouble(true, text + " (more in firmware.log)");
  }

  [[noreturn]] void ThrowCostsTooMuch() {
    const TimeNs begin = limits_.second_begin();
    const Findings found = Examine(Condition::kBusy, now_);
    throw FirmwareTrouble(true,
                          CostText(found, limits_.second_cost_ns(), now_ - begin, TimeText(begin),
                                   EmulatorLimits::kProcessorNsPerSecond) +
                              " (more in firmware.log)",
                          {.kind = FirmwareEndKind::kTooCostly});
  }

  [[noreturn]] void ThrowLockedUp(TimeNs now) {
    lost_ = true;
    // QEMU aborts of itself, too. Only when it has given the processor up is that the firmware's doing.
    const std::string fatal = FatalLine(board_->Errors());
    if (fatal.empty()) throw std::runtime_error("the emulator aborts: " + board_->Errors());
    Log(now, fatal);
    const Findings found = Examine(Condition::kLockedUp, now);
    throw FirmwareTrouble(false, CrashText(found, TimeText(now)));
  }

  void TellStacks() {
    DeviceEvent use{.time_ns = clock_.When(now_), .fault = std::nullopt, .kind = kStackUseEvent, .text = {}};
    use.stacks = stacks_->ReadOnce(*board_);
    if (!use.stacks.empty()) host_.event(use);
  }

  // Reports the state of a firmware that never started, or that sleeps in the handler of a fault.
  void TellState() {
    try {
      const auto state = ParseCpuState(board_->Registers());
      const bool in_handler = state && state->exception() > 0 && state->exception() <= kUsageFault;
      if (started() && !in_handler) return;
      const Findings found = Examine(Condition::kSleeps, now_);
      host_.event({.time_ns = clock_.When(now_),
                   .fault = std::nullopt,
                   .kind = kBoardStateEvent,
                   .text = found.reason + (started() ? "" : "; " + Usarts())});
    } catch (const EmulatorTrouble&) {
      // The flight has been flown; only these words are missing.
    }
  }

  void Flip(const faults::FlipBits& action, TimeNs at, std::uint32_t fault) {
    const MemoryRegion region = symbols_->Region(action.region);
    lockstep::FlipBits flips{.at_ns = at, .fault = fault, .count = 0, .bits = {}};
    for (const faults::BitFlip& flip : faults::DrawBitFlips(action, region.size_bytes))
      flips.bits[flips.count++] = {region.address + flip.byte_offset, static_cast<std::uint32_t>(flip.bit)};
    board_->Send(lockstep::Kind::kFlipBits, flips);
  }

  void OnMessage(const EmulatorMessage& message) {
    if (message.kind == lockstep::Kind::kUsart) {
      OnRegisters(message.As<lockstep::UsartRegisters>());
    } else if (message.kind == lockstep::Kind::kTransmit) {
      OnTransmitted(message.All<lockstep::TransmittedByte>());
    } else if (message.kind == lockstep::Kind::kLastWords) {
      const auto words = message.As<lockstep::LastWords>();
      last_words_ =
          ExplainReset(words, std::string(message.body.begin() + sizeof words, message.body.end()), *source_);
    } else if (message.kind == lockstep::Kind::kBrokenLimit) {
      limits_.OnBrokenLimit(now_, {message.body.begin(), message.body.end()});
    } else if (message.kind == lockstep::Kind::kEvent) {
      OnEvent(message.As<lockstep::Event>());
    }
  }

  void OnTransmitted(const std::vector<lockstep::TransmittedByte>& bytes) {
    if (bytes.empty()) return;
    last_active_ = std::max(last_active_, bytes.back().at_ns);
    if (bytes.front().usart == lockstep::Usart::kConsole) return OnConsole(bytes);
    const Uart uart = UartOf(bytes.front().usart);
    RatedLine& rated = rated_.at(static_cast<std::size_t>(uart));
    // A byte that is written while the transmitter is busy with those before it leaves right after them: one call for
    // all of these says the same as one for each.
    for (std::size_t first = 0, end = 0; first < bytes.size(); first = end) {
      transmitted_.clear();
      for (; end < bytes.size(); ++end) {
        if (end > first && bytes[end].at_ns > bytes[first].at_ns + rated.TransmitTime(end - first)) break;
        transmitted_.push_back(bytes[end].byte);
      }
      if (const auto begin = rated.Transmit(bytes[first].at_ns, transmitted_))
        host_.transmit(uart, clock_.When(*begin), transmitted_);
    }
  }

  void OnRegisters(const lockstep::UsartRegisters& registers) {
    if (registers.usart == lockstep::Usart::kConsole) return;
    const auto place = static_cast<std::size_t>(UartOf(registers.usart));
    const bool is_line = registers.usart >= lockstep::Usart::kFirstLine;
    const int number = is_line      ? spec_.line_usarts.at(place - 2)
                       : place == 0 ? spec_.main_usart
                                    : spec_.reference_usart;
    RatedLine& rated = rated_.at(place);
    rated.Program(RateOf(registers.clock_hz, registers.brr, registers.cr1, registers.cr3),
                  FormatOf(registers.cr1, registers.cr2));
    constexpr std::uint32_t kOn = 1U << 13;
    if ((registers.cr1 & kOn) == 0) return;
    const std::string trouble = rated.Trouble(is_line      ? lines_.between[place - 2].id
                                              : place == 0 ? "main"
                                                           : "reference");
    if (!trouble.empty() && std::exchange(troubles_[place], trouble) != trouble)
      host_.event({.time_ns = clock_.When(last_active_),
                   .fault = std::nullopt,
                   .kind = kLineTroubleEvent,
                   .text = fmt::format("USART{} {}", number, trouble)});
  }

  // Transmits the bytes that other rates make of those sent, once this is certain.
  void TransmitDamaged(TimeNs until) {
    for (std::size_t place = 0; place < rated_.size(); ++place)
      for (const LineSampler::Received& received : rated_[place].TakeTransmitted(until)) {
        // As a terminal hands over a byte whose stop bit is missing (termios(3), without IGNPAR and PARMRK).
        const auto seen = static_cast<std::uint8_t>(received.framing_error ? 0 : received.word);
        host_.transmit(static_cast<Uart>(place), clock_.When(received.begin_ns), std::span(&seen, 1));
      }
  }
  void DeliverDamaged(TimeNs until) {
    for (std::size_t place = 0; place < rated_.size(); ++place) {
      const lockstep::Usart usart = UsartOf(static_cast<Uart>(place));
      received_.clear();
      RatedLine& rated = rated_[place];
      const TimeNs byte_ns = rated.line().BytesTime(1);
      // A byte that is still on its way is not known: all is seen one byte time later.
      for (const LineSampler::Received& received : rated.TakeReceived(until - byte_ns))
        received_.push_back({.arrival_ns = received.end_ns + byte_ns,
                             .word = received.word,
                             .usart = usart,
                             .mark = received.framing_error  ? lockstep::Mark::kFraming
                                     : received.parity_error ? lockstep::Mark::kParity
                                                             : lockstep::Mark::kNone,
                             .waits = false});
      if (!received_.empty())
        board_->Send(lockstep::Kind::kReceive, std::span<const lockstep::ReceivedByte>(received_));
    }
  }

  void OnConsole(const std::vector<lockstep::TransmittedByte>& bytes) {
    for (const auto& [at, usart, byte] : bytes) {
      const bool line_end = byte == '\n';
      if (!line_end && byte != '\r')
        console_.push_back(byte >= 0x20 && byte < 0x7F ? static_cast<char>(byte) : '?');
      if (line_end || console_.size() == kLineBytesMax)
        host_.log(clock_.When(at), std::exchange(console_, {}));
    }
  }

  void OnEvent(const lockstep::Event& event) {
    DeviceEvent out{.time_ns = clock_.When(event.at_ns), .fault = std::nullopt, .kind = {}, .text = {}};
    switch (event.kind) {
      case lockstep::EventKind::kReset:
        out.kind = kResetEvent;
        out.text = fmt::format("reset by {}", Name(static_cast<lockstep::ResetCause>(event.value)));
        if (last_words_) {
          if (!last_words_->empty()) out.text += ": " + *last_words_;
          limits_.OnReset(event.at_ns, out.text);
        }
        last_words_.reset();
        break;
      case lockstep::EventKind::kStallBegins:
        out.fault = event.value;
        out.kind = "device_stopped";
        out.text = "the processor executes nothing";
        break;
      case lockstep::EventKind::kStallEnds:
        out.kind = "device_runs";
        out.text = "the processor runs again";
        break;
      case lockstep::EventKind::kTaskDelayed:
        out.fault = event.value;
        out.kind = "task_delayed";
        out.text = "other work has the processor";
        break;
      case lockstep::EventKind::kBitFlipped:
        out.fault = event.value;
        out.kind = "bit_flipped";
        out.text = fmt::format("0x{:08x}: 0x{:02x} -> 0x{:02x}", event.address, event.before, event.after);
        break;
      case lockstep::EventKind::kUnmodelled: {
        const auto block = unmodelled_.Take({event.address, event.before != 0, event.value}, *source_);
        if (!block) return;
        out.kind = kUnmodelledEvent;
        out.text = "the firmware uses " + block->text;
        out.block = block->name;
        break;
      }
      case lockstep::EventKind::kStackOverflow:
        out.kind = kStackOverflowEvent;
        out.text = stacks_->OverflowText(event, *source_);
        break;
      case lockstep::EventKind::kOverrun:
        if (auto row =
                overruns_.at(static_cast<std::size_t>(UartOf(static_cast<lockstep::Usart>(event.value))))
                    .Take(out.time_ns))
          host_.event(*row);
        return;
    }
    if (out.kind == kUnmodelledEvent || out.kind == kStackOverflowEvent) Log(event.at_ns, out.text);
    host_.event(out);
  }

  void Log(TimeNs at, std::string_view text) {
    while (!text.empty()) {
      const std::size_t end = text.find('\n');
      if (end != 0) host_.log(clock_.When(at), text.substr(0, end));
      text.remove_prefix(end == text.npos ? text.size() : end + 1);
    }
  }

  EmulatorSpec spec_;
  EmulatorLines lines_;
  TimeNs start_within_ns_;
  std::optional<TimeNs> break_at_ns_;
  ClientHost host_;
  std::vector<RatedLine> rated_;       // by Uart
  std::vector<std::string> troubles_;  // the last text on each of them
  EmulatorLimits limits_;
  UnmodelledBlocks unmodelled_;
  std::optional<ElfSymbols> symbols_;
  std::optional<SourceLines> source_;
  std::vector<WatchedVariable> watched_;
  std::optional<MemoryRegion> status_, role_;  // of the image; none: it has no such symbol
  std::optional<EmulatorProcess> board_;
  std::optional<BoardStacks> stacks_;
  DeviceClock clock_;
  std::deque<DeviceEvent> drifts_;  // to be told when they begin, in order
  std::vector<lockstep::ReceivedByte> received_;
  std::vector<std::uint8_t> transmitted_;
  std::vector<OverrunRows> overruns_;  // by Uart
  std::string console_;
  std::optional<std::string> last_words_;  // of a firmware that is being reset by itself
  TimeNs now_ = 0;                         // virtual time
  TimeNs last_active_ = 0;                 // when it last slept or sent
  Origin origin_;                          // known once the flight has started
  bool lost_ = false;
};

}  // namespace

std::unique_ptr<Client> StartEmulatorClient(const EmulatorSpec& spec, const EmulatorLines& lines,
                                            TimeNs start_within_ns, const std::vector<std::string>& watch,
                                            std::optional<TimeNs> break_at_ns, ClientHost host) {
  return std::make_unique<EmulatorClient>(spec, lines, start_within_ns, watch, break_at_ns, std::move(host));
}

}  // namespace tiltproof::harness
