// The plug-in that keeps an unmodified image in the emulator in lockstep with the harness, in virtual time.
//
// It stands behind the emulated USARTs (in place of the output of "-chardev null") and holds the virtual clock:
//
//   - a barrier byte that the firmware transmits, and the end of the time granted, stop the virtual processor until
//     the harness grants more. The instruction counter is the clock (-icount), so virtual time stands still too;
//   - received bytes reach the USART at their virtual times; one that comes while the last was not read is an
//     overrun (RM0090, section 30.3.3): it is lost, and the flag set;
//   - while the processor sleeps (WFI), time goes on to the next timer at once;
//   - faults of the device (stall, reset, flipped bits) take place at their virtual nanosecond.
//
// It also adds what the emulated chip lacks and a fault-tolerant firmware needs: the independent watchdog (RM0090,
// section 21), the reset flags of RCC_CSR (section 7.3.21), and a USART's error flags (section 30.6.1).
//
//   qemu-system-arm ... -icount shift=3,sleep=off -chardev null,id=usart1 -serial chardev:usart1 ...
//     -plugin tiltproof_lockstep.so,socket=3,barrier=126,main=2,reference=3,console=1
//
// `socket` is an inherited descriptor, a connected unix stream socket (harness/emulator/lockstep_protocol.h); the
// lines are given as numbers of USARTs. `barrier` is the byte that ends a frame of the line's protocol, as a number from
// 0 to 255: there may be an answer to it.
//
// QEMU is GPL-2, so this file uses nothing but the standard library. It has no static objects with destructors,
// since QEMU ends by exit() with threads still running.
#include <pthread.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "harness/emulator/lockstep_protocol.h"
#include "harness/emulator/plugin/arguments.h"
#include "harness/emulator/plugin/command.h"
#include "harness/emulator/plugin/peripherals.h"
#include "harness/emulator/plugin/processor.h"
#include "harness/emulator/plugin/qemu_internals.h"

namespace tiltproof::qemu {
namespace {

using namespace harness::lockstep;  // the protocol's names

// Bytes of a sender without flags are passed on after this many.
constexpr std::size_t kUnsentBytesMax = 1024;
// Where bytes wait for the one before to be read.
constexpr std::int64_t kPollNs = 1'000;
constexpr std::uint16_t kWfi = 0xBF30;

std::int64_t Now() { return qemu_clock_get_ns(kClockVirtual); }

struct Uart {
  void* chardev = nullptr;
  Usart usart{};
  UsartReceiver* receiver = nullptr;
  std::deque<ReceivedByte> queue;  // on their way to the firmware
  Timer timer;
  std::vector<TransmittedByte> unsent;  // not yet told
  UsartRegisters told{};                // of its registers
};

struct Plugin {
  Arguments arguments;
  std::vector<std::uint8_t> out;  // messages that wait for Flush()
  std::array<Uart, kConnectedUsartCount> uarts;
  std::array<void*, std::extent_v<decltype(SentBytes::count)>>
      chardevs{};  // of all USARTs, the first is USART1's
  SentBytes sent{};
  void* cpu = nullptr;
  pthread_t cpu_thread{};
  bool locked_up = false;
  Timer horizon;
  std::deque<Stall> stalls;  // by begin
  Timer stall_timer;
  std::int64_t stalled_until = 0;
  bool hangs = false;    // until a reset
  bool holding = false;  // StallWork is under way
  Stall stall{};         // under way, or the last
  std::deque<FlipBits> flips;
  Timer flip_timer;
  Timer break_timer;
  std::int64_t last_slept_ns = 0;                // or was made to stand still
  ResetCause pending_cause = ResetCause::kNone;  // of the reset that was asked for
  Watchdog watchdog;
  ResetFlags reset_flags;
  bool begun = false;
};
Plugin& plugin = *new Plugin;

// --- the socket ---

void Append(const void* bytes, std::size_t size) {
  const auto* first = static_cast<const std::uint8_t*>(bytes);
  plugin.out.insert(plugin.out.end(), first, first + size);
}

void Send(Kind kind, const void* body, std::size_t size) {
  const Header header{kind, static_cast<std::uint32_t>(size)};
  Append(&header, sizeof(header));
  Append(body, size);
}

void Send(Kind kind, const std::string& body) { Send(kind, body.data(), body.size()); }

void Flush() {
  for (std::size_t sent = 0; sent < plugin.out.size();) {
    const ssize_t n =
        send(plugin.arguments.socket, plugin.out.data() + sent, plugin.out.size() - sent, MSG_NOSIGNAL);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) _exit(0);  // the harness is gone
    sent += static_cast<std::size_t>(n);
  }
  plugin.out.clear();
}

void Receive(void* buffer, std::size_t size) {
  auto* at = static_cast<std::uint8_t*>(buffer);
  while (size != 0) {
    const ssize_t n = recv(plugin.arguments.socket, at, size, 0);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) _exit(0);
    at += n;
    size -= static_cast<std::size_t>(n);
  }
}

