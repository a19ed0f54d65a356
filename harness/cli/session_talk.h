// The conversation of `tiltproof session` with a script: one JSON object per line, a request and its answer in turn
// (docs/session.md).
//
//   SessionTalk talk({.in = 10, .out = 11, .hello = hello}, models, columns);
//   job.steer = [&talk](SteeredFlight& flight, Scenario& flown, const auto& alive) {
//     talk.Attend(flight, flown, alive);              // in the worker process
//   };
//   talk.TellEnd(ended);                              // in its parent, when the flight is over, whatever became of it
//
// Requests that were read and not yet answered are in memory that both processes share. So the parent answers a
// request during which the worker died.
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "harness/cli/suite.h"
#include "harness/formula/condition.h"
#include "harness/reference/reference_path.h"
#include "harness/run/row_signals.h"
#include "harness/run/steered_flight.h"
#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

class SessionTalk {
 public:
  struct Ends {
    int in = -1, out = -1;
    nlohmann::ordered_json hello;  // of the first line; the talk adds the signals
    // The reason that a fault cannot be injected into the scenario's flight; empty: it can.
    std::function<std::string(const Scenario& flown, const faults::FaultSpec& fault)> why_not;
    const std::atomic<bool>* interrupted = nullptr;
  };
  // `models` holds the scenario's vehicle, and must outlive it. `columns`: of the trace. Throws std::runtime_error.
  SessionTalk(Ends ends, ModelCache& models, std::vector<std::string> columns);
  ~SessionTalk();
  SessionTalk(const SessionTalk&) = delete;
  SessionTalk& operator=(const SessionTalk&) = delete;

  // The flight is at a row: answers what was asked for, and takes requests until one lets time pass.
  void Attend(SteeredFlight& flight, Scenario& flown, const std::function<void()>& alive);

  // Answers the open request, if any, or says it in place of the first line, and answers all that still come, until the script closes the stream or an interrupt.
  void TellEnd(const nlohmann::ordered_json& ended);

 private:
  // In shared memory.
  struct Shared;
  struct Signal {
    std::string name;
    RowSignal reader;
  };
  // The request that lets time pass until a row.
  struct Goal {
    TimeNs until_ns = 0;
    std::optional<stl::Condition> condition;
    std::vector<Signal> signals;
  };

  bool IsReached(SteeredFlight& flight);
  // True if time may pass.
  bool Obey(const nlohmann::ordered_json& request, SteeredFlight& flight, Scenario& flown);
  void Inject(const nlohmann::ordered_json& fault, SteeredFlight& flight, Scenario& flown);
  void Remove(const nlohmann::ordered_json& id, SteeredFlight& flight, const Scenario& flown);
  void Read(const nlohmann::ordered_json& names, SteeredFlight& flight);
  Signal SignalNamed(const std::string& name) const;
  // A request; none: the stream has ended, or an interrupt came.
  std::optional<std::string> NextLine(const std::function<void()>& alive);
  bool Fill(const std::function<void()>& alive);
  bool IsHeard() const;  // the script still reads
  void Answer(TimeNs time_ns, const nlohmann::ordered_json& answer);
  void Complain(const std::string& where, const std::string& message);
  void Write(nlohmann::ordered_json line);

  Ends ends_;
  ModelCache& models_;
  std::vector<std::string> columns_, names_;
  Shared* shared_ = nullptr;
  std::optional<Goal> goal_;
  std::optional<ReferencePath> path_;  // of cross_track_error_m
  bool finishes_ = false, unheard_ = false;
  int injected_count_ = 0, rows_count_ = 0;
};

}  // namespace tiltproof::harness
