#include "harness/run/trace.h"

#include <algorithm>
#include <limits>

#include "harness/run/run_log.h"
#include "link/signals.h"

namespace tiltproof::harness {

const std::vector<std::string>& TraceColumns() {
  static const std::vector<std::string> columns = [] {
    std::vector<std::string> names = {"t_s"};
    for (const auto& f : kSensorFields) names.emplace_back(f.column);
    for (const auto& f : kActuatorFields) names.emplace_back(f.column);
    names.insert(names.end(), {"x_ref_m", "y_ref_m", "z_ref_m", "yaw_ref_rad"});
    for (const auto& f : kSensorFields) names.push_back("sensed_" + std::string(f.column));
    for (const auto& f : kActuatorFields) names.push_back("commanded_" + std::string(f.column));
    names.emplace_back("faults_active_count");
    for (const char* direction : {"to_plant", "to_client", "reference"})
      for (const char* counter : {"frames_sent", "frames_accepted", "frames_rejected"})
        names.push_back(std::string(direction) + "_" + counter + "_count");
    return names;
  }();
  return columns;
}

Trace::Trace(std::vector<std::string> columns) : columns_(std::move(columns)) {}

std::optional<std::size_t> Trace::Find(std::string_view column) const {
  const auto it = std::find(columns_.begin(), columns_.end(), column);
  if (it == columns_.end()) return std::nullopt;
  return static_cast<std::size_t>(it - columns_.begin());
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

}  // namespace tiltproof::harness
