#include "firmware/ports/stm32f4/fault_record.h"

#include <string_view>

#include "firmware/ports/stm32f4/console.h"
#include "firmware/ports/stm32f4/stm32f4.h"

[[gnu::section(".noinit")]] TiltproofFaultRecord tiltproof_fault_record;

extern "C" const std::uint32_t _sram, _eram;  // stm32f4.ld

namespace tiltproof::stm32f4 {
namespace {

std::string_view Name(std::uint32_t cause) {
  switch (cause) {
    case TILTPROOF_CAUSE_HARD_FAULT:
      return "hard fault";
    case TILTPROOF_CAUSE_MEMORY_FAULT:
      return "memory fault";
    case TILTPROOF_CAUSE_BUS_FAULT:
      return "bus fault";
    case TILTPROOF_CAUSE_USAGE_FAULT:
      return "usage fault";
    case TILTPROOF_CAUSE_ASSERT:
      return "failed assertion";
    case TILTPROOF_CAUSE_STACK_OVERFLOW:
      return "stack overflow";
    case TILTPROOF_CAUSE_UNEXPECTED_INTERRUPT:
      return "unexpected interrupt";
    default:
      return "unknown fault";
  }
}

TiltproofFaultRecord& ValidRecord() {
  if (tiltproof_fault_record.magic != TILTPROOF_FAULT_MAGIC) {
    tiltproof_fault_record = {};  // power-on: whatever was in RAM
    tiltproof_fault_record.magic = TILTPROOF_FAULT_MAGIC;
  }
  return tiltproof_fault_record;
}

[[noreturn]] void Record(std::uint32_t cause, std::uint32_t pc, std::uint32_t lr, std::uint32_t xpsr) {
  TiltproofFaultRecord& record = ValidRecord();
  record.cause = cause;
  record.pc = pc;
  record.lr = lr;
  record.xpsr = xpsr;
  record.cfsr = Scb().CFSR;
  record.hfsr = Scb().HFSR;
  record.mmfar = Scb().MMFAR;
  record.bfar = Scb().BFAR;
  ++record.count;
  ResetBoard();
}

std::uint32_t CauseOfException() {
  std::uint32_t number;
  asm volatile("mrs %0, ipsr" : "=r"(number));
  if (number >= 3 && number <= 6) return TILTPROOF_CAUSE_HARD_FAULT + number - 3;
  return TILTPROOF_CAUSE_UNEXPECTED_INTERRUPT;
}

}  // namespace

void Fail(std::uint32_t cause) {
  DisableInterrupts();
  Record(cause, reinterpret_cast<std::uint32_t>(__builtin_return_address(0)), 0, 0);
}

void ReportRestart(ResetReason reason) {
  TiltproofFaultRecord& record = ValidRecord();
  if (record.reported_count != record.count) {
    ConsoleLine line("restarted after ");
    line.Text(Name(record.cause)).Text(" at pc=0x").Hex(record.pc).Text(" lr=0x").Hex(record.lr);
    line.Text(" cfsr=0x").Hex(record.cfsr);
    constexpr std::uint32_t kMemoryAddressValid = Bit(7), kBusAddressValid = Bit(15);
    if ((record.cfsr & kBusAddressValid) != 0) line.Text(" address=0x").Hex(record.bfar);
    if ((record.cfsr & kMemoryAddressValid) != 0) line.Text(" address=0x").Hex(record.mmfar);
    line.Text(" (fault ").Number(record.count).Text(")").Send();
    record.reported_count = record.count;
  } else if (reason == ResetReason::kWatchdog) {
    ConsoleLine("restarted by the watchdog: the control activity had stopped").Send();
  } else if (reason == ResetReason::kSoftware) {
    ConsoleLine("restarted by software or a debugger").Send();
  } else if (reason == ResetReason::kPin) {
    ConsoleLine("restarted by the reset button").Send();
  }
}

}  // namespace tiltproof::stm32f4

extern "C" {

// The registers that the exception pushed (PM0214, section 2.3.7): r0 to r3, r12, lr, pc, xpsr.
[[noreturn, gnu::used]] void RecordException(const std::uint32_t* frame) {
  using namespace tiltproof::stm32f4;
  constexpr unsigned kFrameWords = 8, kLr = 5, kPc = 6, kXpsr = 7;
  const bool in_ram = frame >= &_sram && frame + kFrameWords <= &_eram;
  if (!in_ram) Record(CauseOfException(), 0, 0, 0);  // the stack has run out of RAM
  Record(CauseOfException(), frame[kPc], frame[kLr], frame[kXpsr]);
}

// Every fault, and every interrupt without a handler. The stack may be what is broken, so this begins a new
// one, and never returns.
[[gnu::naked, gnu::used]] void Fault_Handler() {
  asm volatile(
      "tst lr, #4\n\t"
      "ite eq\n\t"
      "mrseq r0, msp\n\t"
      "mrsne r0, psp\n\t"
      "ldr r1, =_estack\n\t"
      "msr msp, r1\n\t"
      "b RecordException\n\t"
      ".ltorg");
}

// The functions that the compiler and the library call when they cannot go on.
[[noreturn]] void abort() { tiltproof::stm32f4::Fail(TILTPROOF_CAUSE_ASSERT); }
// NOLINTNEXTLINE: its name is the compiler's
[[noreturn]] void __cxa_pure_virtual() { tiltproof::stm32f4::Fail(TILTPROOF_CAUSE_ASSERT); }

}  // extern "C"
