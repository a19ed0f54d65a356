#include "harness/emulator/diagnosis/post_mortem.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string_view>

#include "harness/emulator/diagnosis/cpu_state.h"
#include "harness/emulator/diagnosis/fault_registers.h"
#include "harness/emulator/stm32f405.h"
#include "harness/emulator/usart_rate.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

// Enough for some turns of a loop that calls a function or two; it costs some 30 us each.
constexpr int kSteps = 600;
// An address that is read in fewer turns belongs to no loop.
constexpr int kReadsMin = 3;

std::vector<std::uint32_t> ReadWordsOf(StoppedBoard& board, std::uint32_t address, std::uint32_t count) {
  Check(count <= std::numeric_limits<std::uint32_t>::max() / 4,
        "the memory of a board has 32 bits of address");
  const std::vector<std::uint8_t> bytes = board.ReadMemory(address, 4 * count);
  std::vector<std::uint32_t> words(bytes.size() / 4);
  std::memcpy(words.data(), bytes.data(), 4 * words.size());
  return words;
}
std::uint32_t ReadWord(StoppedBoard& board, std::uint32_t address) {
  const auto words = ReadWordsOf(board, address, 1);
  return words.empty() ? 0 : words.front();
}

FaultRegisters ReadFaults(StoppedBoard& board) {
  const auto words = ReadWordsOf(board, kFaultRegisters, 5);
  if (words.size() < 5) return {};
  return {.cfsr = words[0], .hfsr = words[1], .mmfar = words[3], .bfar = words[4]};
}

// --- what it waits for ---

struct Loop {
  std::optional<std::uint32_t> polled;  // the address that it reads again and again
  std::uint32_t first = 0, last = 0;    // its instructions
};

bool IsPeripheral(std::uint32_t address) { return FindPeripheral(address) != nullptr; }
bool IsRam(std::uint32_t address) { return Holds(kRam, address) || Holds(kCoreCoupledRam, address); }

// The address that was read most often; of peripherals rather than of RAM, where a loop also keeps what it counts.
std::optional<std::uint32_t> MostRead(const std::map<std::uint32_t, int>& reads) {
  std::optional<std::uint32_t> most;
  for (bool (*const kind)(std::uint32_t) : {IsPeripheral, IsRam}) {
    int count = kReadsMin - 1;
    for (const auto& [address, times] : reads)
      if (kind(address) && times > count) {
        most = address;
        count = times;
      }
    if (most) return most;
  }
  return most;
}

// Runs on, one instruction at a time.
Loop Watch(StoppedBoard& board) {
  Loop loop{.polled = std::nullopt, .first = ~0U, .last = 0};
  // An interrupt that comes meanwhile reads its registers; the loop is what it comes back to. Unless it is in one itself.
  constexpr int kFirstInterrupt = 15;  // SysTick (ARMv7-M ARM, table B1-4)
  std::map<std::uint32_t, int> reads, of_interrupts;
  std::map<std::uint32_t, std::uint32_t> code;
  for (int step = 0; step < kSteps; ++step) {
    const auto state = ParseCpuState(board.Registers());
    if (!state) break;
    loop.first = std::min(loop.first, state->pc());
    loop.last = std::max(loop.last, state->pc());
    auto known = code.find(state->pc());
    if (known == code.end()) known = code.emplace(state->pc(), ReadWord(board, state->pc())).first;
    if (const auto address = LoadAddress(*state, known->second))
      ++(state->exception() < kFirstInterrupt ? reads : of_interrupts)[*address];
    if (!board.Step()) break;
  }
  loop.polled = MostRead(reads.empty() ? of_interrupts : reads);
  return loop;
}

std::string PolledText(StoppedBoard& board, const ElfSymbols& symbols, std::uint32_t address) {
  const std::uint32_t value = ReadWord(board, address & ~3U);
  if (IsRam(address)) {
    const std::string name = symbols.NameAt(address);
    return fmt::format("reads {} again and again (0x{:08x}, now {})",
                       name.empty() ? "a word in RAM" : "the variable " + name, address, value);
  }
  std::string text =
      fmt::format("reads {} again and again (0x{:08x}, now 0x{:08x})", RegisterName(address), address, value);
  if (EmulationOf(address) != Emulated::kYes) {
    text += ", which the emulated board does not have: it always reads 0";
  } else if (const Peripheral* block = FindPeripheral(address); block != nullptr && !block->on_chip) {
    text += ", which an STM32F405 does not have";
  }
  return text;
}

