#include "harness/cli/protocol_flag.h"

#include <fmt/format.h>

#include <filesystem>
#include <string_view>

#include "harness/cli/commands.h"
#include "harness/scenario/diagnostic.h"
#include "harness/scenario/did_you_mean.h"
#include "harness/scenario/protocol_file.h"
#include "harness/scenario/shipped_protocols.h"

namespace tiltproof::harness {

std::shared_ptr<const link::Protocol> ReadProtocolFlag(const std::string& text, std::string_view flag) {
  if (auto protocol = FindProtocol(text)) return protocol;
  if (!std::filesystem::is_regular_file(text))
    throw UsageError(fmt::format("{}{}: no such protocol or file{}", flag, text,
                                 DidYouMean(text, ShippedProtocolNames())));
  try {
    return ReadProtocolFile(text);
  } catch (const ScenarioError& error) {
    throw UsageError(error.what());
  }
}

std::string FieldText(const link::MessageField& field, double value) {
  if (link::IsInteger(field.type) && field.scale == 1.0) return fmt::format("{:.0f}", value);
  return field.type == link::NumberType::kF64 ? fmt::format("{}", value) : fmt::format("{:.9g}", value);
}

std::string MessageText(const link::Protocol& protocol, link::Direction direction,
                        std::span<const std::uint8_t> payload) {
  const link::MessageType* type = protocol.Classify(direction, payload);
  if (type == nullptr) return "";
  std::string text = type->name;
  for (std::size_t i = 0; i < type->fields.size(); ++i) {
    const link::MessageField& field = type->fields[i];
    text += fmt::format(" {}={}", field.signal, FieldText(field, link::FieldValue(*type, payload, i)));
    if (field.as == link::ThrustUnit::kShare) text += " (share)";
    if (field.as == link::ThrustUnit::kShareOfSpeed) text += " (share of speed)";
  }
  return text;
}

}  // namespace tiltproof::harness
