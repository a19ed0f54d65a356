// A flight as MCAP: signals, what the faults did, the frames of the lines, events, and the verdict; times are those of the
// flight. In lockstep messages are JSON with JSON Schema. In real time they are the messages of the bus: CDR, with the
// types of harness/dds/tiltproof.idl. The vehicle in space is in Foxglove's own messages (harness/export/flight_scene.h), in
// JSON for both.
//
//   WriteMcap(flight, vehicle, McapTypes::kJson, [&](std::string_view bytes) { file.Write(bytes); });
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string_view>

#include "harness/export/recorded_flight.h"
#include "harness/report/flight_view.h"

namespace tiltproof::harness {

enum class McapTypes : std::uint8_t { kJson, kIdl };

// `vehicle`: none when its file cannot be read; then only its axes are shown.
void WriteMcap(const RecordedFlight& flight, const std::optional<VehicleShape>& vehicle, McapTypes types,
               const std::function<void(std::string_view)>& sink);

}  // namespace tiltproof::harness
