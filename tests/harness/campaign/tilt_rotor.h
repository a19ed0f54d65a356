// The signals of the shipped vehicle, as far as these tests name them.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "link/signal_table.h"

namespace tiltproof::harness {

inline VehicleSignals TiltRotorSignals() {
  const auto table = [](std::vector<std::string> names) {
    std::vector<Signal> signals;
    for (std::string& name : names) signals.push_back(SignalNamed(std::move(name), SignalFrame::kNone));
    return SignalTable(std::move(signals));
  };
  VehicleSignals signals;
  signals.sensors = table({"x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad", "vx_m_s", "vy_m_s",
                           "vz_m_s", "wx_rad_s", "wy_rad_s", "wz_rad_s"});
  signals.states = signals.sensors;
  signals.inputs = table({"f_r_n", "f_l_n", "tau_r_nm", "tau_l_nm"});
  return signals;
}

}  // namespace tiltproof::harness
