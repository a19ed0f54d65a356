// The records of a real-time flight, on their way from the nodes to the harness: one stream for each node, in numbered
// messages.
//
//   LogPublisher publisher(bus, run_id, "link", harness);  // in the node
//   publisher.Write(record);
//   publisher.Flush();                                     // every 50 ms
//   publisher.Close();                                     // its last message
//
//   LogCollector collector(bus, members, scenario, vehicle, run_id, on_data);  // in the harness
//   collector.Drain(flown_ns);  ...  if (collector.Complete("link")) ...
//   RunLog log = collector.Take();
//
// Nothing is lost on the way: messages are numbered, and the last one is marked. The collector stops listening to a node
// that sends more than a flight can hold.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "harness/dds/bus.h"
#include "harness/run/log_builder.h"
#include "harness/run/realtime/public_log.h"
#include "harness/run/record_stream.h"
#include "harness/run/run_log.h"
#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

// Records when this node's own work was later than allowed.
struct Lateness {
  static constexpr std::size_t kSpansMax = 10'000;

  void Note(BootTime due_ns, BootTime done_ns) {
    if (done_ns - due_ns > late_after_ns) Add(spans, due_ns, done_ns);
  }
  // The line still sent what was late (send_backlog.h).
  void NoteBacklog(BootTime begin_ns, BootTime sent_ns) { Add(spans, begin_ns, sent_ns); }
  // The board's clock may have lost time then (RunLog::board_disturbed).
  void NoteDisturbed(BootTime begin_ns, BootTime end_ns) { Add(disturbed, begin_ns, end_ns); }

  // Writes the spans that reach into the flight (kLatenessReach); where t = 0 is not known, all, with negative times.
  // `processors`: of this node.
  void WriteTo(RecordSink& sink, const std::string& processors) const;
  // From which times count: t = 0, or the end of a flight in which it is not known.
  Origin zero() const { return origin.known() ? origin : Origin(stopped); }

  TimeNs late_after_ns = kNever;  // Scenario::late_after_ns(), once a flight is prepared
  std::vector<NodeLateSpan> spans = {}, disturbed = {};
  Origin origin = {};     // by the node's clock
  BootTime stopped = {};  // likewise, when the flight ended

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

class LogPublisher final : public RecordSink {
 public:
  // `harness`: the participant that gathers the log. Nothing is sent before it listens.
  LogPublisher(dds::Bus& bus, std::string run_id, std::string node_id, const dds::Participant& harness);

  // Keeps the record for the next Flush(). Cuts long texts, and drops what a firmware prints beyond
  // kFirmwareLogBytesMax.
  void Write(const Record& record) override;
  // Sends what was written, and again what the bus did not accept.
  void Flush();
  // Sends the node's last message.
  void Close();

 private:
  // Makes a message of the first bytes that were packed.
  void Seal(std::size_t size_bytes, bool last);

  std::string run_id_, node_id_;
  dds::Participant harness_;
  std::size_t firmware_log_bytes_ = 0;
  dds::Publisher<dds::Records> records_;
  PackedRecords packed_;
  std::int64_t sequence_ = 0;
  std::deque<dds::Records> waiting_;  // in order
  bool listened_ = false;
};

class LogCollector {
 public:
  // The bound on what one node may send: a fixed amount, and an amount for each second of the flight. A
  // well-behaved node sends below 0.2 MiB/s; a firmware that floods a line of 1 Mbaud with the shortest
  // frames makes the link node send 2 MiB/s. The fixed amount is for messages that a cut network held up,
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
  // Every message of the node's log is here.
  bool Complete(const std::string& node_id) const;
  // The messages that are missing from a node's log, for a person; empty when nothing is missing.
  std::string Missing(const std::string& node_id) const;
  // For the harness's own records.
  RecordSink& log() { return log_; }
  // The flight as far as the records tell.
  RunLog Take();

 private:
  // One node's log.
  struct Node {
    std::int64_t sent_bytes = 0;
    std::int64_t last = 0;  // sequence of its last message; 0: not here yet
    bool damaged = false;   // a message could not be read
  };
  // True if its node has stayed within the bound so far.
  bool Accepts(const dds::Records& message);

  std::string run_id_;
  dds::Subscriber<dds::Records> records_;
  LogBuilder log_;
  PublicLog public_log_;
  std::map<std::string, Node> nodes_;
  TimeNs flown_ns_ = 0;
  std::string overfull_;
};

// Drops lateness that ended kLatenessReach before t = 0, but of a flight that never started, and sets the counts from
// log.harness_late, from 0 to log.end_ns.
void CountLateness(RunLog& log, TimeNs period_ns);

}  // namespace tiltproof::harness
