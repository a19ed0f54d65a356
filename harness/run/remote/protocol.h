// The messages between the harness and its processes in a lockstep flight: a request, then any number of
// upcalls (the firmware transmits, the firmware logs), then one answer.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "harness/client/make_client.h"
#include "harness/run/archive.h"
#include "harness/run/line.h"
#include "harness/run/plant_server.h"
#include "harness/run/record_stream.h"
#include "link/fields.h"
#include "link/protocol.h"

namespace tiltproof::harness {

enum class Message : std::uint8_t {
  // Requests.
  kSetup,
  kWriteTotals,
  kQuit,
  kTransmit,
  kTakePiece,
  kSetOrigin,
  kAdvance,
  kServe,
  kSendOwn,
  kFinish,
  kHear,
  kRole,
  kStart,
  kReceive,
  kGrant,
  kCommand,
  kAddCommands,
  kStatus,
  kSample,
  // Upcalls of the client.
  kClientTransmits,
  kClientLogs,
  kClientEvent,
  // Answers.
  kDone,
  kFailed,          // text
  kFirmwareFailed,  // hung, text, end: FirmwareTrouble
};

// The harness's message to a process before the flight.
struct Setup {
  std::string scenario_yaml;
  std::string client;     // as --client names it
  std::size_t place = 0;  // among the scenario's clients: of the process's client or line
  bool steered = false;   // more faults may come on its line
  TILTPROOF_FIELDS(scenario_yaml, client, place, steered)
};

// State that the line's process answers besides the result, so that the harness need not ask, and a batch of its records.
struct LineView {
  std::array<BootTime, link::kDirectionCount> next_arrival_ns{BootTime::Never(), BootTime::Never(),
                                                              BootTime::Never()};
  LineCounts counts{};
  std::optional<Overfull> overfull;
  std::vector<faults::FaultEvent> events;
  std::vector<std::uint8_t> records;  // PackedRecords
  TILTPROOF_FIELDS(next_arrival_ns, counts, overfull, events, records)
};

// A frame that the server sends by itself.
struct FrameTo {
  std::size_t client = 0;
  std::vector<std::uint8_t> frame;
  TILTPROOF_FIELDS(client, frame)
};

// A link::Message: both processes have the scenario, and so the protocol's table.
struct PackedMessage {
  std::string type;
  std::vector<double> values;
  TILTPROOF_FIELDS(type, values)
};
inline PackedMessage Packed(const link::Message& message) { return {message.type->name, message.values}; }
inline link::Message Unpacked(const PackedMessage& packed, const link::Protocol& protocol) {
  const link::MessageType* type = protocol.Find(packed.type);
  if (type == nullptr || packed.values.size() != type->fields.size())
    throw std::runtime_error("a message that the protocol does not have");
  return {type, packed.values};
}

}  // namespace tiltproof::harness