// --- its USARTs ---

struct UsartState {
  int number = 0;
  std::uint64_t sent_count = 0;
  std::int64_t clock_hz = 0;
  std::uint32_t brr = 0, cr1 = 0, cr3 = 0;

  bool On() const { return (cr1 & 1U << 13) != 0; }
  bool Sends() const { return On() && (cr1 & 1U << 3) != 0; }
  bool Receives() const { return On() && (cr1 & 1U << 2) != 0; }
};

std::vector<UsartState> ReadUsarts(StoppedBoard& board) {
  constexpr std::array<std::uint32_t, kChipUsartCount> kAddresses = {0x4001'1000, 0x4000'4400, 0x4000'4800,
                                                                     0x4000'4C00, 0x4000'5000, 0x4001'1400};
  const auto states = board.UsartStates();
  if (!states) return {};
  std::vector<UsartState> usarts(kChipUsartCount);
  for (std::size_t i = 0; i < usarts.size(); ++i)
    usarts[i] = {.number = static_cast<int>(i) + 1,
                 .sent_count = states->sent_count[i],
                 .clock_hz = states->clock_hz[i],
                 .brr = ReadWord(board, kAddresses[i] + 0x08),
                 .cr1 = ReadWord(board, kAddresses[i] + 0x0C),
                 .cr3 = ReadWord(board, kAddresses[i] + 0x14)};
  return usarts;
}

std::string UsartName(const UsartState& usart, const UsartRoles& roles) {
  std::string name =
      fmt::format("{}{}", usart.number == 4 || usart.number == 5 ? "UART" : "USART", usart.number);
  if (usart.number == roles.main) return name + " (main line)";
  if (usart.number == roles.reference) return name + " (reference line)";
  if (usart.number == roles.console) return name + " (console)";
  return name + " (not connected)";
}

// Where RCC gives it one (RM0090, sections 7.3.13 and 7.3.14).
std::string UsartClockBit(int number) {
  const bool fast = number == 1 || number == 6;
  return fmt::format("RCC_APB{}ENR, bit {}", fast ? 2 : 1, number == 1 ? 4 : number == 6 ? 5 : 15 + number);
}

std::string Describe(const UsartState& usart, const UsartRoles& roles) {
  if (usart.clock_hz == 0)
    return fmt::format("{} has no clock ({})", UsartName(usart, roles), UsartClockBit(usart.number));
  if (!usart.On())
    return fmt::format("{} is off{}", UsartName(usart, roles),
                       usart.sent_count == 0 ? "" : fmt::format(", has sent {} bytes", usart.sent_count));
  const UsartRate rate = RateOf(usart.clock_hz, usart.brr, usart.cr1, usart.cr3);
  return fmt::format("{} has sent {} byte{}, {}, transmitter {}, receiver {}", UsartName(usart, roles),
                     usart.sent_count, usart.sent_count == 1 ? "" : "s",
                     rate.Runs() ? fmt::format("{:.0f} baud", rate.Baud()) : "no baud rate (BRR is 0)",
                     usart.Sends() ? "on" : "off", usart.Receives() ? "on" : "off");
}

bool IsConnected(int usart, const UsartRoles& roles) {
  return usart == roles.main || usart == roles.reference || usart == roles.console;
}

// --- where it is ---

std::string CalledFrom(const SourceLines& source, std::uint32_t link) {
  // The first function has no caller; a handler has EXC_RETURN there (ARMv7-M ARM, section B1.5.8).
  constexpr std::uint32_t kExceptionReturn = 0xFFFF'FFE0, kNoCaller = 1;
  if (link <= kNoCaller || link >= kExceptionReturn) return "";
  return ", LR in " + source.DescribeCall(link);
}

// QEMU's dump does not show it while a handler runs. So the processor is made to: its next instruction becomes
// `mrs r0, psp`. Nothing goes on after that.
std::optional<std::uint32_t> ReadProcessStackPointer(StoppedBoard& board, std::uint32_t pc) {
  constexpr std::uint32_t kMrsR0Psp = 0x8009'F3EF;
  board.WriteCode(pc, kMrsR0Psp);
  board.Step();
  const auto state = ParseCpuState(board.Registers());
  if (!state || state->pc() != pc + sizeof kMrsR0Psp) return std::nullopt;
  return state->r[0];
}

std::vector<ExceptionFrame> FindFrames(StoppedBoard& board, CpuState state, Condition condition) {
  const ReadWords read = [&](std::uint32_t address, std::uint32_t count) {
    return ReadWordsOf(board, address, count);
  };
  std::vector<ExceptionFrame> frames = FindExceptionFrames(state, read);
  if (!frames.empty() || condition != Condition::kBusy || !ReturnsToProcessStack(state.link())) return frames;
  const auto stack_pointer = ReadProcessStackPointer(board, state.pc());
  if (!stack_pointer) return frames;
  state.r[13] = *stack_pointer;
  state.r[14] = 0;
  return FindExceptionFrames(state, read);
}

// The processor sleeps after this instruction (ARMv7-M ARM, section A7.7.262).
bool IsAfterWfi(StoppedBoard& board, std::uint32_t pc) {
  constexpr std::uint32_t kWfi = 0xBF30;
  return (ReadWord(board, pc - 2) & 0xFFFF) == kWfi;
}

// A stack that has grown below RAM: who was called last, by the lowest return address in RAM.
std::string LastCall(StoppedBoard& board, const SourceLines& source) {
  constexpr std::uint32_t kSearchedWords = 256;
  for (const std::uint32_t word : ReadWordsOf(board, kRam.address, kSearchedWords))
    if ((word & 1) != 0 && Holds(kFlash, word) && !source.Find(word - 3).function.empty())
      return fmt::format(" (the last call: {})", source.DescribeCall(word));
  return "";
}

bool IsFault(int exception) {
  constexpr int kNmi = 2, kUsageFault = 6;
  return exception >= kNmi && exception <= kUsageFault;
}

// The instruction that an exception interrupted. After a jump to nowhere the PC says where to, and LR from where.
std::string Interrupted(const ExceptionFrame& frame, const SourceLines& source) {
  constexpr std::uint32_t kThumb = 1U << 24;
  if ((frame.xpsr & kThumb) == 0)
    return fmt::format("a jump to 0x{:08x}, LR in {}", frame.pc, source.DescribeCall(frame.link));
  return source.Describe(frame.pc) + CalledFrom(source, frame.link);
}

std::string FaultSentence(const FaultRegisters& faults, const std::vector<ExceptionFrame>& frames,
                          const SourceLines& source, const CpuState& state) {
  std::string what = FaultText(faults);
  if (what.empty()) what = state.exception() == 2 ? "NMI" : "a fault without a cause in CFSR and HFSR";
  for (const ExceptionFrame& frame : frames) {
    what +=
        (&frame == &frames.front() ? " by " : ", which followed a fault by ") + Interrupted(frame, source);
    if (!IsFault(frame.exception())) break;
    what += ", in " + HandlerName(frame.exception());
  }
  return what;
}

std::string Overflow(StoppedBoard& board, const SourceLines& source, const CpuState& state) {
  if (IsRam(state.stack_pointer() - 4)) return "";
  return fmt::format("; the stack pointer, 0x{:08x}, lies outside RAM: the stack has overflowed{}",
                     state.stack_pointer(), LastCall(board, source));
}

}  // namespace

