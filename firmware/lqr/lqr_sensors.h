// The states of the law from the server's messages, whatever their axes and whatever they carry in place of a state.
//
//   LqrSensors sensors(protocol, {"x_m", "y_m"}, RatesAxes::kWorld);
//   if (!sensors.missing().empty()) return;                   // the protocol does not carry these states
//   sensors.Accept(message);                                  // for each accepted one
//   if (sensors.complete()) law.Step(sensors.States(), reference, command);
//
// States are in the axes of the vehicle: x east, y north, z up; x forward, y left, z up. Roll, pitch and yaw may come
// from quaternion_w, _x, _y, _z, and the angular rates from gyro_x_rad_s, _y_, _z_, which are about the body's axes.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/lqr/lqr_law.h"
#include "firmware/signals.h"
#include "link/protocol.h"

namespace tiltproof::firmware {

// Axes of the sensed angular rates: about the world's axes, the body's, or derivatives of roll, pitch and yaw.
enum class RatesAxes : unsigned char { kWorld, kBody, kEuler };

class LqrSensors {
 public:
  // `protocol` must outlive it.
  LqrSensors(const link::Protocol& protocol, const std::vector<std::string>& states, RatesAxes rates);

  // States that no message carries.
  const std::vector<std::string>& missing() const { return missing_; }
  // True if a state comes from a message of that type.
  bool Needs(const link::MessageType& type) const;
  bool rates_from_gyro() const { return rates_from_gyro_; }

  void Accept(const link::Message& message);
  // True once each message that is needed has come.
  bool complete() const;
  // In the order of the states.
  std::array<float, kLqrSensedMax> States() const;

 private:
  // A field of one of the server's messages.
  struct Place {
    std::size_t message, field;
  };
  // A state is sign * value + offset, or an angle of the quaternion.
  struct Source {
    Place place{};
    double sign = 1, offset = 0;
    bool is_angle = false;
    std::optional<std::size_t> of_quaternion = {};  // 0 roll, 1 pitch, 2 yaw
  };

  std::optional<Place> Find(std::string_view signal) const;
  std::optional<Source> SourceOf(const std::string& state, RatesAxes rates);
  std::optional<Source> VectorSource(const std::array<std::string_view, 3>& vector, std::size_t axis,
                                     bool is_world) const;
  std::optional<Source> AngleSource(std::size_t angle);
  double At(const Place& place) const { return values_[place.message][place.field]; }
  std::array<double, 3> AnglesOfQuaternion() const;

  const link::Protocol& protocol_;
  std::vector<std::vector<double>> values_;  // last, of each message type; empty: none has come
  std::vector<Source> sources_;
  std::vector<bool> needed_;  // by message type
  std::array<Place, 4> quaternion_{};
  std::vector<std::string> missing_;
  bool rates_from_gyro_ = false;
};

// A reference in the axes of the vehicle. What the message does not carry stays.
void ReadReference(const link::Protocol& protocol, const link::Message& message, Reference& reference);

}  // namespace tiltproof::firmware
