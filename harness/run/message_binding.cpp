#include "harness/run/message_binding.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "harness/reference/reference_point.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

using link::FieldContent;
using link::MessageField;
using link::ThrustUnit;
using Part = MessageBinding::Part;

constexpr double kPi = std::numbers::pi;

constexpr std::array<std::string_view, 4> kQuaternion = {"quaternion_w", "quaternion_x", "quaternion_y",
                                                         "quaternion_z"};
using Vector = std::array<std::string_view, 3>;
constexpr std::array<Vector, 2> kWorldVectors = {{{"x_m", "y_m", "z_m"}, {"vx_m_s", "vy_m_s", "vz_m_s"}}};
constexpr Vector kAttitude = {"roll_rad", "pitch_rad", "yaw_rad"},
                 kRates = {"wx_rad_s", "wy_rad_s", "wz_rad_s"};

std::optional<std::size_t> PlaceIn(std::span<const std::string_view> names, std::string_view name) {
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) return std::nullopt;
  return static_cast<std::size_t>(found - names.begin());
}

double WithinHalfTurn(double angle_rad) {
  const double wrapped = std::remainder(angle_rad, 2 * kPi);
  return wrapped <= -kPi ? kPi : wrapped;
}

// A signal that the table lacks, or cannot be in the unit or the axes of the field.
struct Unsuitable {
  std::string missing, reason;  // one of them
};

// Finds the parts of one message's fields. Throws Unsuitable.
class PartFinder {
 public:
  PartFinder(const link::Protocol& protocol, const SignalTable& signals, AngularRates rates)
      : is_ned_(protocol.world == link::WorldAxes::kNed),
        is_frd_(protocol.body == link::BodyAxes::kFrd),
        signals_(signals),
        rates_(rates) {}

  Part Of(const link::MessageType& type, const MessageField& field) const {
    if (field.content != FieldContent::kSignal) return {.how = Part::How::kStamp};
    if (const auto component = PlaceIn(kQuaternion, field.signal)) {
      if (type.direction != link::Direction::kToClient)
        throw Unsuitable{
            {},
            fmt::format("the message '{}' cannot carry '{}': only the server's messages have the attitude",
                        type.name, field.signal)};
      for (const std::string_view angle : kAttitude) Find(angle);
      return {.how = Part::How::kQuaternion, .place = *component};
    }
    const std::size_t place = Find(field.signal);
    if (field.as != ThrustUnit::kNewton) return OfShare(field, place);
    if (!is_ned_ && !is_frd_) return {.place = place};
    return InAxes(place);
  }

  std::vector<Part> Attitude() const {
    std::vector<Part> parts;
    for (const std::string_view angle : kAttitude) parts.push_back(InAxes(Find(angle)));
    return parts;
  }

 private:
  std::size_t Find(std::string_view name) const {
    const auto place = signals_.Find(name);
    if (!place) throw Unsuitable{std::string(name), {}};
    return *place;
  }

  Part OfShare(const MessageField& field, std::size_t place) const {
    const Signal& signal = signals_[place];
    if (signal.frame != SignalFrame::kRotor)
      throw Unsuitable{{}, fmt::format("'{}' is not the thrust of a rotor, and has no share", field.signal)};
    if (!(signal.max > 0) || !std::isfinite(signal.max))
      throw Unsuitable{{},
                       fmt::format("'{}' has no largest thrust above 0, and no share of it", field.signal)};
    return {.how = field.as == ThrustUnit::kShare ? Part::How::kLinear : Part::How::kShareOfSpeed,
            .place = place,
            .factor = 1 / signal.max};
  }

