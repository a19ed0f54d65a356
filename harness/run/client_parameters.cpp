#include "harness/run/client_parameters.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>
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

std::string SignalText(const std::string& name, const std::string& unit, double hover) {
  return fmt::format(R"({{"name": {}, "unit": {}, "hover": {}}})", Quoted(name), Quoted(unit), hover);
}

// Signals of the server's messages, in their order.
std::string SignalsText(const Scenario& scenario, const plant::VehicleModel& model) {
  const VehicleSignals signals = model.signals();
  const std::vector<double> hover = HoverStates(model.hover);
  std::vector<std::string> items;
  for (const link::MessageType& type : scenario.link.protocol->messages) {
    if (type.direction != link::Direction::kToClient) continue;
    for (const link::MessageField& field : type.fields) {
      if (field.content != link::FieldContent::kSignal) continue;
      const auto state = signals.states.Find(field.signal);
      items.push_back(SignalText(field.signal, state ? signals.states[*state].unit : "",
                                 state && *state < hover.size() ? hover[*state] : 0.0));
    }
  }
  return JoinedBy(items);
}

std::string StatesText(const plant::VehicleModel& model) {
  const std::vector<double> hover = HoverStates(model.hover);
  std::vector<std::string> items;
  for (const Signal& state : model.signals().states)
    items.push_back(
        SignalText(state.name, state.unit, items.size() < hover.size() ? hover[items.size()] : 0.0));
  return JoinedBy(items);
}

std::string FieldText(const link::MessageField& field) {
  return fmt::format(
      R"({{"signal": {}, "type": "{}", "byte_order": "{}", "scale": {}, "min": {}, "max": {}, "as": "{}"}})",
      Quoted(field.signal), Name(field.type), Name(field.order), field.scale, field.min, field.max,
      Name(field.as));
}

std::string MessageText(const link::MessageType& type) {
  std::vector<std::string> fields;
  for (const link::MessageField& field : type.fields) fields.push_back(FieldText(field));
  const std::string id = !type.id ? "null"
                                  : fmt::format(R"({{"type": "{}", "byte_order": "{}", "bits": {}}})",
                                                Name(type.id->type), Name(type.id->order), type.id->bits);
  return fmt::format(
      "{{\"name\": {}, \"role\": \"{}\", \"from\": \"{}\", \"line\": \"{}\", \"id\": {}, \"reply\": {}, "
      "\"starts\": {}, \"period_ns\": {},\n   \"fields\": {}}}",
      Quoted(type.name), Name(type.kind), type.direction == link::Direction::kToPlant ? "client" : "server",
      type.direction == link::Direction::kReference ? "reference" : "main", id, Quoted(type.reply),
      type.starts, type.period_ns, JoinedBy(fields));
}

std::string FramingText(const link::Framing& framing) {
  std::string text = fmt::format(R"({{"type": "{}", "check": "{}")", framing.name(),
                                 framing.check() ? Name(*framing.check()) : "");
  if (framing.name() == "length_prefixed") {
    const auto sync = framing.special_bytes();
    const std::size_t length_bytes =
        framing.Encode(std::array<std::uint8_t, 1>{}).size() - sync.size() - framing.check_bytes() - 1;
    text += fmt::format(R"(, "sync": [{}], "length": "{}")", fmt::join(sync, ", "),
                        length_bytes == 2 ? "u16" : "u8");
  }
  return text + "}";
}

