// Finds the margins of an envelope: of many faults at their places, with several firmwares, and maps of two faults.
// Resume() takes the rows of an earlier file, Run() finds the others, and envelope() is the file at any time.
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "harness/campaign/envelope.h"
#include "harness/campaign/envelope_rows.h"
#include "harness/campaign/margins.h"
#include "harness/campaign/trials.h"

namespace tiltproof::harness {

// A column: a firmware whose margins are searched.
struct EnvelopeFirmware {
  std::string name;
  EnvelopeColumn column;
  FlightJob flight;              // its scenario has the placeholder of the faults (envelope_rows.h)
  std::vector<EnvelopeRow> map;  // the two faults that are flown together; or none
};

struct EnvelopeSearchRow {
  EnvelopeRow row;
  std::string client;  // the name of its firmware
  MarginTask task;
  std::optional<EnvelopeEntry> found = {};  // none: not found yet
};

struct EnvelopePlan {
  std::vector<EnvelopeFirmware> firmwares;
  std::vector<EnvelopeSearchRow> rows;
  std::vector<EnvelopeNotApplicable> not_applicable;
};

class EnvelopeSearch {
 public:
  struct Options {
    double tolerance = 0.01;
    int repeat_count = 5;
    FlightsOptions flights = {};
    // A margin was found, or there is none.
    std::function<void(const EnvelopeSearchRow&)> on_row = [](const auto&) {};
    // A flight could not be judged.
    std::function<void(const TrialResult&)> on_unknown = [](const auto&) {};
  };
  EnvelopeSearch(EnvelopePlan plan, Options options);

  // Takes the margins of an earlier envelope, except those that could not be judged. Its other rows, columns and maps
  // stay in the file. Throws std::runtime_error with the difference when its rows were found in another way.
  void Resume(const Envelope& earlier);
  // Until all margins are found, or it is interrupted.
  void Run();

  // As the file has it now.
  Envelope envelope() const;
  const std::vector<EnvelopeFirmware>& firmwares() const { return plan_.firmwares; }
  const std::vector<EnvelopeSearchRow>& rows() const { return plan_.rows; }
  const std::vector<EnvelopeNotApplicable>& not_applicable() const { return plan_.not_applicable; }
  const std::vector<EnvelopeMap>& maps() const { return maps_; }
  // Rows of an earlier envelope that are not selected now.
  std::size_t others_count() const { return earlier_.rows.size(); }
  // Firmwares that fail without any fault, by name: no level of theirs is survived.
  const std::map<std::string, TrialResult>& broken() const { return broken_; }
  std::size_t done_count() const;
  std::size_t resumed_count() const { return resumed_count_; }  // of those that are done
  std::size_t flown_count() const { return trials_.flown_count(); }

 private:
  bool interrupted() const { return options_.flights.is_interrupted(); }
  std::set<std::string> Clients() const;
  // The first difference, with both values; empty when there is none.
  std::string DifferenceFrom(const Envelope& earlier) const;
  // The part of it that this search does not look for.
  Envelope NotSelected(const Envelope& earlier) const;
  void Found(EnvelopeSearchRow& row, const Margin& margin) const;

  void FlyWithoutFaults();
  void FindRows();
  void FlyMaps();
  std::optional<EnvelopeMap::Axis> AxisOf(const std::string& client, const EnvelopeRow& row) const;
  void StartMap(const EnvelopeFirmware& firmware, EnvelopeMap& map);

  EnvelopePlan plan_;
  Options options_;
  Trials trials_;
  std::vector<EnvelopeMap> maps_;
  Envelope earlier_;
  std::map<std::string, TrialResult> broken_;
  std::size_t resumed_count_ = 0;
  bool complete_ = false;
};

}  // namespace tiltproof::harness
