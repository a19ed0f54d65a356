// The messages between the harness and the plug-in inside the emulator, over a unix stream socket: a header
// and a body, both plain structs in this machine's byte order (both ends are on it).
//
// The plug-in sends first (kHello), then they take turns. The harness sends any number of commands and then
// kRun. The virtual processor runs until the barrier byte (the one that ends a frame) has been transmitted, and for as
// long after it as there is no answer yet, or until the granted time is reached. The plug-in sends what happened meanwhile and then kStopped, and virtual time
// stops until the next kRun. Times are nanoseconds of the emulator's virtual clock, which begins at power-on.
#pragma once

#include <atomic>
#include <cstdint>
#include <limits>
#include <optional>

namespace tiltproof::harness::lockstep {

inline constexpr std::uint32_t kProtocolVersion = 12;
inline constexpr std::uint32_t kBodyBytesMax = 1 << 20;

enum class Kind : std::uint32_t {
  // To the plug-in.
  kReceive,      // ReceivedByte[]
  kStall,        // Stall
  kDelayTask,    // DelayTask
  kFlipBits,     // FlipBits
  kReadMemory,   // ReadMemory; answered with kMemory
  kReadUsarts,   // answered with kUsarts
  kWriteCode,    // WriteCode
  kDumpState,    // answered with kState
  kRun,          // Run
  kBreak,        // Break
  kWatchStacks,  // WatchedStack[], before the first kRun
  kReadStacks,   // answered with kStacks
  // From the plug-in.
  kHello,        // Hello
  kTransmit,     // TransmittedByte[]
  kUsart,        // UsartRegisters
  kEvent,        // Event
  kMemory,       // the bytes
  kState,        // text: the processor's registers
  kUsarts,       // UsartStates
  kStacks,       // the lowest address in use so far in each watched stack (uint32); its end: none
  kLastWords,    // LastWords, then the processor's registers as text
  kBrokenLimit,  // text: what no chip does, and the firmware has asked for
  kStopped,      // Stopped
};

struct Header {
  Kind kind;
  std::uint32_t body_bytes;
};

// The USARTs that are connected to the harness: those of the main and the reference line, the console's, and those of the
// lines to other boards.
enum class Usart : std::uint8_t { kMain, kReference, kConsole, kFirstLine };
inline constexpr int kLineUsartsMax = 3;
inline constexpr int kConnectedUsartCount = static_cast<int>(Usart::kFirstLine) + kLineUsartsMax;

// Condition in which the receiver gets a byte.
enum class Mark : std::uint8_t { kNone, kOverrun, kFraming, kNoise, kParity };

struct ReceivedByte {
  std::int64_t arrival_ns;  // of its stop bit; not decreasing on a line
  std::uint16_t word;  // the bits between start bit and stop bit, lowest first, the parity bit among them
  Usart usart;
  Mark mark;
  // On a line without byte time: the byte waits until the previous one has been read.
  bool waits;
};

enum class ResetCause : std::uint32_t { kNone, kPin, kWatchdog, kSoftware };

// From `begin_ns` to `end_ns` the processor executes nothing while time and peripherals continue. Unless
// `reset` is kNone it is reset at the begin, and held until the end. A stall without end, kNever, ends with
// the next reset, most likely the watchdog's.
struct Stall {
  static constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();
  std::int64_t begin_ns, end_ns;
  ResetCause reset;
  std::uint32_t fault;  // returned with its event
};

// From `begin_ns` to `end_ns`, every `every_ns`, other work takes the processor for `delay_ns`: it executes nothing
// but handlers of interrupts.
struct DelayTask {
  std::int64_t begin_ns, end_ns;
  std::int64_t delay_ns, every_ns;
  std::uint32_t fault;  // returned with each event
};

struct FlipBits {
  static constexpr std::uint32_t kBitsMax = 64;
  std::int64_t at_ns;
  std::uint32_t fault;
  std::uint32_t count;
  struct Bit {
    std::uint32_t address, bit;
  } bits[kBitsMax];
};

// As the processor sees it, with its own peripherals.
struct ReadMemory {
  std::uint32_t address, size;
};

// Over what is in flash, too: a constant before the first instruction, or code when the flight is over.
struct WriteCode {
  std::uint32_t address, word;
};

// State of each USART, connected or not, USART1 first: the bytes that it has sent since power-on, and its input clock.
// The clock is 0 when RCC gives it none.
struct UsartStates {
  std::uint64_t sent_count[6];
  std::uint32_t clock_hz[6];
};

// State of a firmware that is about to be reset by itself or its watchdog. A turn ends early after this many of them.
inline constexpr int kResetsPerTurnMax = 100;
struct LastWords {
  std::uint32_t faults[5];  // CFSR, HFSR, DFSR, MMFAR, BFAR
  std::uint32_t stack[128];
};

// A stack of the firmware, which grows from `end` down to `begin`. They do not overlap.
inline constexpr std::uint32_t kWatchedStacksMax = 64;
struct WatchedStack {
  std::uint32_t begin, end;
};

struct Run {
  std::int64_t until_ns;
  // Nothing that answers a frame reaches the firmware sooner than this after the firmware has given the frame's last
  // byte, the barrier, to its transmitter.
  std::int64_t answer_after_ns;
  // The same of every byte that it gives to the transmitter of a line to another board.
  std::int64_t line_answer_after_ns;
  // The processor stops when the emulator has computed for this long (processor time). 0: no limit.
  std::int64_t processor_ns;
};

// The machine stops at that time, until a debugger lets it go on.
struct Break {
  std::int64_t at_ns;
};

struct Hello {
  std::uint32_t protocol_version;
};

struct TransmittedByte {
  std::int64_t at_ns;  // when the processor gave it to the transmitter
  Usart usart;
  std::uint8_t byte;
};

// The registers of a USART that determine its rate and its characters. Sent when they have changed, before the bytes that it
// then sends, and at the latest when the processor stops.
struct UsartRegisters {
  Usart usart;
  std::uint32_t brr, cr1, cr2, cr3;
  std::uint32_t clock_hz;  // that it divides
  friend bool operator==(const UsartRegisters&, const UsartRegisters&) = default;
};

enum class EventKind : std::uint32_t {
  kReset,        // value: ResetCause
  kStallBegins,  // value: the fault
  kStallEnds,    // the processor runs again
  kTaskDelayed,  // value: the fault
  kBitFlipped,   // value: the fault; address, before, after
  kOverrun,      // value: the Usart; a byte came before the previous one was read
  kUnmodelled,  // value: PC; address, before: 1 for a write; the first access to a page that no block is modelled in
  // value: PC; address: the stack pointer; before: the watched stack, by its number, that it has left at its lower end. Once
  // for each stack.
  kStackOverflow,
};

struct Event {
  std::int64_t at_ns;
  EventKind kind;
  std::uint32_t value, address;
  std::uint8_t before, after;
};

struct Stopped {
  std::int64_t at_ns;
  std::int64_t last_slept_ns;  // when the processor last slept (WFI) or was stopped
  // Until then the processor sleeps and nothing happens on the board, unless the harness sends something. at_ns: it may act at once.
  std::int64_t sleeps_until_ns;
  // It is past all help (ARMv7-M ARM, section B1.5.15). Only its state can be read.
  bool locked_up;
};

// By the clock on the wall nothing is exchanged. The plug-in writes here, in memory that both have mapped, what the
// harness cannot see from outside. By the number of the USART, USART1 first.
struct RealtimeBoard {
  std::atomic<std::uint64_t> sent_count[6];
  std::atomic<std::int64_t> sent_at_ns[6];  // the last byte, by CLOCK_MONOTONIC
  std::atomic<std::uint32_t> clock_hz[6];   // 0: RCC gives it none
  // SysTicks that the firmware never saw since the processor's thread did not run from the tick before to this one:
  // how many, and the last of them, by CLOCK_MONOTONIC; number n is in place n % kLostTicksKept.
  static constexpr std::uint64_t kLostTicksKept = 64;
  struct LostTick {
    std::atomic<std::int64_t> before_ns, at_ns;
  };
  std::atomic<std::uint64_t> lost_tick_count;
  LostTick lost_ticks[kLostTicksKept];
  std::atomic<bool> locked_up;  // then this is complete:
  LastWords last_words;
  // First accesses to what is not modelled, as kUnmodelled says; `at_ns` by CLOCK_MONOTONIC.
  static constexpr std::uint32_t kUnmodelledKept = 64;
  struct Unmodelled {
    std::int64_t at_ns;
    std::uint32_t address, pc;
    bool is_write;
  };
  std::atomic<std::uint32_t> unmodelled_count;  // so many of these are complete:
  Unmodelled unmodelled[kUnmodelledKept];
  static constexpr std::uint32_t kLimitTextBytes = 256;
  std::atomic<bool> broken_limit;  // then this is complete: as kBrokenLimit says
  char limit_text[kLimitTextBytes];
};

// Executions of each block of code, up to 255: by the address of its first instruction, of two bytes at
// least. In memory that both have mapped, when the harness wants to know.
struct BlockCounts {
  static constexpr std::uint32_t kFlash = 0x0800'0000, kFlashBytes = 1 << 20;
  static constexpr std::uint32_t kRam = 0x2000'0000, kRamBytes = 192 << 10;
  static constexpr std::uint32_t kPlacesCount = (kFlashBytes + kRamBytes) / 2;
  // None: there is no code. The flash is at 0, too.
  static constexpr std::optional<std::uint32_t> PlaceOf(std::uint32_t address) {
    if (address < kFlashBytes) return address / 2;
    if (address - kFlash < kFlashBytes) return (address - kFlash) / 2;
    if (address - kRam < kRamBytes) return (kFlashBytes + address - kRam) / 2;
    return std::nullopt;
  }
  std::uint8_t counts[kPlacesCount];
};

}  // namespace tiltproof::harness::lockstep
