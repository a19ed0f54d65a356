// link::Protocols(): the files in link/protocols, as parts of the program.
#include <algorithm>
#include <array>

#include "harness/scenario/protocol_file.h"
#include "link/check.h"
#include "link/embedded_file.h"

TILTPROOF_EMBED(tiltproof_paper_protocol, TILTPROOF_PROTOCOLS_FOLDER "/paper.yaml")
TILTPROOF_EMBED(tiltproof_provant_protocol, TILTPROOF_PROTOCOLS_FOLDER "/provant.yaml")
TILTPROOF_EMBED(tiltproof_hardened_protocol, TILTPROOF_PROTOCOLS_FOLDER "/hardened.yaml")

namespace tiltproof {
namespace harness {
namespace {

constexpr std::array<std::string_view, 3> kNames = {"paper", "provant", "hardened"};

std::shared_ptr<const link::Protocol> Shipped(std::string_view text, bool any_vehicle) {
  link::Protocol protocol = *ParseProtocolFile(std::string(text), "link/protocols").protocol;
  protocol.any_vehicle = any_vehicle;
  return std::make_shared<const link::Protocol>(std::move(protocol));
}

}  // namespace

std::span<const std::string_view> ShippedProtocolNames() { return kNames; }

}  // namespace harness

namespace link {

std::span<const std::shared_ptr<const Protocol>> Protocols() {
  static const std::array kProtocols = {
      harness::Shipped(TILTPROOF_EMBEDDED(tiltproof_paper_protocol), true),
      harness::Shipped(TILTPROOF_EMBEDDED(tiltproof_provant_protocol), false),
      harness::Shipped(TILTPROOF_EMBEDDED(tiltproof_hardened_protocol), true)};
  return kProtocols;
}

std::shared_ptr<const Protocol> FindProtocol(std::string_view name) {
  for (const auto& protocol : Protocols())
    if (protocol->name == name) return protocol;
  return nullptr;
}

}  // namespace link
}  // namespace tiltproof
