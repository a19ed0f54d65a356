// Records of a real-time flight, on their way from the nodes to the harness: converts LineLog and PlantLog to
// log messages on the bus, and builds a RunLog from them.
//
//   LogPublisher logs(bus, scenario, run_id, "link", harness);  // in the node
//   logs.Write(line.TakeLog(now), origin, counts);              // every 50 ms
//   logs.Close(totals);                                         // its last message
//
//   LogCollector collector(bus, members, scenario, vehicle, run_id, on_data);  // in the harness
//   collector.Drain(flown_ns);  ...  if (collector.Complete("link")) ...
//   RunLog log = collector.Take(end_ns);
//
// Nothing is lost on the way: messages are numbered, and the node's closing report says how many there are.
// The collector stops listening to a node that sends more than a flight can hold.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "harness/client/client.h"
#include "harness/dds/bus.h"
#include "harness/run/line.h"
#include "harness/run/plant_server.h"
#include "harness/run/realtime/firmware_use.h"
#include "harness/run/run_log.h"
#include "harness/run/supervisor_states.h"
#include "harness/scenario/scenario.h"
#include "link/fields.h"

namespace tiltproof::harness {

// Records when this node's own work was later than allowed.
struct Lateness {
  static constexpr std::size_t kSpansMax = 10'000;

  void Note(BootTime due_ns, BootTime done_ns) {
    if (done_ns - due_ns > late_after_ns) Add(spans, due_ns, done_ns);
  }
  // The board's clock may have lost time then (RunLog::board_disturbed).
  void NoteDisturbed(BootTime begin_ns, BootTime end_ns) { Add(disturbed, begin_ns, end_ns); }

  TimeNs late_after_ns = kNever;  // Scenario::late_after_ns(), once a flight is prepared
  std::vector<NodeLateSpan> spans = {}, disturbed = {};
  Origin origin = {};  // by the node's clock
  TILTPROOF_FIELDS(late_after_ns, spans, disturbed, origin)

 private:
  // Beyond kSpansMax the last span becomes one long span: no part gets the blame for what happens in it.
  static void Add(std::vector<NodeLateSpan>& to, BootTime begin_ns, BootTime end_ns) {
    if (to.size() == kSpansMax) {
      to.back().end_ns = std::max(to.back().end_ns, end_ns);
    } else {
      to.push_back({begin_ns, end_ns});
    }
  }
};

// A firmware whose supervisor never rests must not make a message that the bus cannot carry.
inline constexpr std::size_t kSupervisorChangesMax = 20'000;

// Totals that a node knows only at the end.
struct NodeTotals {
  Lateness lateness;
  std::optional<LineLog> line;  // of the logs only the totals cross the bus
  std::optional<PlantLog> plant;
  std::optional<ClientStatus> client;
  std::vector<SupervisorChange> states;  // of the client's supervisor, the first kSupervisorChangesMax
  // One count per fault of the scenario, of the faults that this node carried out itself; empty when there
  // are none.
  std::vector<std::int64_t> activation_counts;
  std::vector<std::string> unmodelled_blocks;  // of the client's board (ClientLog)
  std::optional<FirmwareUse> firmware_use;     // of a program
  std::optional<FirmwareEnd> firmware_end;     // of a library that broke
  TILTPROOF_FIELDS(lateness, line, plant, client, states, activation_counts, unmodelled_blocks, firmware_use,
                   firmware_end)
};

// The link counters of a flight at one instant of its grid of control periods. The link node knows them, the
// rows of the plant show them.
struct CountsSample {
  TimeNs time_ns = 0;
  LineCounts counts{};
};

class LogPublisher {
 public:
  // `harness`: the participant that gathers the log. Nothing is sent before it listens.
  LogPublisher(dds::Bus& bus, const Scenario& scenario, std::string run_id, std::string node_id,
               const dds::Participant& harness);

  // Writes only the records.
  void Write(const LineLog& log, Origin origin, const std::vector<CountsSample>& counts);
  void Write(const PlantLog& log);
  void Write(const std::vector<faults::Activation>& activations);  // in simulation time
  // Sends only the first kFirmwareLogBytesMax bytes of the events of kind "firmware_log".
  void Write(const RunEvent& event);
  // Sends again what the bus did not accept. Called now and then.
  void Retry();
  // Sends the node's last message. Records in its logs are dropped: they have been written already.
  void Close(NodeTotals totals);

