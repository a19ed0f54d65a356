// From reset to main(): vector table (RM0090, table 62), memory, constructors.

#include <array>
#include <cstddef>
#include <cstdint>

#include "firmware/ports/stm32f4/run_statistics.h"
#include "firmware/ports/stm32f4/stm32f4.h"

extern "C" {

extern std::uint32_t _sstack, _estack, _sdata, _edata, _sbss, _ebss;  // stm32f4.ld
extern const std::uint32_t _sidata;
using Constructor = void (*)();
extern const Constructor _sinit_array, _einit_array;

int main();
void Reset_Handler();
void Fault_Handler();
void USART1_IRQHandler();
void USART2_IRQHandler();
void USART3_IRQHandler();
// Not every image has these.
[[gnu::naked]] void Unexpected_Handler() noexcept { asm volatile("b Fault_Handler"); }
[[gnu::weak, gnu::alias("Unexpected_Handler")]] void UART4_IRQHandler() noexcept;
[[gnu::weak, gnu::alias("Unexpected_Handler")]] void USART6_IRQHandler() noexcept;
[[gnu::weak, gnu::alias("Unexpected_Handler")]] void SVC_Handler() noexcept;
[[gnu::weak, gnu::alias("Unexpected_Handler")]] void PendSV_Handler() noexcept;
[[gnu::weak, gnu::alias("Unexpected_Handler")]] void SysTick_Handler() noexcept;

}  // extern "C"

namespace {

using tiltproof::stm32f4::kIrqCount;

using Handler = void (*)();
constexpr std::size_t kExceptionCount = 16;
struct VectorTable {
  const void* stack;
  std::array<Handler, kExceptionCount - 1 + kIrqCount> handlers;  // from exception 1 on
};

constexpr VectorTable MakeVectors() {
  VectorTable table{.stack = &_estack, .handlers = {}};
  for (Handler& handler : table.handlers) handler = Unexpected_Handler;
  const auto exception = [&](std::size_t number) -> Handler& { return table.handlers[number - 1]; };
  exception(1) = Reset_Handler;
  for (const std::size_t fault : {3, 4, 5, 6}) exception(fault) = Fault_Handler;
  exception(11) = SVC_Handler;
  exception(14) = PendSV_Handler;
  exception(15) = SysTick_Handler;
  exception(kExceptionCount + tiltproof::stm32f4::kIrqUsart1) = USART1_IRQHandler;
  exception(kExceptionCount + tiltproof::stm32f4::kIrqUsart2) = USART2_IRQHandler;
  exception(kExceptionCount + tiltproof::stm32f4::kIrqUsart3) = USART3_IRQHandler;
  exception(kExceptionCount + tiltproof::stm32f4::kIrqUart4) = UART4_IRQHandler;
  exception(kExceptionCount + tiltproof::stm32f4::kIrqUsart6) = USART6_IRQHandler;
  return table;
}

[[gnu::section(".isr_vector"), gnu::used]] constinit const VectorTable vectors = MakeVectors();

}  // namespace

extern "C" void Reset_Handler() {
  using namespace tiltproof::stm32f4;
  Set(Cpacr(), kCpacrFpu);
  DataBarrier();
  InstructionBarrier();
  Scb().VTOR = reinterpret_cast<std::uint32_t>(&vectors);

  const std::uint32_t* from = &_sidata;
  for (std::uint32_t* to = &_sdata; to != &_edata;) *to++ = *from++;
  for (std::uint32_t* to = &_sbss; to != &_ebss;) *to++ = 0;
  std::uint32_t* stack_pointer;
  asm volatile("mov %0, sp" : "=r"(stack_pointer));
  for (std::uint32_t* to = &_sstack; to < stack_pointer; ++to) *to = kStackPaint;

  for (const Constructor* construct = &_sinit_array; construct != &_einit_array; ++construct) (*construct)();
  main();
  Fault_Handler();  // main() does not return
}
