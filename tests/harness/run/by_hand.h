// Parts of flights by hand: the shipped vehicle, and frames as a client sends them.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "firmware/messages.h"
#include "link/frame.h"
#include "link/message_kind.h"
#include "plant/vehicle_model.h"

namespace tiltproof::harness {

inline const plant::VehicleModel& Model() {
  static const plant::VehicleModel model = [] {
    std::vector<std::string> warnings;
    return plant::LoadVehicle(std::string(TILTPROOF_SOURCE_DIR) + "/plant/models/tiltrotor.sdf", {},
                              warnings);
  }();
  return model;
}

inline std::vector<std::uint8_t> FrameOf(const link::MessageBytes& message) {
  std::array<std::uint8_t, link::FrameBytesMax(link::kMessageBytesMax)> wire;
  const auto frame = link::EncodeFrame(message.span(), wire).bytes;
  return {frame.begin(), frame.end()};
}

}  // namespace tiltproof::harness
