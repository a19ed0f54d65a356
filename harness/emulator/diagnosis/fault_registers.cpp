#include "harness/emulator/diagnosis/fault_registers.h"

#include <fmt/format.h>

#include "harness/emulator/stm32f405.h"

namespace tiltproof::harness {
namespace {

enum class Address : std::uint8_t { kNone, kMemory, kBus };

struct Flag {
  std::uint32_t bit;
  const char* text;
  Address address;
};

// CFSR. What tells most comes first.
constexpr std::array kFlags = {
    Flag{9, "bus fault: precise data access", Address::kBus},
    Flag{8, "bus fault: instruction fetch from where no memory is", Address::kNone},
    Flag{10,
         "bus fault: imprecise data access (a write that was buffered; the PC is some instructions later)",
         Address::kNone},
    Flag{1, "memory management fault: data access that the MPU forbids", Address::kMemory},
    Flag{0, "memory management fault: execution from where the MPU or the memory map forbids it",
         Address::kNone},
    Flag{25, "usage fault: division by zero", Address::kNone},
    Flag{24, "usage fault: unaligned access", Address::kNone},
    Flag{19, "usage fault: no coprocessor (is the FPU on? CPACR)", Address::kNone},
    Flag{18, "usage fault: invalid EXC_RETURN or exception state on return", Address::kNone},
    Flag{17, "usage fault: invalid state (a jump to an even address, or through a null pointer)",
         Address::kNone},
    Flag{16, "usage fault: undefined instruction", Address::kNone},
    Flag{12, "bus fault while the registers were stacked for an exception (stack overflow?)", Address::kNone},
    Flag{11, "bus fault while the registers were taken from the stack", Address::kNone},
    Flag{13, "bus fault while the floating-point registers were stacked", Address::kNone},
    Flag{4, "memory management fault while the registers were stacked for an exception (stack overflow?)",
         Address::kNone},
    Flag{3, "memory management fault while the registers were taken from the stack", Address::kNone},
    Flag{5, "memory management fault while the floating-point registers were stacked", Address::kNone},
};
constexpr std::uint32_t kMmfarValid = 1U << 7, kBfarValid = 1U << 15;   // CFSR
constexpr std::uint32_t kVectorRead = 1U << 1, kDebugEvent = 1U << 31;  // HFSR

std::string At(const FaultRegisters& registers, Address which) {
  const bool bus = which == Address::kBus;
  if (which == Address::kNone || (registers.cfsr & (bus ? kBfarValid : kMmfarValid)) == 0) return "";
  const std::uint32_t address = bus ? registers.bfar : registers.mmfar;
  return fmt::format(" to 0x{:08x} ({})", address, PlaceName(address));
}

bool IsCode(std::uint32_t address) {
  return Holds(kFlash, address) || Holds(kFlashAtZero, address) || Holds(kRam, address);
}

bool IsExceptionReturn(std::uint32_t value) { return value >= 0xFFFF'FFE0; }
// Only a jump to an even address leaves Thumb state. Then it is the return address that must be in code.
bool IsPlausible(const ExceptionFrame& frame) {
  constexpr std::uint32_t kThumb = 1U << 24, kAlways0 = 0x00F0'0000;  // xPSR
  if ((frame.xpsr & kAlways0) != 0 || (frame.pc & 1) != 0) return false;
  if ((frame.xpsr & kThumb) != 0) return IsCode(frame.pc);
  return (frame.link & 1) != 0 && IsCode(frame.link);
}

}  // namespace

bool ReturnsToProcessStack(std::uint32_t link) {
  constexpr std::uint32_t kProcessStack = 1U << 2;
  return IsExceptionReturn(link) && (link & kProcessStack) != 0;
}

std::string FaultText(const FaultRegisters& registers) {
  std::vector<std::string> texts;
  for (const Flag& flag : kFlags)
    if ((registers.cfsr >> flag.bit & 1) != 0) texts.push_back(flag.text + At(registers, flag.address));
  if ((registers.hfsr & kVectorRead) != 0)
    texts.emplace_back("hard fault: the vector table could not be read");
  if ((registers.hfsr & kDebugEvent) != 0)
    texts.emplace_back("hard fault: a breakpoint instruction without a debugger");
  return fmt::format("{}", fmt::join(texts, "; "));
}

std::vector<ExceptionFrame> FindExceptionFrames(const CpuState& state, const ReadWords& read) {
  constexpr std::size_t kFrameWords = 8, kSearchedWords = 128;
  std::vector<ExceptionFrame> frames;
  if (!Holds(kRam, state.stack_pointer(), sizeof(std::uint32_t) * kFrameWords)) return frames;
  // EXC_RETURN is in the link register until the handler calls a function.
  if (ReturnsToProcessStack(state.link())) return frames;
  const std::vector<std::uint32_t> words = read(state.stack_pointer(), kSearchedWords);
  int exception = state.exception();
  for (std::size_t i = 0; exception != 0 && i + kFrameWords <= words.size(); ++i) {
    const ExceptionFrame frame{.address = state.stack_pointer() + static_cast<std::uint32_t>(4 * i),
                               .r0 = words[i],
                               .r1 = words[i + 1],
                               .r2 = words[i + 2],
                               .r3 = words[i + 3],
                               .r12 = words[i + 4],
                               .link = words[i + 5],
                               .pc = words[i + 6],
                               .xpsr = words[i + 7]};
    if (!IsPlausible(frame)) continue;
    frames.push_back(frame);
    exception = frame.exception();
    i += kFrameWords - 1;
  }
  return frames;
}

}  // namespace tiltproof::harness