std::string Position(const SourceLines& source, const CpuState& state) {
  return source.Describe(state.pc()) +
         (state.exception() != 0 ? ", " + HandlerName(state.exception()) : CalledFrom(source, state.link()));
}

Findings Examine(StoppedBoard& board, const ElfSymbols& symbols, const SourceLines& source,
                 const UsartRoles& roles, Condition condition) {
  const std::string registers = board.Registers();
  const auto state = ParseCpuState(registers);
  if (!state) return {.reason = "", .lines = {registers}};

  Findings found;
  const auto add = [&](std::string line) { found.lines.push_back(std::move(line)); };
  const FaultRegisters faults = ReadFaults(board);
  const std::vector<ExceptionFrame> frames = FindFrames(board, *state, condition);
  found.in_fault_handler = IsFault(state->exception());

  const std::string where = source.Describe(state->pc());
  add(fmt::format("PC 0x{:08x}: {}", state->pc(), where));
  add(fmt::format("LR 0x{:08x}{}", state->link(), CalledFrom(source, state->link())));
  if (state->exception() != 0) add("in " + HandlerName(state->exception()));
  add(fmt::format("CFSR 0x{:08x}, HFSR 0x{:08x}, MMFAR 0x{:08x}, BFAR 0x{:08x}{}", faults.cfsr, faults.hfsr,
                  faults.mmfar, faults.bfar, faults.Any() ? ": " + FaultText(faults) : ": no fault"));
  for (const ExceptionFrame& frame : frames)
    add(
        fmt::format("stacked at 0x{:08x} by an exception: PC 0x{:08x}, LR 0x{:08x}, R0 0x{:08x}, R1 "
                    "0x{:08x}, R2 0x{:08x}, "
                    "R3 0x{:08x}, R12 0x{:08x}, xPSR 0x{:08x}: {}",
                    frame.address, frame.pc, frame.link, frame.r0, frame.r1, frame.r2, frame.r3, frame.r12,
                    frame.xpsr, Interrupted(frame, source)));

  const std::string fault = FaultSentence(faults, frames, source, *state) + Overflow(board, source, *state);
  if (condition == Condition::kLockedUp) {
    // The fault that could not be taken; the registers are those of its instruction.
    found.reason =
        fmt::format("the processor locked up at {}{}: {}", where,
                    found.in_fault_handler ? ", in " + HandlerName(state->exception()) : "", fault);
  } else if (found.in_fault_handler) {
    found.reason = fmt::format("{}; {}, {}, does not end", fault, HandlerName(state->exception()), where);
  } else {
    const char* what = condition == Condition::kBusy    ? "it is in"
                       : IsAfterWfi(board, state->pc()) ? "it sleeps (WFI) in"
                                                        : "at the end it is in";
    found.reason = fmt::format(
        "{} {}{}{}", what, where,
        state->exception() != 0 ? ", " + HandlerName(state->exception()) : CalledFrom(source, state->link()),
        !frames.empty() ? ", which interrupted " + Interrupted(frames.front(), source) : "");
  }
  if (condition == Condition::kBusy && !found.in_fault_handler) {
    const Loop loop = Watch(board);
    add(fmt::format("during the next {} instructions its PC is between 0x{:08x} and 0x{:08x}", kSteps,
                    loop.first, loop.last));
    if (loop.polled) {
      const std::string polled = PolledText(board, symbols, *loop.polled);
      add("it " + polled);
      found.reason += " and " + polled;
    }
  }
  for (const UsartState& usart : ReadUsarts(board)) add(Describe(usart, roles));
  for (std::string_view text = registers; !text.empty();) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    if (end > 0) add(std::string(text.substr(0, end)));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return found;
}

