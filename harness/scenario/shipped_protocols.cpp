#include "harness/scenario/shipped_protocols.h"

#include <array>
#include <string>
#include <utility>

#include "harness/scenario/protocol_file.h"
#include "link/check.h"
#include "link/embedded_file.h"

TILTPROOF_EMBED(tiltproof_paper_protocol, TILTPROOF_PROTOCOLS_FOLDER "/paper.yaml")
TILTPROOF_EMBED(tiltproof_provant_protocol, TILTPROOF_PROTOCOLS_FOLDER "/provant.yaml")
TILTPROOF_EMBED(tiltproof_hardened_protocol, TILTPROOF_PROTOCOLS_FOLDER "/hardened.yaml")

namespace tiltproof::harness {
namespace {

constexpr std::array<std::string_view, 3> kNames = {"paper", "provant", "hardened"};

std::shared_ptr<const link::Protocol> Shipped(std::string_view text, bool any_vehicle) {
  link::Protocol protocol = *ParseProtocolFile(std::string(text), "link/protocols").protocol;
  protocol.any_vehicle = any_vehicle;
  return std::make_shared<const link::Protocol>(std::move(protocol));
}

}  // namespace

std::span<const std::string_view> ShippedProtocolNames() { return kNames; }

std::span<const std::shared_ptr<const link::Protocol>> ShippedProtocols() {
  static const std::array kProtocols = {Shipped(TILTPROOF_EMBEDDED(tiltproof_paper_protocol), true),
                                        Shipped(TILTPROOF_EMBEDDED(tiltproof_provant_protocol), false),
                                        Shipped(TILTPROOF_EMBEDDED(tiltproof_hardened_protocol), true)};
  return kProtocols;
}

std::shared_ptr<const link::Protocol> FindProtocol(std::string_view name) {
  for (const auto& protocol : ShippedProtocols())
    if (protocol->name == name) return protocol;
  return nullptr;
}

}  // namespace tiltproof::harness
