// The protocol that --protocol names, and the messages in its payloads as text.
//
//   const std::shared_ptr<const link::Protocol> protocol = ReadProtocolFlag("paper");
//   MessageText(*protocol, link::Direction::kReference, payload);  // "reference x_m=0 y_m=0 z_m=2 ..."
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "link/protocol.h"

namespace tiltproof::harness {

// `text` is a built-in protocol or a protocol file. Throws UsageError, which names the flag; an argument has none.
std::shared_ptr<const link::Protocol> ReadProtocolFlag(const std::string& text,
                                                       std::string_view flag = "--protocol ");

// A field's value in the unit that its signal's name ends in, with as many digits as it has on the line.
std::string FieldText(const link::MessageField& field, double value);

// The message and its values. A thrust that is sent as a share has this behind it. Empty: the payload is no message of
// the protocol in that direction.
std::string MessageText(const link::Protocol& protocol, link::Direction direction,
                        std::span<const std::uint8_t> payload);

}  // namespace tiltproof::harness