 private:
  bool IsHeard() const;
  using AnyMessage = std::variant<dds::SerialTap, dds::FaultActivation, dds::RunEvent, dds::TraceRows>;
  void Send(AnyMessage message);
  bool TrySend(const AnyMessage& message);
  // Splits whole rows into as many messages as needed; returns the last one, not sent yet.
  dds::TraceRows SendRows(std::span<const double> values, std::size_t column_count);
  template <class T>
  T Begin(std::int64_t& sequence) const {
    T message;
    message.run_id = run_id_;
    message.node_id = node_id_;
    message.sequence = ++sequence;
    return message;
  }

  const Scenario& scenario_;
  std::string run_id_, node_id_;
  dds::Participant harness_;
  std::size_t firmware_log_bytes_ = 0;
  dds::Publisher<dds::SerialTap> taps_;
  dds::Publisher<dds::FaultActivation> activations_;
  dds::Publisher<dds::RunEvent> events_;
  dds::Publisher<dds::TraceRows> rows_;
  dds::Publisher<dds::NodeReport> reports_;
  dds::NodeReport last_;            // the sequences so far
  std::deque<AnyMessage> waiting_;  // in order
  bool listened_ = false;
};

class LogCollector {
 public:
  // The bound on what one node may send: a fixed amount, and an amount for each second of the flight. A
  // well-behaved node sends below 0.2 MiB/s; a firmware that floods a line of 1 Mbaud with the shortest
  // frames makes the link node send 1.5 MiB/s. The fixed amount is for messages that a cut network held up,
  // and for a board that speaks long before t = 0.
  static constexpr std::int64_t kNodeBytesMax = std::int64_t{64} << 20;
  static constexpr std::int64_t kNodeBytesPerS = std::int64_t{4} << 20;

  // Collects the logs of the nodes in `members`. Faults may be added to `scenario` meanwhile.
  LogCollector(dds::Bus& bus, const dds::Circle& members, const Scenario& scenario,
               const VehicleSignals& vehicle, std::string run_id, const std::function<void()>& on_data);

  // Takes what has arrived. `flown_ns`: how long the flight has lasted.
  void Drain(TimeNs flown_ns);
  // Names the node that sent more than the bound, and the bound; empty when none did.
  const std::string& overfull() const { return overfull_; }
  // The node's report is here, and every message that it counts.
  bool Complete(const std::string& node_id) const;
  // The messages that are missing from a node's log, for a person; empty when nothing is missing.
  std::string Missing(const std::string& node_id) const;
  // The flight as far as the logs tell. The caller fills in end_reason and what only the harness knows.
  RunLog Take(TimeNs end_ns);

 private:
  struct Report {
    dds::NodeReport report;
    NodeTotals totals;
  };
  // Rows that belong to one instant may come in either order.
  struct Row {
    std::vector<double> plant, link;
  };
  // True if the message belongs to this run and its node has stayed within the bound so far.
  template <class T>
  bool Accepts(const T& message);
  void AddInjected();
  // Nullopt for a fault that the scenario does not have.
  std::optional<faults::Activation> FromMessage(dds::FaultActivation&& message) const;

  const Scenario& scenario_;
  TraceLayout layout_;
  std::string run_id_;
  dds::Subscriber<dds::SerialTap> taps_;
  dds::Subscriber<dds::FaultActivation> activations_;
  dds::Subscriber<dds::RunEvent> events_;
  dds::Subscriber<dds::TraceRows> rows_;
  dds::Subscriber<dds::NodeReport> report_messages_;

  RunLog log_;
  std::map<double, Row> rows_by_time_;
  std::map<std::string, Report> reports_;
  TimeNs flown_ns_ = 0;
  std::map<std::string, std::int64_t> sent_bytes_;  // by node
  std::string overfull_;
};

// Sets the counts of lateness from log.harness_late, up to log.end_ns.
void CountLateness(RunLog& log, TimeNs period_ns);

}  // namespace tiltproof::harness