void SendEvent(EventKind kind, std::uint32_t value, std::uint32_t address = 0, std::uint8_t before = 0,
               std::uint8_t after = 0) {
  const Event event{Now(), kind, value, address, before, after};
  Send(Kind::kEvent, &event, sizeof(event));
}

// Sends what the firmware has transmitted; for the console at the end of each text line, so that its last
// words are not lost.
void SendUnsent(Uart& uart) {
  if (!uart.unsent.empty())
    Send(Kind::kTransmit, uart.unsent.data(), uart.unsent.size() * sizeof(TransmittedByte));
  uart.unsent.clear();
}

void SendRegisters(Uart& uart) {
  const UsartRegisters now = uart.receiver->Registers(uart.usart);
  if (now == uart.told) return;
  SendUnsent(uart);
  Send(Kind::kUsart, &now, sizeof(now));
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
  const bool free = uart.receiver->Free();
  if (received.waits && !free) return uart.timer.Set(Now() + kPollNs);
  uart.queue.pop_front();
  if (!free || received.mark == Mark::kOverrun) {
    if (!free) SendEvent(EventKind::kOverrun, static_cast<std::uint32_t>(uart.usart));
    uart.receiver->Overrun();
  } else {
    uart.receiver->Deliver(received.byte, received.mark == Mark::kFraming ? UsartReceiver::kFraming
                                          : received.mark == Mark::kNoise ? UsartReceiver::kNoise
                                                                          : 0);
  }
  ArmReceive(uart, received.waits ? Now() + kPollNs : 0);
}

void Deliver(const std::vector<std::uint8_t>& body) {
  for (std::size_t at = 0; at + sizeof(ReceivedByte) <= body.size(); at += sizeof(ReceivedByte)) {
    ReceivedByte byte;
    std::memcpy(&byte, body.data() + at, sizeof(byte));
    Uart& uart = plugin.uarts[static_cast<std::size_t>(byte.usart)];
    if (uart.chardev == nullptr) continue;
    const bool idle = uart.queue.empty();
    uart.queue.push_back(byte);
    if (idle) ArmReceive(uart, 0);
  }
}

// --- time ---

// Virtual time passes although no instruction is executed. QEMU's own way, icount_start_warp_timer(), wakes its main
// thread each time, which costs more than all else.
void Advance(std::int64_t step) {
  const std::int64_t now = Now();
  std::int64_t bias = 0;
  std::memcpy(&bias, timers_state + kIcountBiasOffset, sizeof(bias));
  bias += step;
  std::memcpy(timers_state + kIcountBiasOffset, &bias, sizeof(bias));
  if (Now() != now + step) Die("the virtual clock cannot be moved on: another build of QEMU 7.2?");
}

// --- device faults ---

void SleepWork(void* cpu, RunOnCpuData data);

