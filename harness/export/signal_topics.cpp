#include "harness/export/signal_topics.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <set>

#include "harness/dds/cdr.h"
#include "harness/report/json_fields.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

// An identifier of IDL; fault ids may hold other characters.
std::string Identifier(const std::string& name, std::set<std::string>& taken) {
  std::string identifier = name;
  for (char& c : identifier)
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  while (!taken.insert(identifier).second) identifier += "_";
  return identifier;
}

}  // namespace

std::string SignalTopic::ColumnNames() const {
  std::string names;
  for (const Column& column : columns) names += (names.empty() ? "" : ",") + column.name;
  return names;
}

std::vector<SignalTopic> SignalTopicsOf(const Trace& trace) {
  std::vector<SignalTopic> topics = {{"plant_state", "PlantState", {}},
                                     {"reference", "Reference", {}},
                                     {"sensors", "Sensors", {}},
                                     {"actuators", "Actuators", {}},
                                     {"status", "Status", {}}};
  const VehicleColumns vehicle = FindVehicleColumns(trace);
  for (std::size_t c = 0; c < trace.columns().size(); ++c) {
    const std::string& name = trace.columns()[c];
    if (name == "t_s") continue;
    const auto is_in = [c](const std::vector<std::size_t>& places) {
      return std::find(places.begin(), places.end(), c) != places.end();
    };
    const std::size_t topic = is_in(vehicle.states) || is_in(vehicle.inputs)           ? 0
                              : name.ends_with("_ref_m") || name.ends_with("_ref_rad") ? 1
                              : name.starts_with("sensed_") || is_in(vehicle.measured) ? 2
                              : name.starts_with("commanded_")                         ? 3
                                                                                       : 4;
    topics[topic].columns.push_back({c, name, JsonText(name)});
  }
  std::erase_if(topics, [](const SignalTopic& topic) { return topic.columns.empty(); });
  return topics;
}

std::string JsonSchemaOf(const SignalTopic& topic) {
  Json schema = {{"title", "tiltproof." + topic.type}, {"type", "object"}};
  Json& properties = schema["properties"];
  properties["time_ns"] = {{"type", "integer"}};
  for (const auto& column : topic.columns) {
    properties[column.name] = {{"type", "number"}};
    const std::string unit = SignalNamed(column.name, SignalFrame::kNone).unit;
    if (!unit.empty()) properties[column.name]["description"] = unit;
  }
  schema["required"] = {"time_ns"};
  return JsonText(schema);
}

std::string IdlOf(const SignalTopic& topic) {
  std::string members;
  std::set<std::string> taken = {"time_ns"};
  for (const auto& column : topic.columns)
    members += fmt::format("    double {};\n", Identifier(column.name, taken));
  return fmt::format("module tiltproof {{\n  @final struct {} {{\n    long long time_ns;\n{}  }};\n}};\n",
                     topic.type, members);
}

std::string ToJsonMessage(const SignalTopic& topic, TimeNs time_ns, std::span<const double> row) {
  std::string text = fmt::format(R"({{"time_ns":{})", time_ns);
  std::array<char, 32> number;
  for (const auto& column : topic.columns) {
    CheckIndex(column.place, row.size(), "a row has each column of its trace");
    const double value = row[column.place];
    if (!std::isfinite(value)) continue;
    const auto end = std::to_chars(number.data(), number.data() + number.size(), value).ptr;
    text += fmt::format(",{}:{}", column.key,
                        std::string_view(number.data(), static_cast<std::size_t>(end - number.data())));
  }
  return text + "}";
}

std::string ToCdrMessage(const SignalTopic& topic, TimeNs time_ns, std::span<const double> row) {
  dds::CdrWriter writer;
  writer.Put(time_ns);
  for (const auto& column : topic.columns) {
    CheckIndex(column.place, row.size(), "a row has each column of its trace");
    writer.Put(row[column.place]);
  }
  return writer.bytes();
}

}  // namespace tiltproof::harness
