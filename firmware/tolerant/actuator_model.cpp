#include "firmware/tolerant/actuator_model.h"

#include <algorithm>

#include "firmware/tolerant/vehicle_parameters.h"

namespace tiltproof::firmware {

Actuators ActuatorModel::Delivered(const Actuators& command) const {
  return {.f_r_n = rotor_effectiveness[0] * command.f_r_n,
          .f_l_n = rotor_effectiveness[1] * command.f_l_n,
          .tau_r_nm = servo_effectiveness[0] * command.tau_r_nm + servo_offset_nm[0],
          .tau_l_nm = servo_effectiveness[1] * command.tau_l_nm + servo_offset_nm[1]};
}

Actuators ActuatorModel::CommandFor(const Actuators& wanted) const {
  constexpr float kForceMax_n = kTiltrotorConstants.force_max_n;
  constexpr float kTorqueMax_nm = kTiltrotorConstants.torque_max_nm;
  const float missing_n = std::max({0.0F, wanted.f_r_n - rotor_effectiveness[0] * kForceMax_n,
                                    wanted.f_l_n - rotor_effectiveness[1] * kForceMax_n});
  const auto torque_nm = [&](unsigned i, float wanted_nm) {
    return std::clamp((wanted_nm - servo_offset_nm[i]) / servo_effectiveness[i], -kTorqueMax_nm,
                      kTorqueMax_nm);
  };
  return {.f_r_n = std::clamp((wanted.f_r_n - missing_n) / rotor_effectiveness[0], 0.0F, kForceMax_n),
          .f_l_n = std::clamp((wanted.f_l_n - missing_n) / rotor_effectiveness[1], 0.0F, kForceMax_n),
          .tau_r_nm = torque_nm(0, wanted.tau_r_nm),
          .tau_l_nm = torque_nm(1, wanted.tau_l_nm)};
}

bool ActuatorModel::LacksThrustFor(const Actuators& wanted) const {
  constexpr float kForceMax_n = kTiltrotorConstants.force_max_n;
  return wanted.f_r_n > rotor_effectiveness[0] * kForceMax_n ||
         wanted.f_l_n > rotor_effectiveness[1] * kForceMax_n;
}

bool ActuatorModel::CanDeliver(const Actuators& wanted) const {
  const auto can = [&](unsigned i, float wanted_nm) {
    const float command_nm = (wanted_nm - servo_offset_nm[i]) / servo_effectiveness[i];
    return command_nm >= -kTiltrotorConstants.torque_max_nm &&
           command_nm <= kTiltrotorConstants.torque_max_nm;
  };
  return !LacksThrustFor(wanted) && wanted.f_r_n >= 0 && wanted.f_l_n >= 0 && can(0, wanted.tau_r_nm) &&
         can(1, wanted.tau_l_nm);
}

}  // namespace tiltproof::firmware
