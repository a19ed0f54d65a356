// The rows of an envelope: every fault type, at each place where it can act.
//
//   for (const EnvelopeRow& row : EnvelopeRows(*type, signals)) {
//     const Scenario scenario = WithRow(base, row, signals);  // its harness.null is now this fault
//   }
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "faults/fault_type.h"
#include "harness/scenario/scenario.h"
#include "link/signal_table.h"

namespace tiltproof::harness {

struct EnvelopeRow {
  const faults::FaultType* type = nullptr;
  std::string place_key = {};  // "target", "signal", "actuator", "rotor"; empty: the type has one place only
  std::string place = {};      // "to_plant", "z_m", "f_r"
  // "positive" or "negative": on which side of its harmless value the severity is, where both are harmful; else empty.
  std::string side = {};
  // The one of several clients on which the fault acts; empty: every client, or the vehicle.
  std::string client = {};
  // The line between clients on which it acts, both ways or towards that end of it.
  std::string line = {};
  std::optional<std::size_t> line_end = {};

  bool IsAt(const EnvelopeRow& other) const {
    return type == other.type && place == other.place && side == other.side && client == other.client &&
           line == other.line && line_end == other.line_end;
  }
};

// Targets: to_plant, to_client, both, reference. Sensors: of the vehicle's x_m, z_m, roll_rad and wx_rad_s those that the
// fault can act on, or its first sensor; vectors: all. Inputs: the first thrust and the first torque. Axes, joints and
// rotors: that of the type's example. Each side of a severity that has two.
std::vector<EnvelopeRow> EnvelopeRows(const faults::FaultType& type, const VehicleSignals& signals);
// The same with every sensor, input, joint and rotor of the vehicle, and of several clients with each of them and each line
// between them.
std::vector<EnvelopeRow> RowsAtEveryPlace(const faults::FaultType& type, const Scenario& scenario,
                                          const VehicleSignals& signals);

// Where each row's fault acts in a base scenario: in place of its fault of this type.
inline constexpr std::string_view kPlaceholderType = "harness.null";
std::optional<std::size_t> FindPlaceholder(const Scenario& base);

// The base scenario with the row's fault in place of its placeholder, whose window and trigger it takes; without
// a start or an end where the type takes none. Its parameters are those of the type's example.
Scenario WithRow(const Scenario& base, const EnvelopeRow& row, const VehicleSignals& signals);
// The same with two faults; the second is the last of the scenario's.
Scenario WithSecondRow(const Scenario& base, const EnvelopeRow& first, const EnvelopeRow& second,
                       const VehicleSignals& signals);

}  // namespace tiltproof::harness