  // The signal at that place in the protocol's axes.
  Part InAxes(std::size_t place) const {
    const std::string& name = signals_[place].name;
    for (const Vector& vector : kWorldVectors)
      if (const auto axis = PlaceIn(vector, name)) return OfWorld(vector, *axis);
    if (const auto angle = PlaceIn(kAttitude, name)) return OfAngle(*angle, place);
    if (const auto axis = PlaceIn(kRates, name)) {
      if (rates_ == AngularRates::kWorld) return OfWorld(kRates, *axis);
      const bool turns = rates_ == AngularRates::kBody ? is_frd_ : is_ned_;
      return Signed(place, turns && *axis > 0);
    }
    if (signals_[place].frame == SignalFrame::kBody)
      return Signed(place, is_frd_ && !IsAlongX(signals_[place]));
    return {.place = place};
  }

  // acc_x_m_s2 of the group acc.
  static bool IsAlongX(const Signal& signal) { return signal.name.starts_with(signal.group + "_x_"); }

  static Part Signed(std::size_t place, bool negative) {
    if (!negative) return {.place = place};
    return {.how = Part::How::kLinear, .place = place, .factor = -1};
  }
  Part OfWorld(const Vector& vector, std::size_t axis) const {
    if (!is_ned_) return {.place = Find(vector[axis])};
    constexpr std::array<std::size_t, 3> kFrom = {1, 0, 2};
    return Signed(Find(vector[kFrom[axis]]), axis == 2);
  }
  Part OfAngle(std::size_t angle, std::size_t place) const {
    if (angle == 0)
      return is_ned_ == is_frd_ ? Part{.place = place}
                                : Part{.how = Part::How::kAngle, .place = place, .offset = kPi};
    if (angle == 1 || !is_ned_) return Signed(place, is_ned_);
    return {.how = Part::How::kAngle, .place = place, .factor = -1, .offset = kPi / 2};
  }

  bool is_ned_, is_frd_;
  const SignalTable& signals_;
  AngularRates rates_;
};

double ValueOf(const Part& part, std::span<const double> row) {
  switch (part.how) {
    case Part::How::kCopy:
      return row[part.place];
    case Part::How::kLinear:
      return part.factor * row[part.place];
    case Part::How::kAngle:
      return WithinHalfTurn(part.factor * row[part.place] + part.offset);
    case Part::How::kShareOfSpeed: {
      const double share = part.factor * row[part.place];
      return std::copysign(std::sqrt(std::abs(share)), share);
    }
    case Part::How::kStamp:
    case Part::How::kQuaternion:
      return 0;
  }
  ThrowBrokenInvariant("a part of a message");
}

// The quaternion of Z-Y-X angles.
std::array<double, 4> QuaternionOf(double roll, double pitch, double yaw) {
  const double cr = std::cos(roll / 2), sr = std::sin(roll / 2), cp = std::cos(pitch / 2),
               sp = std::sin(pitch / 2), cy = std::cos(yaw / 2), sy = std::sin(yaw / 2);
  std::array<double, 4> q = {cy * cp * cr + sy * sp * sr, cy * cp * sr - sy * sp * cr,
                             cy * sp * cr + sy * cp * sr, sy * cp * cr - cy * sp * sr};
  if (q[0] < 0)
    for (double& component : q) component = -component;
  return q;
}

std::string TextOf(const link::MessageType& type, const Unsuitable& why) {
  if (!why.reason.empty()) return why.reason;
  return "message '" + type.name + "' carries the signal '" + why.missing +
         "', which this vehicle does not have";
}

std::string NamesOf(const SignalTable& table) {
  std::string names;
  for (const Signal& signal : table) names += (names.empty() ? "" : ", ") + signal.name;
  return names;
}

void AddOnce(std::vector<std::string>& names, const std::string& name) {
  if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
}

}  // namespace

MessageBinding::MessageBinding(const link::Protocol& protocol, const link::MessageType& type,
                               const SignalTable& signals, AngularRates rates)
    : type_(&type) {
  const PartFinder finder(protocol, signals, rates);
  try {
    for (const MessageField& field : type.fields) parts_.push_back(finder.Of(type, field));
    if (std::any_of(parts_.begin(), parts_.end(),
                    [](const Part& part) { return part.how == Part::How::kQuaternion; }))
      attitude_ = finder.Attitude();
  } catch (const Unsuitable& why) {
    throw std::invalid_argument(TextOf(type, why));
  }
}

