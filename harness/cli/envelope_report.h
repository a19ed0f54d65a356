// Results of `tiltproof envelope`, as a file and as a table.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "harness/campaign/envelope_rows.h"
#include "harness/campaign/fault_level.h"
#include "harness/campaign/margins.h"
#include "harness/report/results.h"

namespace tiltproof::harness {

// The margin of one fault at one place with one firmware.
struct EnvelopeEntry {
  EnvelopeRow row;
  std::string client;  // the firmware's build, or the client: the column of the table
  Severity severity;
  std::optional<Margin> margin;  // none: not found yet
};

struct EnvelopeNotApplicable {
  std::string type, place, client, reason;
};

// The pairs of levels of two faults that are survived together.
struct EnvelopeMap {
  struct Axis {
    EnvelopeRow row;
    Severity severity;
    std::vector<double> levels;
  };
  std::string client;
  Axis x, y;
  // Answer for each y and x; none: not flown, or it could not be judged.
  std::vector<std::vector<std::optional<bool>>> survived;
};

// A firmware, and what its margins depend on.
struct EnvelopeColumn {
  std::string client;
  std::string scenario;  // a hash of the resolved scenario, its vehicle and the client
  std::string flags;  // for a shell, each behind a space: how `run` flies it; empty for the shipped firmware
  std::string build;  // of the program and the firmware (harness/report/build_id.h)
};

// An earlier run's results in the same folder that this run does not look for: they stay in the file. Rows are JSON
// objects.
struct EnvelopeEarlier {
  std::vector<EnvelopeColumn> columns;
  std::vector<std::string> rows, not_applicable, maps;
  bool complete = true;
};

struct Envelope {
  std::string scenario;  // its name
  std::vector<EnvelopeColumn> columns;
  std::vector<EnvelopeEntry> entries;
  std::vector<EnvelopeNotApplicable> not_applicable;
  std::vector<EnvelopeMap> maps;
  EnvelopeEarlier earlier;
  std::uint64_t seed = 0;  // the first
  int repeat_count = 0;
  double tolerance = 0.0;
  bool has_map = false;   // it flies one
  bool complete = false;  // this run; the file is when the earlier one was, too
};

// envelope.json.
std::string ToJsonText(const Envelope& envelope);
// Lines of at most 80 columns with one or two clients.
std::string EnvelopeTable(const Envelope& envelope);
// One line per type and reason.
std::vector<std::string> NotApplicableLines(const Envelope& envelope);
std::string EnvelopeMapText(const EnvelopeMap& map);

}  // namespace tiltproof::harness
