// The plug-in that keeps an unmodified image in the emulator in lockstep with the harness, in virtual time.
//
// It adds to the machine what a chip has and QEMU lacks (harness/emulator/plugin/chip.h), its USARTs among that, and
// holds the virtual clock:
//
//   - a barrier, the byte that ends what the firmware transmits, and the end of the time granted, stop the virtual processor
//     until the harness grants more. The instruction counter is the clock (-icount), so virtual time stands still too;
//   - received bytes reach the USART at their virtual times; one that comes while the last was not read is an
//     overrun (RM0090, section 30.3.3): it is lost, and the flag set;
//   - while the processor sleeps (WFI), time goes on to the next timer at once;
//   - faults of the device (stall, delayed task, reset, flipped bits) take place at their virtual nanosecond.
//
//   qemu-system-arm ... -icount shift=3,sleep=off
//     -plugin tiltproof_lockstep.so,socket=3,barrier=126,main=2,reference=3,console=1,line0=6
//
// `socket` is an inherited descriptor, a connected unix stream socket (harness/emulator/lockstep_protocol.h); the
// lines are given as numbers of USARTs. `barrier` tells where a frame of the line's protocol ends
// (harness/emulator/frame_end_text.h): there may be an answer to it. `ideal` means that the lines have no rate, so that sending takes no time.
// `hse` is the rate of the crystal in Hz, 0 when there is none. `coverage` is an inherited descriptor of memory for
// harness::lockstep::BlockCounts; without it nothing is counted. `debugged` means that QEMU has a port for a debugger.
//
// With `realtime=on` instead of the socket the machine runs by the clock on the wall, and its USARTs have the character
// devices that QEMU was given:
//
//   qemu-system-arm ... -serial stdio -plugin tiltproof_lockstep.so,realtime=on
//
// `memory` is then an inherited descriptor of memory for a harness::lockstep::RealtimeBoard. `word` is written at the
// address `word_at` before the first instruction.
//
// QEMU is GPL-2, so this file uses nothing but the standard library. It has no static objects with destructors,
// since QEMU ends by exit() with threads still running.
#include <pthread.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "harness/emulator/lockstep_protocol.h"
#include "harness/emulator/plugin/arguments.h"
#include "harness/emulator/plugin/block_counts.h"
#include "harness/emulator/plugin/board_faults.h"
#include "harness/emulator/plugin/command.h"
#include "harness/emulator/plugin/debugger.h"
#include "harness/emulator/plugin/plugin_state.h"
#include "harness/emulator/plugin/processor.h"
#include "harness/emulator/plugin/qemu_internals.h"
#include "harness/emulator/plugin/readers.h"
#include "harness/emulator/plugin/sleep.h"
#include "harness/emulator/plugin/stack_watch.h"
#include "harness/emulator/plugin/unmodelled.h"

