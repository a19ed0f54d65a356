// One reply of 16 sensors and its frame, as the codec's tests use them: known bytes, with escapes and with
// many zeros in it.
#pragma once

#include "firmware/signals.h"
#include "tests/support/slow_codec.h"

namespace tiltproof::testing {

inline Sensors SampleSensors() {
  Sensors sensors;
  sensors.x_m = 2.0F;
  sensors.z_m = 0.5F;
  sensors.roll_rad = 0.9921875F;  // 3F7E0000: a flag inside
  sensors.pitch_rad = -0.015625F;
  sensors.yaw_rad = 3.140625F;
  sensors.alpha_l_rad = -0.0625F;
  sensors.vx_m_s = 0.2470703125F;  // 3E7D0000: an escape inside
  sensors.vy_m_s = -1.5F;
  sensors.wx_rad_s = 0.0009765625F;
  sensors.wz_rad_s = -0.125F;
  sensors.alpha_r_rad_s = 0.75F;
  sensors.alpha_l_rad_s = 0.00390625F;
  return sensors;
}

// Worked out from IEEE 754 and the protocol's description, not with this codec.
inline constexpr char kSampleSensorsHex[] =
    "00000040000000000000003f00007e3f000080bc0000494000000000000080bd"
    "00007d3e0000c0bf000000000000803a00000000000000be0000403f0000803b";
inline constexpr char kSampleFrameHex[] =
    "7e00000040000000000000003f00007d5e3f000080bc0000494000000000000080bd"
    "00007d5d3e0000c0bf000000000000803a00000000000000be0000403f0000803b33f67e";

}  // namespace tiltproof::testing
