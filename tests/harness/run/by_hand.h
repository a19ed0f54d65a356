// Parts of flights by hand: the shipped vehicle, frames as a client sends them, and a fault on frames.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "faults/fault.h"
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

// A fault on the frames of both directions, from 1 s on.
inline faults::FaultSpec OnFrames(const char* type,
                                  std::map<std::string, faults::ParameterValue> parameters) {
  faults::FaultSpec fault;
  fault.id = "fault";
  fault.type = type;
  fault.target = faults::Target::kBoth;
  fault.start_ns = kNsPerS;
  fault.parameters = std::move(parameters);
  return fault;
}

}  // namespace tiltproof::harness