namespace tiltproof::qemu {
namespace {

// Bytes of a sender without flags are passed on after this many.
constexpr std::size_t kUnsentBytesMax = 1024;
// Where bytes wait for the one before to be read.
constexpr std::int64_t kPollNs = 1'000;
constexpr std::uint16_t kWfi = 0xBF30, kWfe = 0xBF20;

// --- to the harness ---

// Sends what the firmware has transmitted; for the console at the end of each text line, so that its last
// words are not lost.
void SendUnsent(Uart& uart) {
  if (!uart.unsent.empty())
    plugin.socket.Send(Kind::kTransmit, uart.unsent.data(), uart.unsent.size() * sizeof(TransmittedByte));
  uart.unsent.clear();
}

void SendRegisters(Uart& uart) {
  const auto [brr, cr1, cr2, cr3, clock_hz] = uart.unit->settings();
  const UsartRegisters now{uart.usart, brr, cr1, cr2, cr3, clock_hz};
  if (now == uart.told) return;
  SendUnsent(uart);
  plugin.socket.Send(Kind::kUsart, &now, sizeof(now));
  uart.told = now;
}

// --- bytes to the firmware ---

void ArmReceive(Uart& uart, std::int64_t at) {
  if (!uart.queue.empty()) uart.timer.Set(std::max(at, uart.queue.front().arrival_ns));
}

void OnReceiveTimer(void* opaque) {
  Uart& uart = *static_cast<Uart*>(opaque);
  if (uart.queue.empty()) return;
  const ReceivedByte received = uart.queue.front();
  const bool free = uart.unit->Free();
  if (received.waits && !free) return uart.timer.Set(Now() + kPollNs);
  uart.queue.pop_front();
  if (!free || received.mark == Mark::kOverrun) {
    if (!free) SendEvent(EventKind::kOverrun, static_cast<std::uint32_t>(uart.usart));
    uart.unit->Overrun();
  } else {
    uart.unit->Deliver(received.word, received.mark == Mark::kFraming  ? UsartUnit::kFraming
                                      : received.mark == Mark::kNoise  ? UsartUnit::kNoise
                                      : received.mark == Mark::kParity ? UsartUnit::kParity
                                                                       : 0);
  }
  ArmReceive(uart, received.waits ? Now() + kPollNs : 0);
}

void Deliver(const std::vector<std::uint8_t>& body) {
  for (std::size_t at = 0; at + sizeof(ReceivedByte) <= body.size(); at += sizeof(ReceivedByte)) {
    ReceivedByte byte;
    std::memcpy(&byte, body.data() + at, sizeof(byte));
    Uart& uart = plugin.uarts[static_cast<std::size_t>(byte.usart)];
    if (uart.unit == nullptr) continue;
    const bool idle = uart.queue.empty();
    uart.queue.push_back(byte);
    if (idle) ArmReceive(uart, 0);
  }
}

// --- taking turns ---

void AddStall(const Stall& stall) {
  plugin.stalls.insert(
      std::upper_bound(plugin.stalls.begin(), plugin.stalls.end(), stall,
                       [](const Stall& a, const Stall& b) { return a.begin_ns < b.begin_ns; }),
      stall);
  plugin.stall_timer.Set(plugin.stalls.front().begin_ns);
}

void AddFlips(const FlipBits& flips) {
  plugin.flips.push_back(flips);
  std::stable_sort(plugin.flips.begin(), plugin.flips.end(),
                   [](const FlipBits& a, const FlipBits& b) { return a.at_ns < b.at_ns; });
  plugin.flip_timer.Set(plugin.flips.front().at_ns);
}

void SendMemory(const ReadMemory& read) {
  std::vector<std::uint8_t> bytes(std::min(read.size, kBodyBytesMax));
  ReadAsProcessor(plugin.cpu, read.address, bytes.data(), bytes.size());
  plugin.socket.Send(Kind::kMemory, bytes.data(), bytes.size());
}

void SendUsarts() {
  for (int number = 1; number <= UsartUnit::kCount; ++number)
    plugin.usarts.clock_hz[number - 1] = plugin.chip.usart(number).clock_hz();
  plugin.socket.Send(Kind::kUsarts, &plugin.usarts, sizeof(plugin.usarts));
}

void WatchStacks(const std::vector<std::uint8_t>& body) {
  std::vector<WatchedStack> stacks(body.size() / sizeof(WatchedStack));
  std::memcpy(stacks.data(), body.data(), stacks.size() * sizeof(WatchedStack));
  stack_watch.Watch(stacks);
}

void SendStacks() {
  const std::vector<std::uint32_t> lowest = stack_watch.Lowest();
  plugin.socket.Send(Kind::kStacks, lowest.data(), lowest.size() * sizeof(lowest[0]));
}

void BeginTurn(const Run& run) {
  if (readers.Renew()) async_run_on_cpu(plugin.cpu, SleepOnWork, {});
  plugin.run = run;
  plugin.horizon.Cancel();
  plugin.turn_sleep.Begin(Now(), qemu_clock_deadline_ns_all(kClockVirtual, kAnyAttribute));
  plugin.horizon.Set(plugin.run.until_ns);
  plugin.turn_resets_count = 0;
  plugin.turn_limit.Begin(plugin.run.processor_ns);
}

// As a user programs the chip.
void WriteToFlash(std::uint32_t address, std::uint32_t word) {
  address_space_write_rom(cpu_get_address_space(plugin.cpu, 0), address, 0, &word, 4);
}

// Carries out commands until the harness grants time.
void ReadCommands() {
  for (;;) {
    plugin.socket.Flush();
    Header header{};
    plugin.socket.Receive(&header, sizeof(header));
    if (header.body_bytes > kBodyBytesMax) Die("a damaged command");
    std::vector<std::uint8_t> body(header.body_bytes);
    plugin.socket.Receive(body.data(), body.size());
    switch (header.kind) {
      case Kind::kReceive:
        Deliver(body);
        break;
      case Kind::kStall:
        AddStall(As<Stall>(body));
        break;
      case Kind::kDelayTask:
        AddDelay(As<DelayTask>(body));
        break;
      case Kind::kFlipBits:
        AddFlips(As<FlipBits>(body));
        break;
      case Kind::kReadMemory:
        SendMemory(As<ReadMemory>(body));
        break;
      case Kind::kDumpState:
        Send(Kind::kState, DumpState(plugin.cpu));
        break;
      case Kind::kWriteCode: {
        const auto code = As<WriteCode>(body);
        WriteToFlash(code.address, code.word);
        break;
      }
      case Kind::kReadUsarts:
        SendUsarts();
        break;
      case Kind::kBreak:
        plugin.break_timer.Set(As<Break>(body).at_ns);
        break;
      case Kind::kWatchStacks:
        WatchStacks(body);
        break;
      case Kind::kReadStacks:
        SendStacks();
        break;
      case Kind::kRun:
        return BeginTurn(As<Run>(body));
      default:
        Die("an unknown command: harness and plug-in of different builds?");
    }
  }
}

void Stop() {
  for (Uart& uart : plugin.uarts) {
    SendUnsent(uart);
    if (uart.unit != nullptr) SendRegisters(uart);
  }
  const Stopped stopped{Now(), plugin.last_slept_ns, plugin.turn_sleep.Until(Now()), plugin.locked_up};
  plugin.socket.Send(Kind::kStopped, &stopped, sizeof(stopped));
  ReadCommands();
}

void OnHorizon(void* /*opaque*/) { Stop(); }

// Before the horizon, as work of the processor's thread.
void EndTurn() {
  Stop();
  async_run_on_cpu(plugin.cpu, SleepOnWork, {});
}

void AtTurnLimit(void* cpu, RunOnCpuData /*data*/) {
  if (plugin.turn_limit.Exceeded()) return EndTurn();
  async_run_on_cpu(cpu, SleepOnWork, {});
}

// QEMU aborts when the processor locks up. The harness reads its state before that.
void OnAbort(int /*signal*/) {
  if (!plugin.begun || pthread_equal(pthread_self(), plugin.cpu_thread) == 0) return;
  plugin.locked_up = true;
  if (plugin.arguments.realtime) return plugin.notes.LockedUp(plugin.cpu);
  Stop();
}

// A frame, or a byte for another board, has been given to the transmitter. There is time before the first byte of an answer.
void AwaitAnswer(std::int64_t answer_after_ns) {
  if (answer_after_ns == 0) return Stop();
  const std::int64_t at = Now() + answer_after_ns;
  if (at < plugin.run.until_ns) plugin.horizon.Set(plugin.run.until_ns = at);
}

// A byte is given to a USART's transmitter.
void OnTransmit(int number, std::uint8_t byte) {
  if (plugin.arguments.realtime) {
    plugin.notes.Sent(number);
    return plugin.character_devices[static_cast<std::size_t>(number - 1)].Transmit(byte);
  }
  ++plugin.usarts.sent_count[number - 1];
  for (Uart& uart : plugin.uarts) {
    if (uart.unit != &plugin.chip.usart(number)) continue;
    SendRegisters(uart);
    uart.unsent.push_back({Now(), uart.usart, byte});
    const bool line_end = uart.usart == Usart::kConsole && byte == '\n';
    if (uart.frames && uart.frames->FindEnd({&byte, 1})) {
      AwaitAnswer(plugin.run.answer_after_ns);
    } else if (uart.usart >= Usart::kFirstLine) {
      AwaitAnswer(plugin.run.line_answer_after_ns);
    } else if (line_end || uart.unsent.size() >= kUnsentBytesMax) {
      SendUnsent(uart);
      plugin.socket.Flush();
    }
  }
}

// --- the emulator's callbacks ---

void OnWfi(unsigned /*vcpu*/, void* /*opaque*/) { async_run_on_cpu(qemu_get_cpu(0), SleepWork, {}); }
void OnWfe(unsigned /*vcpu*/, void* /*opaque*/) { async_run_on_cpu(qemu_get_cpu(0), WaitForEventWork, {}); }

// The firmware has failed: the rest of the flight, as it may be, shows nothing.
void OnBrokenLimit(const std::string& what) {
  if (plugin.arguments.realtime) return plugin.notes.BrokenLimit(what);
  Send(Kind::kBrokenLimit, what);
}

void OnUnmodelled(std::uint32_t address, bool is_write) {
  const std::uint32_t pc = RegisterIn(DumpState(plugin.cpu), "R15");
  if (plugin.arguments.realtime) return plugin.notes.Unmodelled(address, pc, is_write);
  SendEvent(EventKind::kUnmodelled, pc, address, is_write ? 1 : 0);
}

void BeginChip() {
  unmodelled.Init(OnUnmodelled);
  Chip::Options options{.hse_hz = plugin.arguments.hse_hz,
                        .usart = {.transmit = OnTransmit, .taken = {}, .programmed = {}},
                        .watchdog = OnWatchdog,
                        .broken_limit = OnBrokenLimit};
  if (plugin.arguments.realtime) {
    options.clocks_changed = [] {
      for (int number = 1; number <= UsartUnit::kCount; ++number)
        plugin.notes.Clock(number, plugin.chip.usart(number).clock_hz());
    };
    options.usart.taken = [](int number) {
      plugin.character_devices[static_cast<std::size_t>(number - 1)].Take();
    };
    options.usart.programmed = [](int number) {
      plugin.character_devices[static_cast<std::size_t>(number - 1)].Program();
    };
  }
  void* core_clock = object_resolve_path("/machine/SYSCLK", nullptr);
  void* nvic = object_resolve_path("nvic", nullptr);
  if (core_clock == nullptr || nvic == nullptr)
    Die("the machine has no clock or no NVIC where one should be");
  plugin.interrupt_controller = nvic;
  plugin.chip.Init(options, core_clock);
  qemu_register_reset(OnReset, nullptr);
  qdev_connect_gpio_out_named(nvic, "SYSRESETREQ", 0, qemu_allocate_irq(OnResetRequest, nullptr, 0));
}

// By the clock on the wall: the USARTs send at once, and receive as fast as they are read.
void BeginRealtime() {
  plugin.lost_ticks.Init(plugin.notes, plugin.cpu_thread);
  for (int number = 1; number <= UsartUnit::kCount; ++number) {
    plugin.chip.usart(number).SetUnpaced();
    if (!plugin.character_devices[static_cast<std::size_t>(number - 1)].Init(number,
                                                                             plugin.chip.usart(number)))
      Die("the machine has no such USART");
  }
}

void BeginLockstep() {
  std::int16_t shift = 0;
  std::memcpy(&shift, timers_state + kIcountShiftOffset, sizeof(shift));
  if (shift != 3) Die("-icount shift=3 is not where it should be: another build of QEMU 7.2?");
  // Blocks of one instruction are many where breakpoints are, and tell nothing about registers.
  if (plugin.arguments.debugged) {
    debugger.Init(plugin.cpu);
  } else {
    readers.Init(plugin.cpu);
  }
  stack_watch.Init(plugin.cpu);
  plugin.end_turn = EndTurn;
  plugin.turn_limit.Init(plugin.cpu, AtTurnLimit);
  plugin.horizon.Init(OnHorizon, nullptr);
  plugin.stall_timer.Init(OnStallTimer, nullptr);
  plugin.delay_timer.Init(OnDelayTimer, nullptr);
  plugin.flip_timer.Init(OnFlipTimer, nullptr);
  plugin.break_timer.Init(OnBreakTimer, nullptr);
  for (std::size_t i = 0; i < plugin.uarts.size(); ++i) {
    const int number = plugin.arguments.usart_numbers[i];
    if (number == 0) continue;
    if (number > UsartUnit::kCount) Die("the machine has no such USART");
    Uart& uart = plugin.uarts[i];
    uart.usart = static_cast<Usart>(i);
    if (uart.usart == Usart::kMain) uart.frames = link::MakeFrameCutter(*plugin.arguments.barrier);
    uart.timer.Init(OnReceiveTimer, &uart);
    uart.unit = &plugin.chip.usart(number);
    if (plugin.arguments.ideal && uart.usart < Usart::kConsole) uart.unit->SetUnpaced();
  }
  const Hello hello{kProtocolVersion};
  plugin.socket.Send(Kind::kHello, &hello, sizeof(hello));
  ReadCommands();
}

// Before the first instruction. The clocks do not run yet when the processor is made, and virtual time may not be
// read in an instruction's callback: hence as work of the processor's thread.
void Begin(void* cpu, RunOnCpuData /*data*/) {
  plugin.cpu = cpu;
  plugin.cpu_thread = pthread_self();
  BeginChip();
  plugin.begun = true;
  if (plugin.arguments.word_at != 0) WriteToFlash(plugin.arguments.word_at, plugin.arguments.word);
  if (plugin.arguments.realtime) {
    BeginRealtime();
  } else {
    BeginLockstep();
  }
}

void OnFirstInstruction(unsigned /*vcpu*/, void* /*opaque*/) {
  static bool asked = false;
  if (!asked) async_run_on_cpu(qemu_get_cpu(0), Begin, {});
  asked = true;
}

void OnTranslate(qemu_plugin_id_t /*id*/, qemu_plugin_tb* block) {
  const std::size_t count = qemu_plugin_tb_n_insns(block);
  if (!plugin.begun)
    qemu_plugin_register_vcpu_insn_exec_cb(qemu_plugin_tb_get_insn(block, 0), OnFirstInstruction, 0, nullptr);
  if (plugin.arguments.realtime) return;
  readers.Mark(block);
  block_counts.Mark(block);
  stack_watch.Mark(block);
  if (plugin.watches_blocks) qemu_plugin_register_vcpu_tb_exec_cb(block, OnBlock, 0, nullptr);
  for (std::size_t i = 0; i < count; ++i) {
    qemu_plugin_insn* instruction = qemu_plugin_tb_get_insn(block, i);
    std::uint16_t code = 0;
    if (qemu_plugin_insn_size(instruction) != sizeof(code)) continue;
    std::memcpy(&code, qemu_plugin_insn_data(instruction), sizeof(code));
    if (code == kWfi) qemu_plugin_register_vcpu_insn_exec_cb(instruction, OnWfi, 0, nullptr);
    if (code == kWfe) qemu_plugin_register_vcpu_insn_exec_cb(instruction, OnWfe, 0, nullptr);
  }
}

}  // namespace
}  // namespace tiltproof::qemu

extern "C" {

__attribute__((visibility("default"))) extern const int qemu_plugin_version = 1;

__attribute__((visibility("default"))) int qemu_plugin_install(qemu_plugin_id_t id, const qemu_info_t*,
                                                               int argc, char** argv) {
  using namespace tiltproof::qemu;
  const std::string trouble = Parse(argc, argv, plugin.arguments);
  if (!trouble.empty()) {
    std::fprintf(stderr, "lockstep plug-in: %s\n", trouble.c_str());
    return 1;
  }
  if (!plugin.arguments.realtime) plugin.socket.Use(plugin.arguments.socket);
  if (plugin.arguments.coverage >= 0) block_counts.Use(plugin.arguments.coverage);
  if (plugin.arguments.memory >= 0) plugin.notes.Use(plugin.arguments.memory);
  std::signal(SIGABRT, OnAbort);
  qemu_plugin_register_vcpu_tb_trans_cb(id, OnTranslate);
  return 0;
}

}  // extern "C"
