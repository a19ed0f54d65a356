// The signals that cross the line, as named fields in SI units: 16 sensors, 4 actuators, 7 reference
// components.
//
// They exist in two precisions: BasicSensors<double> is the plant's truth, BasicSensors<float> (`Sensors`) is
// what the wire carries (binary32). Code that must walk over all fields uses the tables at the bottom, never
// offsets.
//
//   Sensors s = ...;
//   for (const auto& f : kSensorFields) s.*f.in_float ...
//
// Frames: position of the main body's frame origin in the world frame (z up); attitude as Z-Y-X Euler angles
// of the main body relative to the world (paper, section 3); servo angles about their hinges; rates are time
// derivatives, angular rates of the main body in the world frame unless the scenario asks for body or Euler
// rates.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

namespace tiltproof {

template <class Scalar>
struct BasicSensors {
  Scalar x_m{}, y_m{}, z_m{};
  Scalar roll_rad{}, pitch_rad{}, yaw_rad{};
  Scalar alpha_r_rad{}, alpha_l_rad{};
  Scalar vx_m_s{}, vy_m_s{}, vz_m_s{};
  Scalar wx_rad_s{}, wy_rad_s{}, wz_rad_s{};
  Scalar alpha_r_rad_s{}, alpha_l_rad_s{};
  friend bool operator==(const BasicSensors&, const BasicSensors&) = default;
};

// Thrusts along each thruster's z (N), servo torques about each hinge (N m).
template <class Scalar>
struct BasicActuators {
  Scalar f_r_n{}, f_l_n{}, tau_r_nm{}, tau_l_nm{};
  friend bool operator==(const BasicActuators&, const BasicActuators&) = default;
};

// The base station's message on the second line: position and velocity (x_ref = (x y z 0 0 yaw 0 0 vx vy vz
// 0 ...)).
template <class Scalar>
struct BasicReference {
  Scalar x_m{}, y_m{}, z_m{}, yaw_rad{};
  Scalar vx_m_s{}, vy_m_s{}, vz_m_s{};
  friend bool operator==(const BasicReference&, const BasicReference&) = default;
};

using Sensors = BasicSensors<float>;
using Actuators = BasicActuators<float>;
using Reference = BasicReference<float>;
using SensorsTruth = BasicSensors<double>;
using ActuatorsTruth = BasicActuators<double>;
using ReferenceTruth = BasicReference<double>;

inline constexpr std::size_t kSensorCount = 16;
inline constexpr std::size_t kActuatorCount = 4;
inline constexpr std::size_t kReferenceCount = 7;

template <template <class> class Group>
struct SignalField {
  std::string_view column;  // trace column and scenario name; its unit is its suffix
  float Group<float>::*in_float;
  double Group<double>::*in_double;
};

// The formatter mistakes the templates for comparisons.
// clang-format off
#define TILTPROOF_FIELD(group, name) SignalField<group>{#name, &group<float>::name, &group<double>::name}
// clang-format on

// In wire order (paper, section 2.1; order of the authors' server).
inline constexpr std::array<SignalField<BasicSensors>, kSensorCount> kSensorFields = {
    TILTPROOF_FIELD(BasicSensors, x_m),           TILTPROOF_FIELD(BasicSensors, y_m),
    TILTPROOF_FIELD(BasicSensors, z_m),           TILTPROOF_FIELD(BasicSensors, roll_rad),
    TILTPROOF_FIELD(BasicSensors, pitch_rad),     TILTPROOF_FIELD(BasicSensors, yaw_rad),
    TILTPROOF_FIELD(BasicSensors, alpha_r_rad),   TILTPROOF_FIELD(BasicSensors, alpha_l_rad),
    TILTPROOF_FIELD(BasicSensors, vx_m_s),        TILTPROOF_FIELD(BasicSensors, vy_m_s),
    TILTPROOF_FIELD(BasicSensors, vz_m_s),        TILTPROOF_FIELD(BasicSensors, wx_rad_s),
    TILTPROOF_FIELD(BasicSensors, wy_rad_s),      TILTPROOF_FIELD(BasicSensors, wz_rad_s),
    TILTPROOF_FIELD(BasicSensors, alpha_r_rad_s), TILTPROOF_FIELD(BasicSensors, alpha_l_rad_s),
};
inline constexpr std::array<SignalField<BasicActuators>, kActuatorCount> kActuatorFields = {
    TILTPROOF_FIELD(BasicActuators, f_r_n), TILTPROOF_FIELD(BasicActuators, f_l_n),
    TILTPROOF_FIELD(BasicActuators, tau_r_nm), TILTPROOF_FIELD(BasicActuators, tau_l_nm)};
inline constexpr std::array<SignalField<BasicReference>, kReferenceCount> kReferenceFields = {
    TILTPROOF_FIELD(BasicReference, x_m),    TILTPROOF_FIELD(BasicReference, y_m),
    TILTPROOF_FIELD(BasicReference, z_m),    TILTPROOF_FIELD(BasicReference, yaw_rad),
    TILTPROOF_FIELD(BasicReference, vx_m_s), TILTPROOF_FIELD(BasicReference, vy_m_s),
    TILTPROOF_FIELD(BasicReference, vz_m_s)};

#undef TILTPROOF_FIELD

// Precision change, field by field.
template <template <class> class Group, std::size_t n>
constexpr Group<float> ToFloat(const Group<double>& in, const std::array<SignalField<Group>, n>& fields) {
  Group<float> out;
  for (const auto& field : fields) out.*field.in_float = static_cast<float>(in.*field.in_double);
  return out;
}
template <template <class> class Group, std::size_t n>
constexpr Group<double> ToDouble(const Group<float>& in, const std::array<SignalField<Group>, n>& fields) {
  Group<double> out;
  for (const auto& field : fields) out.*field.in_double = static_cast<double>(in.*field.in_float);
  return out;
}

}  // namespace tiltproof
