// Maps the values of a message to a row of signals and back: units, axes, quaternions. Names are looked up once, when a
// flight is loaded.
//
//   const MessageBinding sensors(protocol, *protocol.Find("sensors"), vehicle.sensors, scenario.angular_rates);
//   protocol.Encode(sensors.type(), sensors.Values(row));
//
// Signals are in the axes of the vehicle: x east, y north, z up, and x forward, y left, z up. A protocol may have them
// in others (link::WorldAxes, link::BodyAxes). With R the attitude of the body in the world, T and B the rotations to
// the protocol's axes, a message carries T v, B v and the angles and the quaternion of T R B^T:
//
//   vectors of the world  north, east, down     positions, velocities, angular rates about the world's axes
//   vectors of the body   forward, right, down  acc, gyro, mag, angular rates about the body's axes
//   angles                roll, -pitch, pi/2 - yaw in NED and FRD; in one of the two alone, roll + pi
//
// Angles that change are within (-pi, pi]. Quaternions are w, x, y, z with w >= 0, and turn a vector of the body into the
// world. Angles of servos, torques and GNSS readings do not change.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "harness/scenario/scenario.h"
#include "link/protocol.h"
#include "link/signal_table.h"

namespace tiltproof::harness {

class MessageBinding {
 public:
  // `rates`: the frame of wx_rad_s, wy_rad_s and wz_rad_s in rows of the table. Throws std::invalid_argument for a field
  // that the table has no value for. `type` must outlive it.
  MessageBinding(const link::Protocol& protocol, const link::MessageType& type, const SignalTable& signals,
                 AngularRates rates = AngularRates::kWorld);

  const link::MessageType& type() const { return *type_; }

  // The message's values, taken from a row. Numbers and times of messages (harness/run/message_order.h) are 0.
  std::vector<double> Values(std::span<const double> row) const;
  // Writes the values of an actuator message into a row of inputs. Inputs that it does not carry stay unchanged.
  void Put(std::span<const double> values, std::span<double> row) const;

  // A field's value is factor * row[place] + offset, or is computed as `how` says.
  struct Part {
    enum class How : std::uint8_t {
      kCopy,
      kLinear,
      kAngle,
      kQuaternion,
      kShareOfSpeed,
      kStamp
    } how = How::kCopy;
    std::size_t place = 0;  // kQuaternion: of w, x, y, z
    double factor = 1.0, offset = 0.0;
  };

 private:
  const link::MessageType* type_;
  std::vector<Part> parts_;
  std::vector<Part> attitude_;  // roll, pitch, yaw; empty: the message has no quaternion
};

// The table of the vehicle, or of the reference, whose signals the message carries.
const SignalTable& TableOf(const link::MessageType& type, const VehicleSignals& vehicle);

// The reason that the protocol does not suit the vehicle: a message carries what the vehicle does not have, or the
// actuator messages together lack one of its inputs. Empty when the protocol suits it. Then `field` stays null; else it
// becomes the first field that the vehicle cannot fill, with its message, if there is one.
using ProtocolField = std::pair<const link::MessageType*, const link::MessageField*>;
std::string UnsuitableProtocol(const link::Protocol& protocol, const VehicleSignals& vehicle,
                               ProtocolField* field = nullptr);

}  // namespace tiltproof::harness
