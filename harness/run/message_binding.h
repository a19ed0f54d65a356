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
        throw std::invalid_argument("message '" + type.name + "' uses signal '" + field.signal +
                                    "', which this vehicle does not have");
      places_.push_back(*place);
    }
  }

  const link::MessageType& type() const { return *type_; }

  // The message's values, taken from a row.
  template <class Number>
  std::vector<float> Values(std::span<const Number> row) const {
    std::vector<float> values;
    for (const std::size_t place : places_) values.push_back(static_cast<float>(row[place]));
    return values;
  }
  // Writes the message's values into a row. Signals that the message does not carry stay unchanged.
  void Put(std::span<const float> values, std::span<double> row) const {
    for (std::size_t i = 0; i < places_.size(); ++i) row[places_[i]] = static_cast<double>(values[i]);
  }

 private:
  const link::MessageType* type_;
  std::vector<std::size_t> places_;
};

}  // namespace tiltproof::harness