// Time passes, and the processor does nothing: the counter is moved on from timer to timer, until the stall ends.
void StallWork(void* cpu, RunOnCpuData data) {
  // A reset that has been asked for comes first, at this very instant.
  if (plugin.pending_cause != ResetCause::kNone) return async_run_on_cpu(cpu, StallWork, data);
  const std::int64_t now = plugin.last_slept_ns = Now();
  if (!plugin.hangs && now >= plugin.stalled_until) {
    plugin.holding = false;
    SendEvent(EventKind::kStallEnds, 0);
    // It may have slept before.
    return async_run_on_cpu(cpu, SleepWork, {});
  }
  std::int64_t step = qemu_clock_deadline_ns_all(kClockVirtual, kAnyAttribute);
  if (!plugin.hangs && (step < 0 || step > plugin.stalled_until - now)) step = plugin.stalled_until - now;
  Advance(step);
  // Before the timers: one of them may reset the processor and begin a stall of its own.
  async_run_on_cpu(cpu, StallWork, data);
  qemu_clock_run_timers(kClockVirtual);
}

void HoldUntil(std::int64_t until) {
  if (until == Stall::kNever) {
    plugin.hangs = true;
  } else {
    plugin.stalled_until = std::max(plugin.stalled_until, until);
  }
  if (!std::exchange(plugin.holding, true)) async_run_on_cpu(plugin.cpu, StallWork, {});
}

// The machine is being reset.
void OnReset(void* /*opaque*/) {
  const ResetCause cause = std::exchange(plugin.pending_cause, ResetCause::kNone);
  plugin.hangs = false;
  plugin.watchdog.Reset();
  plugin.reset_flags.Add(cause);
  for (Uart& uart : plugin.uarts)
    if (uart.receiver != nullptr) uart.receiver->Reset();
  SendEvent(EventKind::kReset, static_cast<std::uint32_t>(cause));
}

// On the processor's own thread: it has executed nothing since the reset was asked for. QEMU's main thread, whose
// business it is otherwise, comes some time later, and how much later in virtual time depends on the machine.
void ResetWork(void* /*cpu*/, RunOnCpuData /*data*/) { qemu_system_reset(kCauseSystemReset); }

void Reset(ResetCause cause) {
  if (std::exchange(plugin.pending_cause, cause) == ResetCause::kNone)
    async_run_on_cpu(plugin.cpu, ResetWork, {});
}

// Between two instructions, right before the reset.
void TellLastWords(void* cpu, RunOnCpuData /*data*/) { Send(Kind::kLastWords, LastWordsOf(cpu)); }

void ResetByItself(ResetCause cause) {
  if (plugin.pending_cause == ResetCause::kNone) async_run_on_cpu(plugin.cpu, TellLastWords, {});
  Reset(cause);
}

void OnWatchdog() { ResetByItself(ResetCause::kWatchdog); }

// The firmware has set SYSRESETREQ (PM0214, section 4.4.5).
void OnResetRequest(void* /*opaque*/, int /*line*/, int level) {
  if (level != 0 && plugin.pending_cause == ResetCause::kNone) ResetByItself(ResetCause::kSoftware);
}

void OnStallTimer(void* /*opaque*/) {
  plugin.stall = plugin.stalls.front();
  plugin.stalls.pop_front();
  if (!plugin.stalls.empty()) plugin.stall_timer.Set(plugin.stalls.front().begin_ns);
  SendEvent(EventKind::kStallBegins, plugin.stall.fault);
  if (plugin.stall.reset != ResetCause::kNone) Reset(plugin.stall.reset);
  HoldUntil(plugin.stall.end_ns);
}

void OnFlipTimer(void* /*opaque*/) {
  const FlipBits flips = plugin.flips.front();
  plugin.flips.pop_front();
  if (!plugin.flips.empty()) plugin.flip_timer.Set(plugin.flips.front().at_ns);
  for (std::uint32_t i = 0; i < flips.count; ++i) {
    std::uint8_t before = 0;
    cpu_physical_memory_rw(flips.bits[i].address, &before, 1, false);
    std::uint8_t after = before ^ static_cast<std::uint8_t>(1u << flips.bits[i].bit);
    cpu_physical_memory_rw(flips.bits[i].address, &after, 1, true);
    SendEvent(EventKind::kBitFlipped, flips.fault, flips.bits[i].address, before, after);
  }
}

// On the processor's thread, between two instructions: it stops at once.
void OnBreakTimer(void* /*opaque*/) { vm_stop(kRunStatePaused); }

