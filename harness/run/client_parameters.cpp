#include "harness/run/client_parameters.h"

#include <fmt/format.h>

#include <optional>
#include <utility>
#include <vector>

#include "harness/client/make_client.h"
#include "plant/dynamics.h"

namespace tiltproof::harness {
namespace {

// A JSON string. Names have no control characters; any other becomes a space.
std::string Quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return quoted + '"';
}

std::string JoinedBy(const std::vector<std::string>& items) {
  std::string text;
  for (const std::string& item : items) text += (text.empty() ? "" : ", ") + item;
  return "[" + text + "]";
}

// The value of each state in hover, in the order of the states.
std::vector<double> HoverStates(const plant::Hover& hover) {
  const plant::Coordinates<double> q = plant::HoverCoordinates(hover);
  std::vector<double> row(q.data(), q.data() + q.size());
  row.resize(2 * row.size(), 0.0);
  return row;
}

std::string SignalsText(const Scenario& scenario, const plant::VehicleModel& model) {
  const VehicleSignals signals = model.signals();
  const std::vector<double> hover = HoverStates(model.hover);
  std::vector<std::string> items;
  for (const link::MessageField& field : scenario.link.protocol->Find(link::MessageKind::kReply)->fields) {
    const auto state = signals.states.Find(field.signal);
    items.push_back(fmt::format(R"({{"name": {}, "unit": {}, "hover": {}}})", Quoted(field.signal),
                                Quoted(state ? signals.states[*state].unit : ""),
                                state && *state < hover.size() ? hover[*state] : 0.0));
  }
  return JoinedBy(items);
}

std::string InputsText(const plant::VehicleModel& model) {
  const VehicleSignals signals = model.signals();
  std::vector<std::string> items;
  for (std::size_t i = 0; i < signals.inputs.size(); ++i) {
    const Signal& input = signals.inputs[i];
    items.push_back(fmt::format(R"({{"name": {}, "unit": {}, "min": {}, "max": {}, "hover": {}}})",
                                Quoted(input.name), Quoted(input.unit), input.min, input.max,
                                model.HoverInput().at(i)));
  }
  return JoinedBy(items);
}

std::string GainText(const plant::GainMatrix& gain) {
  std::vector<std::string> rows;
  for (Eigen::Index i = 0; i < gain.rows(); ++i) {
    std::vector<std::string> row;
    for (Eigen::Index j = 0; j < gain.cols(); ++j) row.push_back(fmt::format("{}", gain(i, j)));
    rows.push_back(JoinedBy(row));
  }
  return JoinedBy(rows);
}

}  // namespace

plant::GainMatrix GainOf(const Scenario& scenario, const plant::VehicleModel& model) {
  const Eigen::Index columns = 2 * plant::CoordinateCount(model) + plant::kIntegralCount;
  if (!scenario.gain_file.empty())
    return plant::ReadGainCsv(scenario.gain_file, plant::InputCount(model), columns);
  return plant::DesignGain(model, ToSeconds(scenario.link.protocol->control_period_ns));
}

std::string ClientParameters(const Scenario& scenario, const plant::VehicleModel& model, std::size_t client) {
  std::string gain = "null";
  try {
    gain = GainText(GainOf(scenario, model));
  } catch (const plant::DesignError&) {
    if (scenario.firmware_of(client) == kLqrBuild || !scenario.gain_file.empty()) throw;
  }
  return fmt::format(
      "{{\"vehicle\": {{\"name\": {}, \"model\": {}, \"mass_kg\": {}}},\n \"control_period_s\": {},\n"
      " \"angular_rates\": \"{}\",\n \"signals\": {},\n \"inputs\": {},\n \"gain\": {}}}\n",
      Quoted(model.name), Quoted(scenario.model), model.MassTotal(),
      ToSeconds(scenario.link.protocol->control_period_ns), Name(scenario.angular_rates),
      SignalsText(scenario, model), InputsText(model), gain);
}

}  // namespace tiltproof::harness
