// All that the plug-in knows, in one place, and its events for the harness.
//
//   plugin.horizon.Set(12'000'000);
//   SendEvent(EventKind::kStallEnds, 0);
#pragma once

#include <pthread.h>

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "harness/emulator/lockstep_protocol.h"
#include "harness/emulator/plugin/arguments.h"
#include "harness/emulator/plugin/character_device.h"
#include "harness/emulator/plugin/chip.h"
#include "harness/emulator/plugin/harness_socket.h"
#include "harness/emulator/plugin/lost_ticks.h"
#include "harness/emulator/plugin/parts.h"
#include "harness/emulator/plugin/realtime_board.h"
#include "harness/emulator/plugin/turn_limit.h"
#include "harness/emulator/plugin/turn_sleep.h"
#include "link/frame_cutter.h"

namespace tiltproof::qemu {

using namespace harness::lockstep;  // NOLINT: the protocol's names

// One of the chip's USARTs, on a line of the harness.
struct Uart {
  UsartUnit* unit = nullptr;
  Usart usart{};
  std::deque<ReceivedByte> queue;  // on their way to the firmware
  Timer timer;
  std::vector<TransmittedByte> unsent;  // not yet told
  UsartRegisters told{};                // of its registers
  // Where frames that are sent end; null on other lines than the main one.
  std::unique_ptr<link::FrameCutter> frames;
};

struct Plugin {
  Arguments arguments;
  HarnessSocket socket;
  ResetCause pending_cause = ResetCause::kNone;  // of the reset that was asked for
  bool begun = false;
  std::array<Uart, kConnectedUsartCount> uarts;
  UsartStates usarts{};
  void* cpu = nullptr;
  pthread_t cpu_thread{};
  bool locked_up = false;
  Run run{};                     // as granted
  void (*end_turn)() = nullptr;  // before its horizon
  int turn_resets_count = 0;     // of the firmware, by itself
  TurnLimit turn_limit;
  TurnSleep turn_sleep;
  Timer horizon;
  std::deque<Stall> stalls;  // by begin
  Timer stall_timer;
  std::int64_t stalled_until = 0;
  bool hangs = false;             // until a reset
  bool holding = false;           // StallWork is under way
  Stall stall{};                  // under way, or the last
  std::vector<DelayTask> delays;  // `begin_ns`: the next time
  Timer delay_timer;
  std::int64_t task_held_until = 0;
  bool holding_task = false;     // until then
  bool task_may_return = false;  // a handler runs meanwhile
  bool task_goes_on = false;     // for one block
  bool watches_blocks = false;   // each block that is translated calls OnBlock
  void* interrupt_controller = nullptr;
  std::deque<FlipBits> flips;
  Timer flip_timer;
  Timer break_timer;
  std::int64_t last_slept_ns = 0;  // or was made to stand still
  Chip chip;
  std::array<CharacterDevice, UsartUnit::kCount> character_devices;  // in real time
  RealtimeNotes notes;                                               // in real time
  LostTicks lost_ticks;                                              // in real time
};
inline Plugin& plugin = *new Plugin;

inline void Send(Kind kind, const std::string& body) { plugin.socket.Send(kind, body.data(), body.size()); }

inline void SendEvent(EventKind kind, std::uint32_t value, std::uint32_t address = 0, std::uint8_t before = 0,
                      std::uint8_t after = 0) {
  const Event event{Now(), kind, value, address, before, after};
  plugin.socket.Send(Kind::kEvent, &event, sizeof(event));
}

}  // namespace tiltproof::qemu