std::string ProtocolText(const link::Protocol& protocol) {
  std::vector<std::string> messages;
  for (const link::MessageType& type : protocol.messages) messages.push_back(MessageText(type));
  return fmt::format(
      "{{\"name\": {}, \"framing\": {}, \"world\": \"{}\", \"body\": \"{}\",\n  \"messages\": {}}}",
      Quoted(protocol.name), FramingText(*protocol.framing), Name(protocol.world), Name(protocol.body),
      JoinedBy(messages));
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

std::string VectorText(const Eigen::Vector3d& v) { return fmt::format("[{}, {}, {}]", v[0], v[1], v[2]); }

// `R` and `p`: the body's link frame in the main body's.
std::string BodyText(const plant::RigidBody& body, const Eigen::Matrix3d& R, const Eigen::Vector3d& p) {
  const Eigen::Matrix3d inertia = R * body.inertia_kg_m2 * R.transpose();
  return fmt::format(R"({{"mass_kg": {}, "com_m": {}, "inertia_kg_m2": [{}, {}, {}, {}, {}, {}]}})",
                     body.mass_kg, VectorText(p + R * body.p_com_m), inertia(0, 0), inertia(1, 1),
                     inertia(2, 2), inertia(0, 1), inertia(0, 2), inertia(1, 2));
}

// All in the main body's frame, with the hinges at angle 0.
std::string GeometryText(const plant::VehicleModel& model) {
  std::vector<std::string> hinges, rotors;
  for (const plant::Hinge& hinge : model.hinges)
    hinges.push_back(fmt::format(
        R"({{"point_m": {}, "axis": {}, "angle_min_rad": {}, "angle_max_rad": {}, "servo": "{}", "body": {}}})",
        VectorText(hinge.p_BH_m), VectorText(hinge.axis_B), hinge.angle_min_rad, hinge.angle_max_rad,
        hinge.servo == plant::ServoMode::kTorque ? "torque" : "position",
        BodyText(hinge.body, hinge.R_BT, hinge.p_BT_m)));
  for (const plant::Rotor& rotor : model.rotors) {
    const plant::Hinge* hinge = rotor.hinge ? &model.hinges[*rotor.hinge] : nullptr;
    const Eigen::Vector3d p =
        hinge == nullptr ? rotor.p_LR_m : Eigen::Vector3d(hinge->p_BT_m + hinge->R_BT * rotor.p_LR_m);
    const Eigen::Vector3d axis =
        hinge == nullptr ? rotor.thrust_axis_L : Eigen::Vector3d(hinge->R_BT * rotor.thrust_axis_L);
    rotors.push_back(fmt::format(R"({{"hinge": {}, "point_m": {}, "axis": {}, "drag_ratio_m": {}}})",
                                 rotor.hinge ? std::to_string(*rotor.hinge) : "null", VectorText(p),
                                 VectorText(axis), rotor.direction * rotor.drag_ratio_m));
  }
  return fmt::format("{{\"base\": {},\n  \"hinges\": {},\n  \"rotors\": {}}}",
                     BodyText(model.base, Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero()),
                     JoinedBy(hinges), JoinedBy(rotors));
}

std::string FirmwareParametersText(const Scenario& scenario) {
  std::vector<std::string> items;
  for (const FirmwareParameter& parameter : scenario.firmware_parameters)
    items.push_back(fmt::format("{}: {}", Quoted(parameter.name), parameter.value));
  return fmt::format("{{{}}}", fmt::join(items, ", "));
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

std::vector<std::string> StatesNotCarried(const link::Protocol& protocol, const VehicleSignals& vehicle) {
  const auto is_sent = [&](std::string_view signal) {
    return std::any_of(
        protocol.messages.begin(), protocol.messages.end(), [&](const link::MessageType& type) {
          return type.direction == link::Direction::kToClient &&
                 std::any_of(type.fields.begin(), type.fields.end(),
                             [&](const link::MessageField& field) { return field.signal == signal; });
        });
  };
  // Signals that together are as good as some states.
  struct Substitute {
    std::array<std::string_view, 3> states;
    std::vector<std::string_view> by;
  };
  static const std::array<Substitute, 2> kSubstitutes = {
      {{{"roll_rad", "pitch_rad", "yaw_rad"},
        {"quaternion_w", "quaternion_x", "quaternion_y", "quaternion_z"}},
       {{"wx_rad_s", "wy_rad_s", "wz_rad_s"}, {"gyro_x_rad_s", "gyro_y_rad_s", "gyro_z_rad_s"}}}};
  std::vector<std::string> missing;
  for (const Signal& state : vehicle.states) {
    const bool is_substituted = std::ranges::any_of(kSubstitutes, [&](const Substitute& substitute) {
      return std::ranges::find(substitute.states, state.name) != substitute.states.end() &&
             std::ranges::all_of(substitute.by, is_sent);
    });
    if (!is_sent(state.name) && !is_substituted) missing.push_back(state.name);
  }
  return missing;
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
      " \"angular_rates\": \"{}\",\n \"signals\": {},\n \"inputs\": {},\n \"gain\": {},\n"
      " \"states\": {},\n \"geometry\": {},\n \"client\": {{\"id\": {}, \"place\": {}, \"of\": {}}},\n"
      " \"firmware_parameters\": {},\n \"protocol\": {}}}\n",
      Quoted(model.name), Quoted(scenario.model), model.MassTotal(),
      ToSeconds(scenario.link.protocol->control_period_ns), Name(scenario.angular_rates),
      SignalsText(scenario, model), InputsText(model), gain, StatesText(model), GeometryText(model),
      Quoted(scenario.client_id(client)), client, scenario.client_count(), FirmwareParametersText(scenario),
      ProtocolText(*scenario.link.protocol));
}

}  // namespace tiltproof::harness
