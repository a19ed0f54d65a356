// Flies a scenario with several seeds and reports whether all of them pass: one trial. Many trials wait at once, so
// that no worker is idle.
//
//   Trials trials({.jobs_count = 2}, 5);
//   trials.Start(job, [](const TrialResult& result) { Take(result.answer); });
//   trials.Fly();
//
// The first seed flies first. Often it decides alone: it fails, or nothing in its flight was drawn at random. Then
// the other seeds give the same flight.
//
// The report does not depend on the number of jobs: of several seeds that fail, the lowest counts.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "harness/engine/engine.h"
#include "harness/engine/flights_options.h"

namespace tiltproof::harness {

struct TrialResult {
  enum class Answer : std::uint8_t {
    kSurvived,  // every seed passed
    kFailed,    // a seed failed
    kUnknown,   // a flight is an error, or cannot be judged
  };
  Answer answer = Answer::kSurvived;
  std::size_t flights_count = 0;  // up to the one that decided
  bool is_of_any_seed = false;    // survived, and nothing in the flight was drawn at random
  // By fault of the scenario: the number of times that it acted, in all flights that were judged.
  std::vector<std::int64_t> activations;
  // Data of the flight that decided, unless it survived:
  std::string flight;  // its name
  std::uint64_t seed = 0;
  Verdict verdict = Verdict::kPass;
  std::string criterion;  // the first that was violated, with the time; empty when unknown
  std::optional<double> time_s;
  std::string reason;  // one line
};

// For a flight that could not be judged: the flight and the reason, in one line.
std::string WhyUnknown(const TrialResult& unknown);

class Trials {
 public:
  using Done = std::function<void(const TrialResult&)>;

  // `seeds_count`: from the scenario's seed on.
  explicit Trials(FlightsOptions options, int seeds_count = 5);

  // `done` is called in Fly(), and may start further trials. Trials whose jobs name the same trunk share one for each seed,
  // until Forget().
  void Start(const FlightJob& job, Done done);
  void Forget(const std::string& trunk);
  // Until nothing is left to fly, or it is interrupted or stopped.
  void Fly();
  // Ends Fly(): what waits is not flown.
  void Stop() { stopped_ = true; }

  std::size_t flown_count() const { return flown_count_; }

 private:
  struct Trial {
    std::vector<std::optional<FlightResult>> results;  // by seed
    Done done;
    FlightJob job;  // of the first seed
  };

  void Submit(std::uint64_t number, const Trial& trial, std::size_t place);
  void Finished(const FlightJob& job, const FlightResult& result);
  // None: later flights decide.
  static std::optional<TrialResult> Decide(const Trial& trial);

  FlightsOptions options_;
  std::size_t seeds_count_;
  Engine engine_;
  std::uint64_t numbers_end_ = 0;
  std::map<std::string, std::pair<std::uint64_t, std::size_t>> flights_;  // by name: its trial, and its place
  std::map<std::uint64_t, Trial> trials_;                                 // that have not ended
  std::size_t flown_count_ = 0;
  bool stopped_ = false;
};

}  // namespace tiltproof::harness
