// QEMU as a board in real time: started, watched, paused, reset, its memory changed. The plug-in adds what its chip lacks,
// as in lockstep, and nothing else.
//
//   EmulatedBoard board(services, scenario, {.image = "executive-paper.elf", ...}, wiring, callbacks);
//   board.PowerOn();  // it does not run before
//   board.BeginStall(); ... board.EndStall();
//
// Its USARTs are connected to the sockets of link and line nodes; the output of its console and of QEMU is kept. It runs
// by the machine's clock, with the priority of an ordinary program. When the machine is busy with other
// programs, this is recorded as this node's lateness.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "harness/emulator/bit_flipper.h"
#include "harness/emulator/diagnosis/cpu_state.h"
#include "harness/emulator/diagnosis/post_mortem.h"
#include "harness/emulator/diagnosis/unmodelled_blocks.h"
#include "harness/emulator/emulator_process.h"
#include "harness/emulator/lockstep_protocol.h"
#include "harness/emulator/lost_tick_log.h"
#include "harness/emulator/qmp_client.h"
#include "harness/node/cpu_wait_watch.h"
#include "harness/node/firmware_process.h"
#include "harness/process/hang_watch.h"
#include "harness/process/one_processor.h"
#include "link/unix_socket.h"

namespace tiltproof::harness {

struct BoardWiring {
  std::string main_port, reference_port;  // as the link node names them: unix:@NAME
  std::vector<std::string> line_ports =
      {};                 // of lines to other boards, as their nodes name them, in the order of the spec's
  bool debugger = false;  // needed by Flip()
};

class EmulatedBoard {
 public:
  struct Callbacks {
    // The processor was reset: by the firmware itself, or by Reset().
    std::function<void(bool by_firmware)> reset;
    // The board is gone, with the reason; called once. kFirmwareCrashed when the firmware caused it,
    // otherwise kNodeLost.
    std::function<void(EndReason reason, const std::string& text)> lost;
    // A time as a user reads it: in the flight's time, once there is one.
    std::function<std::string(BootTime)> time_text;
  };

  // Starts QEMU, with the processor held. Throws std::runtime_error when there is none.
  EmulatedBoard(NodeServices& services, const Scenario& scenario, const EmulatorSpec& spec,
                const BoardWiring& wiring, Callbacks callbacks);
  EmulatedBoard(const EmulatedBoard&) = delete;
  EmulatedBoard& operator=(const EmulatedBoard&) = delete;
  ~EmulatedBoard();

  void PowerOn();

  // The processor executes nothing, while its clock and everything timed by it continue.
  void BeginStall();
  void EndStall();
  // The processor and its peripherals are reset, and held until the end.
  void BeginReset();
  void EndReset();
  void Flip(std::vector<MemoryBit> bits, BitFlipper::Done done);
  // Reads words of memory while it runs; `done` is not called when they cannot be read.
  void ReadWords(std::uint32_t address, int count,
                 std::function<void(const std::vector<std::uint32_t>&)> done);

  // Checks for an emulator that does not answer, and for a firmware that hangs. Called every 50 ms. `started`: the
  // flight has begun.
  void Watch(bool started);
  // Notes as disturbance of the board what the plug-in has told of; as lateness, too, where it is long. Part of Watch.
  void NoteLostTicks();
  // Stops it for good, and tells what it was doing: of a firmware that has not started, and of one that is in the handler
  // of a fault; "" otherwise.
  std::string State(bool started);
  // The blocks that the firmware uses and the board does not model, each with its first access. Reads the image: for the
  // end of the flight.
  std::vector<std::pair<BootTime, UnmodelledBlocks::Block>> Unmodelled() const;
  // Lines printed since the last call; with `last`, including the incomplete last line.
  std::vector<FirmwareProcess::OutputLine> TakeLines(bool last = false);

 private:
  // Findings about a firmware that makes no progress.
  struct Examined {
    Findings found;
    std::string usarts;
  };

  void OnEnded(const std::string& how);
  void WatchFirmware(bool started);
  void Suspect(const CpuState& state, bool started);
  // By a thread of its own: it may take a second on a busy machine.
  void Examine(Condition condition, bool started);
  void Tell(const Examined& examined, bool started);
  void Keep(const Findings& found);
  lockstep::UsartStates UsartStates() const;
  BootTime When(std::chrono::steady_clock::time_point time) const;
  void Lose(EndReason reason, const std::string& text);
  void Resume();
  void Continue();

  NodeServices& services_;
  const Scenario& scenario_;
  Callbacks callbacks_;
  std::optional<FirmwareProcess> process_;
  std::optional<QmpClient> qmp_;
  link::OwnedDescriptor debugger_port_;
  std::optional<BitFlipper> debugger_;  // of a copy of that
  struct Unmap {
    void operator()(lockstep::RealtimeBoard* board) const;
  };
  std::unique_ptr<lockstep::RealtimeBoard, Unmap> memory_;  // the plug-in has mapped it, too
  std::optional<LostTickLog> lost_ticks_;
  std::vector<FirmwareProcess::OutputLine> lines_;
  std::string fatal_, last_error_;  // what QEMU said before its end
  std::string last_words_;          // all of that, with the registers after a crash
  EmulatorSpec spec_;
  int stalls_count_ = 0, resets_count_ = 0;  // that last
  bool paused_ = false;                      // the whole of QEMU, by a signal
  std::chrono::steady_clock::time_point paused_since_;
  bool halted_ = false;  // the processor and its clock, by QEMU
  std::chrono::steady_clock::time_point silent_for_good_reason_;
  std::string socket_trouble_;
  std::chrono::steady_clock::time_point socket_trouble_since_;
  bool lost_ = false;
  std::optional<OneProcessor> processor_;
  std::optional<CpuWaitWatch> wait_watch_;
  std::chrono::steady_clock::time_point power_on_;
  std::optional<HangWatch> hang_watch_;
  int in_handler_count_ = 0;  // seen in the handler of a fault so often, one after another
  bool examined_ = false;
  std::shared_ptr<char> alive_ = std::make_shared<char>();
  std::jthread examiner_;
};

}  // namespace tiltproof::harness
