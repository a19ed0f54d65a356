// One client on the vehicle and its line, as the lockstep conductor sees them: when it acts next, what it is given,
// what it leaves behind. A flight has one or several.
//
//   ClientChannel channel(scenario, 0, line, [] {});
//   channel.PowerOn(make_client);
//   channel.Run(now, horizon);                 // bytes that have arrived, and the time that has come
//   channel.Finish(origin, log);
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
#include "harness/run/line.h"
#include "harness/run/reference_talk.h"
#include "harness/run/run_log.h"
#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

// What the scenario's faults do to a client's board.
std::vector<faults::DeviceCommand> ClientCommands(const Scenario& scenario, std::size_t client);

class ClientChannel {
 public:
  // `client`: its place in the scenario.
  // `on_news` is called when a fault may have acted, before anything more passes.
  ClientChannel(const Scenario& scenario, std::size_t client, Line& line, std::function<void()> on_news);
  // The client holds its address.
  ClientChannel(const ClientChannel&) = delete;
  ClientChannel& operator=(const ClientChannel&) = delete;

  Line& line() const { return line_; }
  std::size_t index() const { return index_; }
  bool exists() const { return client_ != nullptr; }

  // `make` makes the client once its host functions exist.
  void PowerOn(const std::function<std::unique_ptr<Client>(std::size_t client, ClientHost)>& make);

  // When something happens here next: bytes arrive at either end, or the client's time has come.
  BootTime Next() const;
  // A turn of the conductor begins. Throws FirmwareTrouble when the client lets no time pass, or when more is sent on its
  // line than that carries.
  void BeginTurn(BootTime now);
  // t = 0 is known: the client is told what the faults on its board do, and when.
  void Command(Origin origin);
  // The client gets what has arrived, and runs: a library at `now`, an emulator up to `horizon` at most.
  void Run(BootTime now, BootTime horizon);

  // Of the faults of the line, the receiver and the board: what others wait for, and what they wait for themselves.
  std::vector<faults::News> TakeNews();
  void Hear(std::span<const faults::News> news);

  // What it leaves behind. When t = 0 never came, it has the time since power-on.
  void Finish(Origin origin, RunLog& log);
  // Asks the client how it fared, unless it may be in the middle of a call. Throws FirmwareTrouble.
  void AskStatus(RunLog& log);
  std::unique_ptr<Client> TakeClient() { return std::move(client_); }

 private:
  bool Deliver(BootTime until);
  void OnEvent(const DeviceEvent& event);

  const Scenario& scenario_;
  std::size_t index_;
  Line& line_;
  std::function<void()> on_news_;
  std::unique_ptr<Client> client_;

  // Faults at the client's receiver, and what was carried out of those on its board.
  faults::FaultSchedule faults_;
  std::vector<faults::ReceiveMark> marks_;
  std::vector<DeviceEvent> events_;
  std::int64_t receive_overruns_count_ = 0;
  Origin origin_;
  bool commanded_ = false;  // in this turn

  BootTime now_ns_;   // of the turn under way
  BootTime wake_ns_;  // until when the client waits
  BootTime period_begin_ns_;
  int wakes_count_ = 0;  // since then

  std::vector<std::pair<BootTime, std::string>> firmware_lines_;  // what the firmware logged
  std::size_t firmware_log_bytes_ = 0;
  ReferenceTalk reference_talk_;
};

}  // namespace tiltproof::harness
