// Maps the values of a message to their places in a row of signals. Names are looked up once, when a flight
// is loaded.
//
//   const MessageBinding sensors(*protocol.Find("sensors"), vehicle.sensors);
//   protocol.Encode(sensors.type(), sensors.Values(row));
#pragma once

#include <cstddef>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "link/protocol.h"
#include "link/signal_table.h"

namespace tiltproof::harness {

class MessageBinding {
 public:
  // Throws std::invalid_argument for a field whose signal is not in the table. `type` must outlive it.
  MessageBinding(const link::MessageType& type, const SignalTable& signals) : type_(&type) {
    for (const link::MessageField& field : type.fields) {
      const auto place = signals.Find(field.signal);
      if (!place)
        throw std::invalid_argument("message '" + type.name + "' carries the signal '" + field.signal +
                                    "', which this vehicle does not have");
      places_.push_back(*place);
    }
  }

  const link::MessageType& type() const { return *type_; }

  // The message's values, taken from a row.
  template <class Number>
  std::vector<double> Values(std::span<const Number> row) const {
    std::vector<double> values;
    for (const std::size_t place : places_) values.push_back(static_cast<double>(row[place]));
    return values;
  }
  // Writes the message's values into a row. Signals that the message does not carry stay unchanged.
  void Put(std::span<const double> values, std::span<double> row) const {
    for (std::size_t i = 0; i < places_.size(); ++i) row[places_[i]] = values[i];
  }

 private:
  const link::MessageType* type_;
  std::vector<std::size_t> places_;
};

// The table of the vehicle, or of the reference, whose signals the message carries.
const SignalTable& TableOf(const link::MessageType& type, const VehicleSignals& vehicle);

// The reason that the protocol does not suit the vehicle: a message carries a signal that the vehicle does not have, or
// no actuator message carries one of its inputs. Empty when the protocol suits it.
std::string UnsuitableProtocol(const link::Protocol& protocol, const VehicleSignals& vehicle);

}  // namespace tiltproof::harness
