// One client on the vehicle and its line, as the lockstep conductor sees them: when the client acts next,
// what it receives, what it records. A flight has one channel or several.
//
//   ClientChannel channel(scenario, 0, line, sink,
//                         {.on_news = [] {}, .before_ahead = [](const auto&, BootTime) {}});
//   channel.PowerOn(make_client);
//   channel.Run(now, horizon);                 // bytes that have arrived, and the time that has come
//   channel.Finish(origin);
//
// Times are boot time.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "faults/schedule.h"
#include "harness/client/client.h"
#include "harness/run/board_line.h"
#include "harness/run/future.h"
#include "harness/run/line.h"
#include "harness/run/record_stream.h"
#include "harness/run/reference_talk.h"
#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

// The client's end of a line to another one.
struct LinePort {
  BoardLine* line = nullptr;
  std::size_t end = 0;
};

// Commands of the scenario's faults to a client's board.
std::vector<faults::DeviceCommand> ClientCommands(const Scenario& scenario, std::size_t client);

class ClientChannel {
 public:
  struct Callbacks {
    std::function<void()> on_news;  // a fault may have acted; before anything else passes
    // A client that runs ahead of the plant is about to send: the plant's rows until then know nothing of it.
    std::function<void(const ClientChannel&, BootTime at)> before_ahead;
  };

  // `client`: its place in the scenario. `sink`: gets the records of the client; the lines have their own. `ports`: its
  // UARTs from 2 on. `use`: of its schedule of faults.
  ClientChannel(const Scenario& scenario, std::size_t client, Line& line, RecordSink& sink,
                Callbacks callbacks, std::vector<LinePort> ports = {}, const faults::ScheduleUse& use = {});
  // Not movable: the client holds its address.
  ClientChannel(const ClientChannel&) = delete;
  ClientChannel& operator=(const ClientChannel&) = delete;

  Line& line() const { return line_; }
  // The client has lines to others.
  bool has_ports() const { return !ports_.empty(); }
  std::size_t index() const { return index_; }
  bool exists() const { return client_ != nullptr; }
  // It crashed or hung, and the flight goes on without it: only Run() and what concerns its line is called from then on.
  void Lose(const FirmwareTrouble& trouble);
  bool is_lost() const { return loss_.has_value(); }

  // `make` makes the client once its host functions exist.
  void PowerOn(const std::function<std::unique_ptr<Client>(std::size_t client, ClientHost)>& make);

  // The next time at which something happens here: bytes arrive at either end, or the client's wake-up time
  // is reached.
  BootTime Next() const;
  // Begins a turn of the conductor. Throws FirmwareTrouble when the client does not let time pass, or when
  // more bytes are sent on its line than the line can carry.
  void BeginTurn(BootTime now);
  // Called once t = 0 is known: tells the client what the faults on its board do, and when.
  void Command(Origin origin);
  // Called before the flight: in this future of it, the faults that are cut give the client no commands after their end.
  void CutCommands(const Future& future);
  // Gives the client the bytes that have arrived and runs it: a library at `now`, an emulator up to `horizon`
  // at most.
  void Run(BootTime now, BootTime horizon);

  // One more fault of the scenario, by its place there, at the receiver or on the board. Only in a channel that grows.
  void Add(const faults::FaultSpec& fault, std::size_t place);

  // The open fault of the channel's use (FaultSchedule::Give), on the receiver's side.
  void Give(const faults::FaultSpec& fault) { faults_.Give(fault); }

  // Events of the faults on the line, the receiver and the board: what other faults wait for, and what these
  // faults wait for.
  std::vector<faults::FaultEvent> PollEvents();
  void Hear(std::span<const faults::FaultEvent> events);

  // Writes what remains of the channel's records. Without t = 0 their times count from power-on.
  void Finish(Origin origin);
  // The client's values for the trace, at its present time.
  ClientSample Sample() { return client_->Sample(); }
  // Asks the client for its report, unless it may be in the middle of a call. Throws FirmwareTrouble.
  void AskStatus();
  std::unique_ptr<Client> TakeClient() { return std::move(client_); }

 private:
  bool Deliver(BootTime until);
  BootTime Transmit(Uart uart, BootTime now, std::span<const std::uint8_t> bytes);
  void OnEvent(const DeviceEvent& event);

  const Scenario& scenario_;
  std::size_t index_;
  Line& line_;
  std::vector<LinePort> ports_;
  Callbacks callbacks_;
  std::unique_ptr<Client> client_;

  // Faults at the client's receiver, and the faults on its board that were carried out.
  faults::FaultSchedule faults_;
  std::vector<faults::ReceiveMark> marks_;
  PartRecords records_;
  record::ClientEnd totals_;
  std::int64_t receive_overruns_count_ = 0;
  Origin origin_;
  std::vector<faults::DeviceCommand> commands_;
  bool commanded_ = false;  // in this turn

  BootTime now_ns_;   // of the turn under way
  BootTime wake_ns_;  // until when the client waits
  BootTime period_begin_ns_;
  int wakes_count_ = 0;  // since then

  std::optional<ClientLoss> loss_;
  BootTime lost_ns_;

  std::size_t firmware_log_bytes_ = 0;
  ReferenceTalk reference_talk_;
};

}  // namespace tiltproof::harness
