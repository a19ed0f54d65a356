// Builds the log of a flight from the stream of its records, which its parts write in any order.
//
//   LogBuilder log(scenario, vehicle);
//   log.Write(record);
//   RunLog flown = log.Take();
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "harness/run/client_history.h"
#include "harness/run/record.h"
#include "harness/run/run_log.h"
#include "harness/run/supervisor_states.h"
#include "harness/run/trace.h"
#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

// Parts of a log that its reader may do without.
struct LogParts {
  bool bytes = true;   // of the lines, and the use of the protocol, which follows from them
  bool states = true;  // columns of what clients tell: supervisor_state, role
};

class LogBuilder final : public RecordSink {
 public:
  // Both must outlive it. Faults may be added to `scenario` meanwhile. `observer`: gets each record, too.
  LogBuilder(const Scenario& scenario, const VehicleSignals& vehicle, RecordSink* observer = nullptr,
             const LogParts& parts = {});

  // Ignores a record that does not fit the scenario: another process may write anything.
  void Write(const Record& record) override;
  // The log, complete but for what its reader adds. Call it once, after the last record.
  RunLog Take();

 private:
  void Add(const Record& of, const record::Row& row);
  void Add(const Record& of, const record::Bytes& bytes);
  void Add(const Record& of, const record::Counters& counters);
  void Add(const Record& of, const record::Event& event);
  void Add(const Record& of, const record::FirmwareText& line);
  void Add(const Record& of, const record::Accepted& accepted);
  void Add(const Record& of, const record::Reply& reply);
  void Add(const Record& of, const record::Answer& answer);
  void Add(const Record& of, const record::State& state);
  void Add(const Record& of, const record::Role& role);
  void Add(const Record& of, const record::Watched& watched);
  void Add(const Record& of, const faults::Activation& activation);
  void Add(const Record& of, const record::ActivationCounts& counts);
  void Add(const Record& of, const record::Late& late);
  void Add(const Record& of, const record::PlantEnd& end);
  void Add(const Record& of, const record::LineEnd& end);
  void Add(const Record& of, const record::ClientEnd& end);
  void Add(const Record& of, const record::FirmwareTime& time);
  void Add(const Record& of, const record::End& end);

  // Parts of Take().
  void AddCounters();
  void AddWatched();
  void AddInjected();
  void AddStates();
  void AddLateness();

  ClientLog& ClientOf(const Record& of) { return log_.clients[of.client.value_or(0)]; }

  // A client's records that only become part of the log at the end.
  struct PerClient {
    explicit PerClient(const link::Protocol& protocol) : history(protocol) {}
    LinkLog link;
    ClientHistory history;
    std::vector<std::pair<TimeNs, LineCounts>> counters;
    std::vector<std::pair<TimeNs, std::vector<double>>> watched;
    std::vector<ToldChange> states, roles;
  };

  const Scenario& scenario_;
  TraceLayout layout_;
  RecordSink* observer_;
  LogParts parts_;
  RunLog log_;
  std::vector<PerClient> clients_;
  std::vector<LinkLog> lines_;                         // between boards
  std::vector<std::pair<TimeNs, record::Late>> late_;  // with their begins
  std::vector<OwnLateness> by_firmware_;               // of each program
};

}  // namespace tiltproof::harness
