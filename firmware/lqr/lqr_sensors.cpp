#include "firmware/lqr/lqr_sensors.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tiltproof::firmware {
namespace {

using Names = std::array<std::string_view, 3>;
constexpr Names kPosition = {"x_m", "y_m", "z_m"}, kVelocity = {"vx_m_s", "vy_m_s", "vz_m_s"},
                kAttitude = {"roll_rad", "pitch_rad", "yaw_rad"},
                kRates = {"wx_rad_s", "wy_rad_s", "wz_rad_s"},
                kGyro = {"gyro_x_rad_s", "gyro_y_rad_s", "gyro_z_rad_s"};
constexpr std::array<std::string_view, 4> kQuaternion = {"quaternion_w", "quaternion_x", "quaternion_y",
                                                         "quaternion_z"};

std::optional<std::size_t> AxisOf(const Names& names, std::string_view signal) {
  for (std::size_t axis = 0; axis < names.size(); ++axis)
    if (names[axis] == signal) return axis;
  return std::nullopt;
}

bool IsNed(const link::Protocol& protocol) { return protocol.world == link::WorldAxes::kNed; }
bool IsFrd(const link::Protocol& protocol) { return protocol.body == link::BodyAxes::kFrd; }

using Matrix = std::array<std::array<double, 3>, 3>;

// The rotation of a quaternion of any length, w x y z.
Matrix RotationOf(const std::array<double, 4>& q) {
  const auto [w, x, y, z] = q;
  const double s = 2 / (w * w + x * x + y * y + z * z);
  return {{{1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)},
           {s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)},
           {s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)}}};
}

}  // namespace

LqrSensors::LqrSensors(const link::Protocol& protocol, const std::vector<std::string>& states,
                       RatesAxes rates)
    : protocol_(protocol), values_(protocol.messages.size()), needed_(protocol.messages.size()) {
  for (const std::string& state : states) {
    const std::optional<Source> source = SourceOf(state, rates);
    if (!source) {
      missing_.push_back(state);
      continue;
    }
    sources_.push_back(*source);
    if (!source->of_quaternion) {
      needed_[source->place.message] = true;
    } else {
      for (const Place& place : quaternion_) needed_[place.message] = true;
    }
  }
}

bool LqrSensors::Needs(const link::MessageType& type) const {
  return needed_[static_cast<std::size_t>(&type - protocol_.messages.data())];
}

std::optional<LqrSensors::Place> LqrSensors::Find(std::string_view signal) const {
  for (std::size_t message = 0; message < protocol_.messages.size(); ++message) {
    const link::MessageType& type = protocol_.messages[message];
    if (type.direction != link::Direction::kToClient) continue;
    for (std::size_t field = 0; field < type.fields.size(); ++field)
      if (type.fields[field].signal == signal) return Place{message, field};
  }
  return std::nullopt;
}

std::optional<LqrSensors::Source> LqrSensors::SourceOf(const std::string& state, RatesAxes rates) {
  for (const Names& vector : {kPosition, kVelocity})
    if (const auto axis = AxisOf(vector, state)) return VectorSource(vector, *axis, true);
  if (const auto angle = AxisOf(kAttitude, state)) return AngleSource(*angle);
  if (const auto axis = AxisOf(kRates, state)) {
    if (!Find(state)) {
      rates_from_gyro_ = true;
      return VectorSource(kGyro, *axis, false);
    }
    if (rates != RatesAxes::kEuler) return VectorSource(kRates, *axis, rates == RatesAxes::kWorld);
    return Source{.place = *Find(state), .sign = IsNed(protocol_) && *axis > 0 ? -1.0 : 1.0};
  }
  const auto place = Find(state);
  if (!place) return std::nullopt;
  return Source{.place = *place};
}

std::optional<LqrSensors::Source> LqrSensors::VectorSource(const Names& vector, std::size_t axis,
                                                           bool is_world) const {
  // East is the second of north, east, down.
  const std::size_t from = is_world && IsNed(protocol_) && axis < 2 ? 1 - axis : axis;
  const bool turns = is_world ? IsNed(protocol_) && axis == 2 : IsFrd(protocol_) && axis > 0;
  const auto place = Find(vector[from]);
  if (!place) return std::nullopt;
  return Source{.place = *place, .sign = turns ? -1.0 : 1.0};
}

