#include "harness/dds/participant.h"

#include <string_view>

namespace tiltproof::dds {
namespace {

constexpr std::string_view kDigits = "0123456789abcdef";

}  // namespace

std::string ToText(const Participant& participant) {
  std::string text;
  for (const std::uint8_t byte : participant.guid) {
    text += kDigits[byte >> 4];
    text += kDigits[byte & 15];
  }
  return text;
}

std::optional<Participant> ParticipantNamed(const std::string& text) {
  Participant participant;
  if (text.size() != 2 * participant.guid.size()) return std::nullopt;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto digit = kDigits.find(text[i]);
    if (digit == std::string_view::npos) return std::nullopt;
    auto& byte = participant.guid[i / 2];
    byte = static_cast<std::uint8_t>(std::size_t{byte} << 4U | digit);
  }
  return participant;
}

void Circle::Admit(const Participant& participant, const std::string& node_id) {
  const std::lock_guard lock(mutex_);
  node_ids_[participant] = node_id;
}

void Circle::Expel(const Participant& participant) {
  const std::lock_guard lock(mutex_);
  node_ids_.erase(participant);
}

void Circle::Clear() {
  const std::lock_guard lock(mutex_);
  node_ids_.clear();
}

std::optional<std::string> Circle::NodeId(const Participant& participant) const {
  const std::lock_guard lock(mutex_);
  const auto found = node_ids_.find(participant);
  if (found == node_ids_.end()) return std::nullopt;
  return found->second;
}

}  // namespace tiltproof::dds
