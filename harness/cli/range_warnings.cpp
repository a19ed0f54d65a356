#include "harness/cli/range_warnings.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "harness/protocol/line_load.h"
#include "harness/reference/trajectory.h"
#include "harness/scenario/protocol_file.h"

namespace tiltproof::harness {
namespace {

// "the range -3.2768 to 3.2767 of the message 'state' (quad.yaml:12:9)".
std::string RangeText(const BeyondRange& beyond, const std::string& place) {
  return fmt::format("the range {:.6g} to {:.6g} of the message '{}'{}", beyond.carried.low,
                     beyond.carried.high, beyond.message->name, place.empty() ? "" : " (" + place + ")");
}

std::string OutcomeText(const BeyondRange& beyond) {
  if (beyond.refused) return "the receiver refuses the message; widen the field's `min` and `max`";
  return fmt::format("it is sent as {:.6g}; raise the field's `scale`, or take a larger type",
                     std::clamp(beyond.value, beyond.carried.low, beyond.carried.high));
}

// The directions of lines that carry less than the protocol sends.
std::vector<std::string> SlowLines(const Scenario& scenario) {
  std::vector<std::string> warnings;
  const link::Protocol& protocol = *scenario.link.protocol;
  const double period_ms = static_cast<double>(protocol.control_period_ns) / kNsPerMs;
  for (const link::Direction direction : link::kDirections) {
    const bool is_reference = direction == link::Direction::kReference;
    const link::LineRate rate = is_reference ? scenario.link.reference_rate() : scenario.link.main_rate();
    if (rate.baud == 0) continue;
    const double time_ms = LineTime_s(LineLoadOf(protocol, direction).bytes, rate) * 1e3;
    if (time_ms <= period_ms) continue;
    warnings.push_back(
        fmt::format("{}: at {} baud the messages {} of the protocol '{}' take {:.6g} ms, longer than its "
                    "control period of {:g} ms: raise `{}`, or send less",
                    scenario.link_place, rate.baud, Name(direction), protocol.name, time_ms, period_ms,
                    is_reference ? "reference_baud" : "baud"));
  }
  return warnings;
}

}  // namespace

std::string FieldPlace(const std::filesystem::path& protocol_file, const link::MessageType& message,
                       const link::MessageField& field) {
  if (protocol_file.empty()) return {};
  const auto mark = PlaceOfField(LoadProtocolFile(protocol_file).root, message.name, field.signal);
  return mark ? fmt::format("{}:{}:{}", protocol_file.string(), mark->line, mark->column) : std::string();
}

std::vector<std::string> HoverWarnings(const link::Protocol& protocol,
                                       const std::filesystem::path& protocol_file,
                                       const plant::VehicleModel& model) {
  std::vector<std::string> warnings;
  for (const BeyondRange& beyond : HoverBeyondRange(protocol, model.signals(), model.HoverInput())) {
    const std::string place = FieldPlace(protocol_file, *beyond.message, *beyond.field);
    warnings.push_back(fmt::format(
        "{}: {}: hover of the vehicle '{}' needs {:.6g}, beyond {}: it cannot hover with this protocol; {}",
        place.empty() ? protocol.name : place, beyond.field->signal, model.name, beyond.value,
        RangeText(beyond, ""), OutcomeText(beyond)));
  }
  return warnings;
}

std::vector<std::string> RangeWarnings(const Scenario& scenario, const plant::VehicleModel& model) {
  std::vector<std::string> warnings = HoverWarnings(*scenario.link.protocol, scenario.protocol_file, model);
  for (const BeyondRange& beyond : PathBeyondRange(scenario, model.signals())) {
    const std::string when = beyond.at_start ? "" : fmt::format(" at {:g} s", ToSeconds(beyond.time_ns));
    warnings.push_back(
        fmt::format("{}: {}: {} = {:.6g}{} is beyond {}: {}",
                    beyond.at_start ? scenario.initial_place : scenario.reference_place,
                    beyond.at_start ? "initial" : "reference", beyond.field->signal, beyond.value, when,
                    RangeText(beyond, FieldPlace(scenario.protocol_file, *beyond.message, *beyond.field)),
                    OutcomeText(beyond)));
  }
  if (const std::vector<std::string> unheard = UnheardReference(scenario); !unheard.empty())
    warnings.push_back(
        fmt::format("{}: reference: it changes {}, and no reference message of the protocol '{}' carries "
                    "that: a firmware "
                    "does not hear of it",
                    scenario.reference_place, fmt::join(unheard, " and "), scenario.link.protocol->name));
  const std::vector<std::string> slow = SlowLines(scenario);
  warnings.insert(warnings.end(), slow.begin(), slow.end());
  return warnings;
}

}  // namespace tiltproof::harness
