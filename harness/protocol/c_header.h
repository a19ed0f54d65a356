// The C header of a protocol: messages as structs, their frames, and a reader of a stream, for a firmware of any kind.
//
//   const std::string text = CHeader(*FindProtocol("paper"));   // paper_reader, paper_send_actuators(), ...
//
// The header accepts and produces the bytes that the protocol itself does (link/protocol.h, link/framing.h); a test
// compares both on random messages and on damaged streams. A value of 8 or 16 bits, or an unscaled f32, is a float in
// its struct, because a float holds it. All other values are doubles. Scaled values are computed in double precision,
// so that the bytes are those of the harness.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "link/protocol.h"

namespace tiltproof::harness {

// C99 and C++11, freestanding: it includes <stddef.h> and <stdint.h> only. The protocol must be laid out.
std::string CHeader(const link::Protocol& protocol);

// The names in the header: of the protocol, in front of all others ("paper"); of each message; of each field.
std::string CPrefix(const link::Protocol& protocol);
std::vector<std::string> CMessageNames(const link::Protocol& protocol);
std::vector<std::string> CFieldNames(const link::MessageType& type);
// The type of the field's member: "float", "double", "uint16_t", ...
std::string_view CFieldType(const link::MessageField& field);

}  // namespace tiltproof::harness
