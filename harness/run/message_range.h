// Values that a field of a message cannot carry: a reference of 4 rad in a field that ends at 3.2767 rad. On the line such
// a value becomes the end of its type's range, without an error, or the receiver refuses the message. So `check` and `run`
// warn before the flight.
//
//   for (const BeyondRange& beyond : PathBeyondRange(scenario, model.signals()))
//     Warn(beyond.field->signal, beyond.value, beyond.carried.high);
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "harness/scenario/scenario.h"
#include "link/protocol.h"
#include "link/signal_table.h"

namespace tiltproof::harness {

// The values that a field carries: those of its type that are plausible. In the unit and the axes of the field.
struct CarriedRange {
  double low = 0, high = 0;
};
CarriedRange CarriedRangeOf(const link::MessageField& field);

// True if the receiver of a message refuses it for this value, as the sender rounds it.
bool IsRefused(const link::MessageField& field, double value);

struct BeyondRange {
  const link::MessageType* message = nullptr;  // of the protocol
  const link::MessageField* field = nullptr;
  CarriedRange carried;
  double value = 0;       // the worst one, in the unit and the axes of the field
  bool refused = false;   // the receiver refuses the message; false: it gets the end of the range
  bool at_start = false;  // of the vehicle's start, not of the reference
  TimeNs time_ns = 0;     // at which the worst value is first reached
};

// Fields of position, velocity and attitude that cannot carry the scenario's reference, or the state of a vehicle at its
// start and on the reference. At most one for each field, in the order of the protocol. A field's own rounding does not
// count. The times are those of the references, one in each control period; of a long flight, 20 000 of them. The protocol
// must suit the vehicle. Throws ReferenceError.
std::vector<BeyondRange> PathBeyondRange(const Scenario& scenario, const VehicleSignals& vehicle);

// Positions and the heading that the scenario's reference changes and that no reference message carries, by their names in
// the protocol: a firmware cannot hear of them. Throws ReferenceError.
std::vector<std::string> UnheardReference(const Scenario& scenario);

// The ranges of the messages that the server sends, while it sends them.
class RangeWatch {
 public:
  explicit RangeWatch(const link::Protocol& protocol);

  // Reports the fields whose value in the message, `sent`, a client may refuse: "z_m = 10.2, beyond the range -10 to 10".
  // Left out are those that only a fault of a sensor has put out of range, and those reported before. `true_values` has the
  // values without faults of sensors; it is called only when a client may refuse one that is sent.
  std::vector<std::string> Look(const link::MessageType& message, std::span<const double> sent,
                                const std::function<std::vector<double>()>& true_values);

 private:
  const link::Protocol& protocol_;
  // By message: fields whose range is narrower than that which every protocol has (link::PlausibleMagnitude).
  std::vector<std::vector<std::size_t>> watched_;
};

// Fields of actuator messages that cannot carry the inputs of hover, `hover`, in the order of vehicle.inputs.
std::vector<BeyondRange> HoverBeyondRange(const link::Protocol& protocol, const VehicleSignals& vehicle,
                                          std::span<const double> hover);

}  // namespace tiltproof::harness
