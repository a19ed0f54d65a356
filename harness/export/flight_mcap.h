// A flight as MCAP: signals, what the faults did, the frames of the lines, events, and the verdict; times are those of the
// flight. In lockstep messages are JSON with JSON Schema. In real time they are the messages of the bus: CDR, with the
// types of harness/dds/tiltproof.idl.
//
//   WriteMcap(flight, McapTypes::kJson, [&](std::string_view bytes) { file.Write(bytes); });
#pragma once

#include <cstdint>
#include <functional>
#include <string_view>

#include "harness/export/recorded_flight.h"

namespace tiltproof::harness {

enum class McapTypes : std::uint8_t { kJson, kIdl };

void WriteMcap(const RecordedFlight& flight, McapTypes types,
               const std::function<void(std::string_view)>& sink);

}  // namespace tiltproof::harness