// --- taking turns ---

// Carries out commands until the harness grants time.
void TakeCommands() {
  for (;;) {
    Flush();
    Header header{};
    Receive(&header, sizeof(header));
    if (header.body_bytes > kBodyBytesMax) Die("a damaged command");
    std::vector<std::uint8_t> body(header.body_bytes);
    Receive(body.data(), body.size());
    switch (header.kind) {
      case Kind::kReceive:
        Deliver(body);
        break;
      case Kind::kStall: {
        plugin.stalls.push_back(As<Stall>(body));
        std::stable_sort(plugin.stalls.begin(), plugin.stalls.end(),
                         [](const Stall& a, const Stall& b) { return a.begin_ns < b.begin_ns; });
        plugin.stall_timer.Set(plugin.stalls.front().begin_ns);
        break;
      }
      case Kind::kFlipBits: {
        plugin.flips.push_back(As<FlipBits>(body));
        std::stable_sort(plugin.flips.begin(), plugin.flips.end(),
                         [](const FlipBits& a, const FlipBits& b) { return a.at_ns < b.at_ns; });
        plugin.flip_timer.Set(plugin.flips.front().at_ns);
        break;
      }
      case Kind::kReadMemory: {
        const auto read = As<ReadMemory>(body);
        std::vector<std::uint8_t> bytes(std::min(read.size, kBodyBytesMax));
        ReadAsProcessor(plugin.cpu, read.address, bytes.data(), bytes.size());
        Send(Kind::kMemory, bytes.data(), bytes.size());
        break;
      }
      case Kind::kDumpState:
        Send(Kind::kState, DumpState(plugin.cpu));
        break;
      case Kind::kBreak:
        plugin.break_timer.Set(As<Break>(body).at_ns);
        break;
      case Kind::kWriteCode: {
        const auto code = As<WriteCode>(body);
        address_space_write_rom(cpu_get_address_space(plugin.cpu, 0), code.address, 0, &code.word, 4);
        break;
      }
      case Kind::kReadSent:
        Send(Kind::kSent, &plugin.sent, sizeof(plugin.sent));
        break;
      case Kind::kRun:
        plugin.horizon.Set(As<Run>(body).until_ns);
        return;
      default:
        Die("an unknown command: harness and plug-in of different builds?");
    }
  }
}

void Stop() {
  for (Uart& uart : plugin.uarts) {
    SendUnsent(uart);
    if (uart.receiver != nullptr) SendRegisters(uart);
  }
  const Stopped stopped{Now(), plugin.last_slept_ns, plugin.locked_up};
  Send(Kind::kStopped, &stopped, sizeof(stopped));
  TakeCommands();
}

void OnHorizon(void* /*opaque*/) { Stop(); }

// QEMU aborts when the processor locks up. The harness reads its state before that.
void OnAbort(int /*signal*/) {
  if (!plugin.begun || pthread_equal(pthread_self(), plugin.cpu_thread) == 0) return;
  plugin.locked_up = true;
  Stop();
}

// In place of the null character device's: a USART sends.
int OnTransmit(void* chardev, const std::uint8_t* bytes, int count) {
  for (std::size_t i = 0; i < plugin.chardevs.size(); ++i)
    if (plugin.chardevs[i] == chardev) plugin.sent.count[i] += static_cast<std::uint64_t>(count);
  for (Uart& uart : plugin.uarts) {
    if (uart.chardev != chardev || !plugin.begun) continue;
    SendRegisters(uart);
    for (int i = 0; i < count; ++i) uart.unsent.push_back({Now(), uart.usart, bytes[i]});
    const bool barrier = uart.usart == Usart::kMain &&
                         std::find(bytes, bytes + count, plugin.arguments.barrier) != bytes + count;
    const bool line_end = uart.usart == Usart::kConsole && bytes[count - 1] == '\n';
    if (barrier) {
      Stop();
    } else if (line_end || uart.unsent.size() >= kUnsentBytesMax) {
      SendUnsent(uart);
      Flush();
    }
  }
  return count;
}

// --- the emulator's callbacks ---

