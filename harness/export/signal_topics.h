// The columns of a trace as topics: what belongs together, under the names that the columns have.
//
//   for (const SignalTopic& topic : SignalTopicsOf(trace)) Declare(topic.name, JsonSchemaOf(topic));
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "harness/run/trace.h"
#include "link/time.h"

namespace tiltproof::harness {

struct SignalTopic {
  std::string name;  // "plant_state"
  std::string type;  // "PlantState"
  struct Column {
    std::size_t place;  // in a row of the trace
    std::string name;
    std::string key;  // the name in JSON
  };
  std::vector<Column> columns;
  std::string ColumnNames() const;  // with commas between them
};

// plant_state: states, inputs in force; reference; sensors and actuators: of all clients; status: the rest. A topic
// without columns is left out.
std::vector<SignalTopic> SignalTopicsOf(const Trace& trace);

// Each message has time_ns and one number for each column.
std::string JsonSchemaOf(const SignalTopic& topic);
std::string IdlOf(const SignalTopic& topic);
// Numbers that are not finite are left out: JSON has none.
std::string ToJsonMessage(const SignalTopic& topic, TimeNs time_ns, std::span<const double> row);
std::string ToCdrMessage(const SignalTopic& topic, TimeNs time_ns, std::span<const double> row);

}  // namespace tiltproof::harness
