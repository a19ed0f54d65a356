// envelope.json: the margins of every fault over one scenario, for several firmwares. docs/margins.md describes the file.
//
//   const Envelope envelope = ReadEnvelope("results/envelope/envelope.json");
//   for (const EnvelopeEntry& entry : envelope.rows) Report(entry.type, entry.place(), entry.client, entry.survives);
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "harness/campaign/envelope_rows.h"
#include "harness/campaign/margins.h"
#include "harness/report/json_text.h"
#include "harness/report/results.h"
#include "link/fields.h"

namespace tiltproof::harness {

// The fault of a row, and where it acts. At most one of target, signal and actuator is set.
struct EnvelopePlace {
  std::string type;
  std::optional<std::string> target, signal, actuator;
  std::optional<std::string> side;  // "positive" or "negative", where a severity has both

  // The one that is set, or "".
  std::string place() const;
  bool IsAt(const EnvelopePlace& other) const {
    return type == other.type && place() == other.place() && side == other.side;
  }
};
EnvelopePlace PlaceOf(const EnvelopeRow& row);

// The margin of one fault at one place with one firmware.
struct EnvelopeEntry : EnvelopePlace, MarginScan {
  std::string client;     // the firmware's build, or the client: the column of the table
  std::string parameter;  // the severity
  std::string unit;
  std::optional<double> survives, fails;  // as in Margin
  // The flight that failed at `fails`; none where nothing fails.
  std::optional<std::string> first_criterion;
  std::optional<std::uint64_t> seed;
  std::optional<double> time_s;
  std::optional<std::string> reason;
  // The range that is searched.
  std::optional<double> harmless;
  double mildest = 0.0, severest = 0.0;
  std::string scale;  // "linear" or "logarithmic"
  std::size_t runs = 0;
  std::optional<std::string> error;  // the reason that there is no margin

  // As Margin::never_acted(): then there is no margin, and another flight would not change that.
  bool never_acted() const { return !levels.empty() && idle_levels.size() == levels.size(); }
  static constexpr std::array<std::string_view, 5> kLeavesOutNull = {"target", "signal", "actuator", "side",
                                                                     "error"};
  TILTPROOF_FIELDS(type, target, signal, actuator, side, client, parameter, survives, fails, unit,
                   first_criterion, seed, time_s, reason, harmless, mildest, severest, scale, runs, levels,
                   pockets, survived_share, idle_levels, seeds, sure_share, error)
};
// `repeat_count`: as of ScanOf.
EnvelopeEntry EntryOf(const EnvelopeRow& row, const std::string& client, const Severity& severity,
                      const Margin& margin, int repeat_count);

struct EnvelopeNotApplicable {
  std::string type, place, client, reason;
  TILTPROOF_FIELDS(type, place, client, reason)
};

// Pairs of levels of two faults, and whether they are survived together.
struct EnvelopeMap {
  struct Axis : EnvelopePlace {
    std::string parameter, unit;
    std::vector<double> levels;
    static constexpr std::array<std::string_view, 4> kLeavesOutNull = {"target", "signal", "actuator",
                                                                       "side"};
    TILTPROOF_FIELDS(type, target, signal, actuator, side, parameter, unit, levels)
  };
  std::string client;
  Axis x, y;
  // Answer for each y and x; none: not flown, or it could not be judged.
  std::vector<std::vector<std::optional<bool>>> survived;
  TILTPROOF_FIELDS(client, x, y, survived)
};

// Identity of a firmware's flights: all that its margins depend on.
struct EnvelopeColumn {
  std::string scenario;  // a hash of the resolved scenario, its vehicle and the client
  std::string flags;  // for a shell, each behind a space: how `run` flies it; empty for the shipped firmware
  std::string build;  // of the program and the firmware (harness/report/build_id.h)
  TILTPROOF_FIELDS(scenario, flags, build)
};

struct Envelope {
  int format = kResultsFormat;
  std::string version{Version()};
  std::string scenario;              // its name
  std::vector<std::string> clients;  // the columns, in order
  std::map<std::string, EnvelopeColumn> columns;
  std::uint64_t seed = 0;  // the first
  int repeats = 0;
  double tolerance = 0.0;
  bool complete = false;
  std::vector<EnvelopeEntry> rows;
  std::vector<EnvelopeNotApplicable> not_applicable;
  std::vector<EnvelopeMap> map;
  TILTPROOF_FIELDS(format, version, scenario, clients, columns, seed, repeats, tolerance, complete, rows,
                   not_applicable, map)
};

// The text of the file.
std::string ToJsonText(const Envelope& envelope);
// Throws FileError when there is no such file, and std::runtime_error, with the row, when it is no envelope.
Envelope ReadEnvelope(const std::filesystem::path& file);

}  // namespace tiltproof::harness
