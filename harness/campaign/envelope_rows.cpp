#include "harness/campaign/envelope_rows.h"

#include <algorithm>
#include <array>

#include "faults/registry.h"
#include "faults/signal_choice.h"

namespace tiltproof::harness {
namespace {

using faults::FaultSpec;
using faults::FaultType;
using faults::ParameterInfo;
using faults::ParameterKind;

constexpr std::array<std::string_view, 4> kSensors = {"x_m", "z_m", "roll_rad", "wx_rad_s"};
constexpr std::array<std::string_view, 3> kInputs = {"f_", "tau_", "angle_"};

std::vector<std::string> PlacesOf(ParameterKind kind, const VehicleSignals& signals) {
  const std::vector<std::string> names = faults::SignalNames(signals, kind);
  if (kind == ParameterKind::kSensorVector) return names;
  std::vector<std::string> places;
  const auto add_first = [&](const auto& fits) {
    const auto found = std::find_if(names.begin(), names.end(), fits);
    if (found != names.end()) places.push_back(*found);
  };
  if (kind == ParameterKind::kInput) {
    for (const std::string_view prefix : kInputs)
      add_first([&](const std::string& name) { return name.starts_with(prefix); });
  } else {
    for (const std::string_view sensor : kSensors)
      add_first([&](const std::string& name) { return name == sensor; });
  }
  if (places.empty() && !names.empty()) places.push_back(names.front());
  return places;
}

const ParameterInfo* FirstSignal(const FaultType& type) {
  for (const ParameterInfo& info : type.parameters)
    if (faults::NamesSignal(info.kind)) return &info;
  return nullptr;
}

// The severity, where values on both sides of the harmless one are harmful; else null.
const ParameterInfo* TwoSided(const FaultType& type) {
  for (const ParameterInfo& info : type.parameters) {
    if (!info.severity || !info.zero) continue;
    const double zero = std::get<double>(*info.zero);
    if (info.min < zero && zero < info.max) return &info;
  }
  return nullptr;
}

// The example's value, or as far from the harmless one on the other side.
double OnSide(const ParameterInfo& info, const std::string& side) {
  const double zero = std::get<double>(*info.zero), example = std::get<double>(info.example);
  const bool above = side == "positive";
  if ((example > zero) == above) return example;
  const double mirrored = 2 * zero - example;
  return std::clamp(mirrored, (info.min + zero) / 2, (zero + info.max) / 2);
}

// Those of the example, at the row's place and on its side.
void SetParameters(const EnvelopeRow& row, const VehicleSignals& signals, FaultSpec& fault) {
  for (const ParameterInfo& info : row.type->parameters) {
    faults::ParameterValue& value = fault.parameters[std::string(info.name)];
    value = info.example;
    if (!row.side.empty() && &info == TwoSided(*row.type)) {
      value = OnSide(info, row.side);
    } else if (info.name == row.place_key) {
      value = row.place;
    } else if (faults::NamesSignal(info.kind) || faults::NamesPart(info.kind)) {
      // Another signal than that of the row, or a part: the example's, where it is one of this vehicle.
      const std::vector<std::string> names = faults::SignalNames(signals, info.kind);
      const auto other = [&](const std::string& name) { return name != row.place; };
      const bool fits = value != faults::ParameterValue(row.place) &&
                        std::find(names.begin(), names.end(), std::get<std::string>(value)) != names.end();
      const auto found = std::find_if(names.begin(), names.end(), other);
      if (!fits && found != names.end()) value = *found;
    }
  }
}

FaultSpec FaultOf(const EnvelopeRow& row, const VehicleSignals& signals, const Scenario& base) {
  FaultSpec fault = base.faults[*FindPlaceholder(base)];
  fault.type = row.type->name;
  fault.parameters.clear();
  fault.target = faults::Target::kNone;
  if (row.place_key == "target")
    for (const faults::Target target : faults::AcceptedTargets(*row.type))
      if (Name(target) == row.place) fault.target = target;
  if (!row.client.empty() || !row.type->is_of_client()) fault.client = row.client;
  for (const LineEntry& line : base.lines)
    if (line.id == row.line) PutOnLine(line, row.line_end, fault);
  if (row.type->start == faults::Bound::kRefused) fault.start_ns = kPowerOn;
  if (row.type->end == faults::Bound::kRefused) fault.end_ns = kNever;
  SetParameters(row, signals, fault);
  return fault;
}

}  // namespace

namespace {

const ParameterInfo* FirstPart(const FaultType& type) {
  for (const ParameterInfo& info : type.parameters)
    if (faults::NamesPart(info.kind)) return &info;
  return nullptr;
}

std::vector<EnvelopeRow> RowsOf(const FaultType& type, const VehicleSignals& signals, bool every_place) {
  std::vector<EnvelopeRow> rows;
  // A fault of a hinge has no place on a vehicle without one.
  for (const ParameterInfo& info : type.parameters)
    if ((faults::NamesSignal(info.kind) || faults::NamesPart(info.kind)) &&
        faults::SignalNames(signals, info.kind).empty())
      return rows;
  if (type.has_target()) {
    const std::vector<faults::Target> accepted = faults::AcceptedTargets(type);
    for (const faults::Target target : {faults::Target::kToPlant, faults::Target::kToClient,
                                        faults::Target::kBoth, faults::Target::kReference})
      if (std::find(accepted.begin(), accepted.end(), target) != accepted.end())
        rows.push_back({&type, "target", std::string(Name(target))});
  } else if (const ParameterInfo* signal = FirstSignal(type)) {
    for (const std::string& place :
         every_place ? faults::SignalNames(signals, signal->kind) : PlacesOf(signal->kind, signals))
      rows.push_back({&type, std::string(signal->name), place});
  } else if (const ParameterInfo* part = every_place ? FirstPart(type) : nullptr) {
    for (const std::string& place : faults::SignalNames(signals, part->kind))
      rows.push_back({&type, std::string(part->name), place});
  } else {
    rows.push_back({&type, "", ""});
  }
  if (TwoSided(type) == nullptr) return rows;
  std::vector<EnvelopeRow> sides;
  for (const EnvelopeRow& row : rows) {
    for (const char* side : {"positive", "negative"}) {
      sides.push_back(row);
      sides.back().side = side;
    }
  }
  return sides;
}

}  // namespace

std::vector<EnvelopeRow> EnvelopeRows(const FaultType& type, const VehicleSignals& signals) {
  return RowsOf(type, signals, false);
}

std::vector<EnvelopeRow> RowsAtEveryPlace(const FaultType& type, const Scenario& scenario,
                                          const VehicleSignals& signals) {
  const std::vector<EnvelopeRow> of_vehicle = RowsOf(type, signals, true);
  if (!scenario.has_several_clients() || !type.is_of_client()) return of_vehicle;
  std::vector<EnvelopeRow> rows;
  for (const ClientEntry& client : scenario.clients) {
    for (const EnvelopeRow& row : of_vehicle) {
      rows.push_back(row);
      rows.back().client = client.id;
    }
  }
  if (!type.has_target()) return rows;
  for (const LineEntry& line : scenario.lines) {
    if (faults::LineProblem(type, line.protocol != nullptr)) continue;
    rows.push_back({.type = &type, .line = line.id});
    for (std::size_t end = 0; end < line.between.size(); ++end)
      rows.push_back({.type = &type, .line = line.id, .line_end = end});
  }
  return rows;
}

std::optional<std::size_t> FindPlaceholder(const Scenario& base) {
  for (std::size_t i = 0; i < base.faults.size(); ++i)
    if (base.faults[i].type == kPlaceholderType) return i;
  return std::nullopt;
}

Scenario WithRow(const Scenario& base, const EnvelopeRow& row, const VehicleSignals& signals) {
  Scenario scenario = base;
  scenario.faults[*FindPlaceholder(base)] = FaultOf(row, signals, base);
  // A message about the fault is not about the place of the placeholder.
  scenario.fault_places.clear();
  return scenario;
}

Scenario WithSecondRow(const Scenario& base, const EnvelopeRow& first, const EnvelopeRow& second,
                       const VehicleSignals& signals) {
  Scenario scenario = WithRow(base, first, signals);
  FaultSpec fault = FaultOf(second, signals, base);
  const auto taken = [&](const FaultSpec& other) { return other.id == fault.id; };
  while (std::any_of(scenario.faults.begin(), scenario.faults.end(), taken)) fault.id += "-second";
  scenario.faults.push_back(std::move(fault));
  return scenario;
}

}  // namespace tiltproof::harness
