// Flies the flights of a command: results as they come, a progress line, an end by Ctrl-C.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "harness/engine/engine.h"

namespace tiltproof::harness {

struct RunFlightsOptions {
  int jobs_count = 1;
  bool fail_fast = false;
  bool progress = false;  // one updating line on standard error, where that is a terminal
  // Called as results arrive, about ten times per second, and when a flight of this name goes on the bus.
  std::function<void(const FlightJob&, const FlightResult&)> on_finished = [](const auto&, const auto&) {};
  std::function<void()> on_turn = [] {};
  std::function<bool()> may_begin = [] { return true; };  // until then nothing is flown
  std::function<void(const std::string&, const BusPlace&)> on_place = [](const auto&, const auto&) {};
};

struct FlownFlights {
  std::vector<FlightResult> results;   // in the order of the jobs; those not flown are missing
  std::vector<std::string> not_flown;  // after an interrupt or --fail-fast
  bool interrupted = false;
};

// SIGINT and SIGTERM end the current flights, whose partial results are kept.
FlownFlights RunFlights(std::vector<FlightJob> jobs, const RunFlightsOptions& options);

}  // namespace tiltproof::harness
