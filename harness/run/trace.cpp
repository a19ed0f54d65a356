#include "harness/run/trace.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "harness/run/hash.h"
#include "harness/run/run_log.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

constexpr std::string_view kSensed = "sensed_", kCommanded = "commanded_";
constexpr std::string_view kWatch = "watch_";
constexpr std::string_view kFirstOfReference = "x_ref_m", kLastOfReference = "yaw_ref_rad";

}  // namespace

TraceLayout::TraceLayout(const VehicleSignals& vehicle, const Scenario& scenario) {
  std::vector<Signal> all;
  const auto add = [&](std::string name, SignalFrame frame = SignalFrame::kNone) {
    all.push_back(SignalNamed(std::move(name), frame));
  };
  const auto add_table = [&](const SignalTable& table, std::string_view prefix = {}) {
    const std::size_t first = all.size();
    for (Signal signal : table) {
      signal.name.insert(0, prefix);
      all.push_back(std::move(signal));
    }
    return first;
  };
  const auto add_for_clients = [&](const SignalTable& table, std::string_view prefix) {
    const std::size_t first = all.size();
    for (std::size_t client = 0; client < scenario.client_count(); ++client)
      add_table(table, ClientName(scenario, prefix, client, '_', ""));
    return first;
  };
  add("t_s");
  states = add_table(vehicle.states);
  inputs = add_table(vehicle.inputs);
  reference = all.size();
  for (const std::string_view position : {kFirstOfReference, {"y_ref_m"}, {"z_ref_m"}})
    add(std::string(position), SignalFrame::kWorld);
  add(std::string(kLastOfReference), SignalFrame::kEuler);
  measured = add_table(vehicle.measured);
  sensed = add_for_clients(vehicle.sensors, kSensed);
  commanded = add_for_clients(vehicle.inputs, kCommanded);
  if (scenario.has_several_clients()) {
    arbiter_selected = all.size();
    add("arbiter_selected");
  }
  if (scenario.solid_ground) {
    on_ground = all.size();
    add("on_ground");
  }
  faults_active_count = all.size();
  add("faults_active_count");
  link_counters = all.size();
  for (std::size_t client = 0; client < scenario.client_count(); ++client)
    for (const char* direction : {"to_plant_", "to_client_", "reference_"})
      for (const char* counter : {"frames_sent_count", "frames_accepted_count", "frames_rejected_count"})
        add(ClientName(scenario, direction, client, '_', counter));
  active = all.size();
  for (const auto& fault : scenario.faults) add("active_" + fault.id);
  watch = all.size();
  for (std::size_t client = 0; client < scenario.client_count(); ++client)
    for (const std::string& variable : scenario.watch)
      add(ClientName(scenario, kWatch, client, '_', WatchColumn(variable).substr(kWatch.size())));
  columns = SignalTable(std::move(all));
}

Trace::Trace(const SignalTable& columns) {
  for (const Signal& signal : columns) {
    columns_.push_back(signal.name);
    scales_.push_back(signal.scale);
  }
}

Trace::Trace(std::vector<std::string> columns) : columns_(std::move(columns)) {
  for (const std::string& name : columns_) scales_.push_back(SignalNamed(name, SignalFrame::kNone).scale);
}

VehicleColumns FindVehicleColumns(const Trace& trace) {
  const auto& names = trace.columns();
  const auto is_commanded = [&](const std::string& name) {
    return std::any_of(names.begin(), names.end(), [&](const std::string& other) {
      return other.starts_with(kCommanded) && other.ends_with("_" + name);
    });
  };
  VehicleColumns found;
  for (std::size_t i = 0; i < names.size() && names[i] != kFirstOfReference; ++i) {
    if (names[i] == "t_s") continue;
    (is_commanded(names[i]) ? found.inputs : found.states).push_back(i);
  }
  const auto reference_end = std::find(names.begin(), names.end(), kLastOfReference);
  for (auto name = reference_end;
       name != names.end() && ++name != names.end() && !name->starts_with(kSensed);)
    found.measured.push_back(static_cast<std::size_t>(name - names.begin()));
  return found;
}

std::optional<std::size_t> Trace::Find(std::string_view column) const {
  const auto it = std::find(columns_.begin(), columns_.end(), column);
  if (it == columns_.end()) return std::nullopt;
  return static_cast<std::size_t>(it - columns_.begin());
}

void Trace::InsertColumn(std::size_t place, std::string name, std::span<const double> values) {
  Check(values.size() == row_count(), "a column has one value for each row");
  Check(place <= columns_.size(), "a column comes between others, or behind them");
  const auto offset = static_cast<std::ptrdiff_t>(place);
  std::vector<double> wider;
  wider.reserve(values_.size() + values.size());
  for (std::size_t r = 0; r < values.size(); ++r) {
    const auto old = row(r);
    wider.insert(wider.end(), old.begin(), old.begin() + offset);
    wider.push_back(values[r]);
    wider.insert(wider.end(), old.begin() + offset, old.end());
  }
  values_ = std::move(wider);
  scales_.insert(scales_.begin() + offset, SignalNamed(name, SignalFrame::kNone).scale);
  columns_.insert(columns_.begin() + offset, std::move(name));
}

void Trace::AppendRows(std::vector<double>&& rows) {
  if (values_.empty()) {
    values_ = std::move(rows);
  } else {
    values_.insert(values_.end(), rows.begin(), rows.end());
  }
}

std::span<double> Trace::AppendRow() {
  values_.resize(values_.size() + columns_.size(), std::numeric_limits<double>::quiet_NaN());
  return std::span(values_).last(columns_.size());
}

std::string TraceHash(const Trace& trace) {
  std::uint64_t hash = kFnvOffset;
  for (const auto& column : trace.columns())
    hash = Fnv1a({reinterpret_cast<const std::uint8_t*>(column.c_str()), column.size() + 1}, hash);
  for (std::size_t r = 0; r < trace.row_count(); ++r) {
    for (const double value : trace.row(r)) {
      // All NaN are one: the file keeps no payload.
      hash = Fnv1a(
          std::bit_cast<std::uint64_t>(std::isnan(value) ? std::numeric_limits<double>::quiet_NaN() : value),
          hash);
    }
  }
  return fmt::format("{:016x}", hash);
}

std::string_view Name(EndReason reason) {
  switch (reason) {
    case EndReason::kCompleted:
      return "completed";
    case EndReason::kDiverged:
      return "diverged";
    case EndReason::kGroundStrike:
      return "ground_strike";
    case EndReason::kNeverStarted:
      return "never_started";
    case EndReason::kFirmwareHung:
      return "firmware_hung";
    case EndReason::kFirmwareCrashed:
      return "firmware_crashed";
    case EndReason::kInterrupted:
      return "interrupted";
    case EndReason::kNodeLost:
      return "node_lost";
    case EndReason::kFirmwareLost:
      return "firmware_lost";
    case EndReason::kLineOverfull:
      return "line_overfull";
    case EndReason::kHarnessError:
      return "harness_error";
  }
  return "unknown";
}

std::string_view Name(LineMistakeKind kind) {
  switch (kind) {
    case LineMistakeKind::kMalformed:
      return "malformed";
    case LineMistakeKind::kMissing:
      return "missing";
    case LineMistakeKind::kDoubled:
      return "doubled";
    case LineMistakeKind::kUnanswered:
      return "unanswered";
  }
  return "unknown";
}

}  // namespace tiltproof::harness
