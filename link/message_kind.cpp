#include "link/message_kind.h"

namespace tiltproof::link {

// "..."sv knows its length; a plain literal needs strlen() where nothing is optimised.
using namespace std::string_view_literals;

std::string_view Name(MessageKind kind) {
  switch (kind) {
    case MessageKind::kStart:
      return "start"sv;
    case MessageKind::kRequest:
      return "request"sv;
    case MessageKind::kActuators:
      return "actuators"sv;
    case MessageKind::kReply:
      return "reply"sv;
    case MessageKind::kReference:
      return "reference"sv;
    case MessageKind::kStreamed:
      return "streamed"sv;
    case MessageKind::kOther:
      return "other"sv;
    case MessageKind::kUnknown:
      return "unknown"sv;
  }
  return "unknown"sv;
}

std::string_view Name(MessageStatus status) {
  switch (status) {
    case MessageStatus::kOk:
      return "ok"sv;
    case MessageStatus::kBadLength:
      return "bad_length"sv;
    case MessageStatus::kUnknownId:
      return "unknown_id"sv;
    case MessageStatus::kNotFinite:
      return "not_finite"sv;
    case MessageStatus::kOutOfRange:
      return "out_of_range"sv;
    case MessageStatus::kStale:
      return "stale"sv;
  }
  return "unknown"sv;
}

}  // namespace tiltproof::link