std::string HangText(const Findings& found, TimeNs silent_ns, const std::string& since) {
  if (found.in_fault_handler)
    return fmt::format("the firmware hangs in a fault's handler since {}{}{}", since,
                       found.reason.empty() ? "" : ": ", found.reason);
  return fmt::format("the firmware hangs: for {:.0f} s, since {}, it has neither slept nor sent a byte{}{}",
                     ToSeconds(silent_ns), since, found.reason.empty() ? "" : "; ", found.reason);
}

std::string CostText(const Findings& found, TimeNs cost_ns, TimeNs span_ns, const std::string& since,
                     TimeNs limit_ns_per_s) {
  return fmt::format(
      "the firmware lets hardly any time pass: {:.3f} s, since {}, have cost {:.1f} s of processor time "
      "(limit: {} s for each second){}{}",
      ToSeconds(span_ns), since, ToSeconds(cost_ns), limit_ns_per_s / kNsPerS,
      found.reason.empty() ? "" : "; ", found.reason);
}

std::string CrashText(const Findings& found, const std::string& at) {
  return fmt::format("the firmware crashed at {}: {} (more in firmware.log)", at, found.reason);
}

std::string ExplainReset(const lockstep::LastWords& words, std::string_view registers,
                         const SourceLines& source) {
  const auto state = ParseCpuState(registers);
  if (!state) return "";
  const std::string where = "in " + Position(source, *state);
  if (!IsFault(state->exception())) return where;
  const FaultRegisters faults{
      .cfsr = words.faults[0], .hfsr = words.faults[1], .mmfar = words.faults[3], .bfar = words.faults[4]};
  const std::vector<std::uint32_t> stack(std::begin(words.stack), std::end(words.stack));
  const auto frames = FindExceptionFrames(*state, [&](std::uint32_t, std::uint32_t) { return stack; });
  return FaultSentence(faults, frames, source, *state) + "; " + where;
}

std::string UsartSummary(StoppedBoard& board, const UsartRoles& roles) {
  std::string text;
  for (const UsartState& usart : ReadUsarts(board))
    if (usart.number == roles.main || (!IsConnected(usart.number, roles) && usart.sent_count > 0))
      text += (text.empty() ? "" : "; ") + Describe(usart, roles);
  return text;
}

}  // namespace tiltproof::harness