std::vector<double> MessageBinding::Values(std::span<const double> row) const {
  std::vector<double> values;
  values.reserve(parts_.size());
  for (const Part& part : parts_) values.push_back(ValueOf(part, row));
  if (attitude_.empty()) return values;
  const std::array<double, 4> q =
      QuaternionOf(ValueOf(attitude_[0], row), ValueOf(attitude_[1], row), ValueOf(attitude_[2], row));
  for (std::size_t i = 0; i < parts_.size(); ++i)
    if (parts_[i].how == Part::How::kQuaternion) values[i] = q[parts_[i].place];
  return values;
}

void MessageBinding::Put(std::span<const double> values, std::span<double> row) const {
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const Part& part = parts_[i];
    switch (part.how) {
      case Part::How::kCopy:
        row[part.place] = values[i];
        break;
      case Part::How::kLinear:
        row[part.place] = values[i] / part.factor;
        break;
      case Part::How::kShareOfSpeed:
        row[part.place] = values[i] * std::abs(values[i]) / part.factor;
        break;
      case Part::How::kStamp:
        break;
      case Part::How::kAngle:
      case Part::How::kQuaternion:
        ThrowBrokenInvariant("an input is no attitude");
    }
  }
}

const SignalTable& TableOf(const link::MessageType& type, const VehicleSignals& vehicle) {
  switch (type.direction) {
    case link::Direction::kToPlant:
      return vehicle.inputs;
    case link::Direction::kToClient:
      return vehicle.sensors;
    case link::Direction::kReference:
      break;
  }
  return ReferenceSignals();
}

std::string UnsuitableProtocol(const link::Protocol& protocol, const VehicleSignals& vehicle,
                               ProtocolField* unsuitable) {
  std::vector<std::string> missing, left_out, reasons;
  for (const link::MessageType& type : protocol.messages) {
    const PartFinder finder(protocol, TableOf(type, vehicle), AngularRates::kWorld);
    for (const MessageField& field : type.fields) {
      try {
        finder.Of(type, field);
      } catch (const Unsuitable& why) {
        if (unsuitable != nullptr && unsuitable->first == nullptr) *unsuitable = {&type, &field};
        if (type.direction == link::Direction::kReference && !why.missing.empty())
          AddOnce(reasons, fmt::format("the message '{}' carries '{}', and a reference has {}", type.name,
                                       why.missing, NamesOf(ReferenceSignals())));
        else
          why.missing.empty() ? AddOnce(reasons, why.reason) : AddOnce(missing, why.missing);
      }
    }
  }
  const auto is_commanded = [&](const std::string& input) {
    return std::any_of(protocol.messages.begin(), protocol.messages.end(),
                       [&](const link::MessageType& type) {
                         return type.kind == link::MessageKind::kActuators &&
                                std::any_of(type.fields.begin(), type.fields.end(),
                                            [&](const MessageField& field) { return field.signal == input; });
                       });
  };
  for (const Signal& input : vehicle.inputs)
    if (!is_commanded(input.name)) left_out.push_back(input.name);
  if (!left_out.empty())
    reasons.insert(reasons.begin(), fmt::format("its actuator message does not carry this vehicle's {}",
                                                fmt::join(left_out, ", ")));
  if (!missing.empty())
    reasons.insert(reasons.begin(), fmt::format("its messages carry {}, which this vehicle does not have",
                                                fmt::join(missing, ", ")));
  if (reasons.empty()) return {};
  return fmt::format("the protocol '{}' does not suit the vehicle: {}", protocol.name,
                     fmt::join(reasons, "; "));
}

}  // namespace tiltproof::harness
