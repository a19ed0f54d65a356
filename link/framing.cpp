#include "link/framing.h"

#include <algorithm>
#include <array>

#include "link/check.h"

namespace tiltproof::link {

std::string_view Name(ByteRole role) {
  static constexpr std::array<std::string_view, 7> kNames = {"flag",   "escape",  "code", "sync",
                                                             "length", "payload", "check"};
  return kNames.at(static_cast<std::size_t>(role));
}

bool Framing::Has(ByteRole role) const {
  // A payload of special bytes needs all that the framing has against them.
  const std::vector<ByteRole> roles = Roles(Encode(special_bytes()));
  return std::ranges::find(roles, role) != roles.end();
}

std::vector<std::uint8_t> Framing::Encode(std::span<const std::uint8_t> payload, std::uint32_t damage) const {
  constexpr std::size_t kUsualBytes = 160;
  std::vector<std::uint8_t> frame;
  frame.reserve(kUsualBytes);
  const std::span<const std::uint8_t> front = opening();
  frame.assign(front.begin(), front.end());
  AppendBehindOpening(payload, damage, frame);
  return frame;
}

std::unique_ptr<FrameCutter> Framing::MakeCutter() const {
  const std::optional<FrameEnd> end = frame_end();
  Check(end.has_value(), "a framing tells where its frames end");
  return MakeFrameCutter(*end);
}

std::optional<FrameEnd> Framing::frame_end() const {
  const std::optional<std::uint8_t> own = flag();
  return own ? std::optional<FrameEnd>(*own) : std::nullopt;
}

std::string Framing::ChangeUnseen(std::span<std::uint8_t> /*bytes*/, std::uint32_t /*way*/) const {
  ThrowBrokenInvariant("a framing whose check has a blind spot");
}

void CheckedFraming::AppendChecked(std::span<const std::uint8_t> payload, std::uint32_t damage,
                                   std::vector<std::uint8_t>& to) const {
  to.insert(to.end(), payload.begin(), payload.end());
  const std::uint32_t check = Checksum(kind_, payload) ^ damage;
  for (std::size_t i = 0; i < check_bytes(); ++i) to.push_back(CheckByte(kind_, check, i));
}

std::optional<FrameParts> CheckedFraming::SplitChecked(std::span<const std::uint8_t> content) const {
  if (content.size() < check_bytes()) return std::nullopt;
  const auto payload = content.first(content.size() - check_bytes());
  FrameParts parts{.payload = {payload.begin(), payload.end()}};
  parts.damage = LoadCheck(kind_, content.last(check_bytes())) ^ Checksum(kind_, payload);
  return parts;
}

void CheckedFraming::MarkCheck(std::span<const std::size_t> places, std::vector<ByteRole>& roles) const {
  for (const std::size_t place : places.last(std::min(places.size(), check_bytes())))
    if (roles[place] == ByteRole::kPayload) roles[place] = ByteRole::kCheck;
}

std::size_t CountFlags(const Framing& framing, std::span<const std::uint8_t> bytes) {
  const std::optional<std::uint8_t> flag = framing.flag();
  std::size_t count = 0;
  while (flag && count < bytes.size() && bytes[count] == *flag) ++count;
  return count;
}

}  // namespace tiltproof::link