// The processor sleeps: on to the next timer, again and again until an interrupt wakes it. QEMU would do so by
// itself with sleep=off, but 7.2 then runs the SysTick twice.
void SleepWork(void* cpu, RunOnCpuData data) {
  plugin.last_slept_ns = Now();
  const std::int64_t next = qemu_clock_deadline_ns_all(kClockVirtual, kAnyAttribute);
  if (!all_cpu_threads_idle() || next < 0) return;
  Advance(next);
  async_run_on_cpu(cpu, SleepWork, data);
  qemu_clock_run_timers(kClockVirtual);
}

void OnWfi(unsigned /*vcpu*/, void* /*opaque*/) { async_run_on_cpu(qemu_get_cpu(0), SleepWork, {}); }

// Before the first instruction. The clocks do not run yet when the processor is made, and virtual time may not be
// read in an instruction's callback: hence as work of the processor's thread.
void Begin(void* cpu, RunOnCpuData /*data*/) {
  plugin.cpu = cpu;
  plugin.cpu_thread = pthread_self();
  for (std::size_t i = 0; i < plugin.chardevs.size(); ++i)
    plugin.chardevs[i] = qemu_chr_find(("usart" + std::to_string(i + 1)).c_str());
  std::int16_t shift = 0;
  std::memcpy(&shift, timers_state + kIcountShiftOffset, sizeof(shift));
  if (shift != 3) Die("-icount shift=3 is not where it should be: another build of QEMU 7.2?");

  plugin.horizon.Init(OnHorizon, nullptr);
  plugin.stall_timer.Init(OnStallTimer, nullptr);
  plugin.flip_timer.Init(OnFlipTimer, nullptr);
  plugin.break_timer.Init(OnBreakTimer, nullptr);
  plugin.watchdog.Init(OnWatchdog);
  plugin.reset_flags.Init();
  qemu_register_reset(OnReset, nullptr);
  void* nvic = object_resolve_path("nvic", nullptr);
  if (nvic == nullptr) Die("the machine has no NVIC where one should be");
  qdev_connect_gpio_out_named(nvic, "SYSRESETREQ", 0, qemu_allocate_irq(OnResetRequest, nullptr, 0));
  for (std::size_t i = 0; i < plugin.uarts.size(); ++i) {
    if (plugin.arguments.usart_numbers[i] == 0) continue;
    Uart& uart = plugin.uarts[i];
    uart.usart = static_cast<Usart>(i);
    const std::string id = "usart" + std::to_string(plugin.arguments.usart_numbers[i]);
    uart.chardev = qemu_chr_find(id.c_str());
    if (uart.chardev == nullptr) Die("a character device is missing");
    void* chardev_class = object_get_class(uart.chardev);
    if (std::string_view(object_class_get_name(chardev_class)) != "chardev-null")
      Die("a USART's character device is not of the kind null");
    int (*const write)(void*, const std::uint8_t*, int) = OnTransmit;
    std::memcpy(static_cast<std::uint8_t*>(chardev_class) + kChrWriteOffset, &write, sizeof(write));
    uart.timer.Init(OnReceiveTimer, &uart);
    uart.receiver = new UsartReceiver;
    if (!uart.receiver->Init(plugin.arguments.usart_numbers[i], uart.chardev))
      Die("the machine has no such USART");
  }
  const Hello hello{kProtocolVersion};
  Send(Kind::kHello, &hello, sizeof(hello));
  plugin.begun = true;
  TakeCommands();
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
  for (std::size_t i = 0; i < count; ++i) {
    qemu_plugin_insn* instruction = qemu_plugin_tb_get_insn(block, i);
    std::uint16_t code = 0;
    if (qemu_plugin_insn_size(instruction) != sizeof(code)) continue;
    std::memcpy(&code, qemu_plugin_insn_data(instruction), sizeof(code));
    if (code == kWfi) qemu_plugin_register_vcpu_insn_exec_cb(instruction, OnWfi, 0, nullptr);
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
  std::signal(SIGABRT, OnAbort);
  qemu_plugin_register_vcpu_tb_trans_cb(id, OnTranslate);
  return 0;
}

}  // extern "C"