std::optional<LqrSensors::Source> LqrSensors::AngleSource(std::size_t angle) {
  if (const auto place = Find(kAttitude[angle])) {
    Source source{.place = *place};
    if (angle == 0 && IsNed(protocol_) != IsFrd(protocol_)) source.offset = -std::numbers::pi;
    if (angle > 0 && IsNed(protocol_)) source.sign = -1;
    if (angle == 2 && IsNed(protocol_)) source.offset = std::numbers::pi / 2;
    source.is_angle = source.offset != 0;
    return source;
  }
  for (std::size_t i = 0; i < kQuaternion.size(); ++i) {
    const auto place = Find(kQuaternion[i]);
    if (!place) return std::nullopt;
    quaternion_[i] = *place;
  }
  return Source{.of_quaternion = angle};
}

void LqrSensors::Accept(const link::Message& message) {
  values_[static_cast<std::size_t>(message.type - protocol_.messages.data())] = message.values;
}

bool LqrSensors::complete() const {
  for (std::size_t message = 0; message < needed_.size(); ++message)
    if (needed_[message] && values_[message].empty()) return false;
  return true;
}

// With T and B the rotations from the vehicle's axes to the protocol's, the quaternion is that of T R B^T, and T and B
// are their own inverses.
std::array<double, 3> LqrSensors::AnglesOfQuaternion() const {
  const Matrix sent =
      RotationOf({At(quaternion_[0]), At(quaternion_[1]), At(quaternion_[2]), At(quaternion_[3])});
  Matrix R;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column) {
      double value = sent[IsNed(protocol_) && row < 2 ? 1 - row : row][column];
      if (IsNed(protocol_) && row == 2) value = -value;
      if (IsFrd(protocol_) && column > 0) value = -value;
      R[row][column] = value;
    }
  }
  return {std::atan2(R[2][1], R[2][2]), std::asin(std::clamp(-R[2][0], -1.0, 1.0)),
          std::atan2(R[1][0], R[0][0])};
}

std::array<float, kLqrSensedMax> LqrSensors::States() const {
  std::array<float, kLqrSensedMax> states{};
  std::optional<std::array<double, 3>> angles;
  for (std::size_t i = 0; i < sources_.size() && i < states.size(); ++i) {
    const Source& source = sources_[i];
    if (source.of_quaternion) {
      if (!angles) angles = AnglesOfQuaternion();
      states[i] = static_cast<float>((*angles)[*source.of_quaternion]);
      continue;
    }
    double value = source.sign * At(source.place);
    if (source.is_angle) value = std::remainder(value + source.offset, 2 * std::numbers::pi);
    states[i] = static_cast<float>(value);
  }
  return states;
}

void ReadReference(const link::Protocol& protocol, const link::Message& message, Reference& reference) {
  // Each field of the reference, and the signal that it comes from.
  struct Part {
    float Reference::*member;
    std::string_view enu, ned;
    double sign = 1, offset = 0;  // in NED
  };
  static constexpr std::array<Part, 7> kParts = {
      {{&Reference::x_m, "x_m", "y_m"},
       {&Reference::y_m, "y_m", "x_m"},
       {&Reference::z_m, "z_m", "z_m", -1},
       {&Reference::yaw_rad, "yaw_rad", "yaw_rad", -1, std::numbers::pi / 2},
       {&Reference::vx_m_s, "vx_m_s", "vy_m_s"},
       {&Reference::vy_m_s, "vy_m_s", "vx_m_s"},
       {&Reference::vz_m_s, "vz_m_s", "vz_m_s", -1}}};
  for (const Part& part : kParts) {
    for (std::size_t i = 0; i < message.values.size(); ++i) {
      if (message.type->fields[i].signal != (IsNed(protocol) ? part.ned : part.enu)) continue;
      const double value = message.values[i];
      reference.*part.member = static_cast<float>(IsNed(protocol) ? part.sign * value + part.offset : value);
    }
  }
}

}  // namespace tiltproof::firmware
