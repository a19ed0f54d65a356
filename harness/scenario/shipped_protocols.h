// The shipped protocols: the files in link/protocols, which are parts of the program.
//
//   const std::shared_ptr<const link::Protocol> hardened = FindProtocol("hardened");
//
// "paper" is the paper's (section 2.1, Figure 3), "provant" that of the authors' published server, and "hardened" the
// paper's with sequence, time stamp and CRC-32.
#pragma once

#include <memory>
#include <span>
#include <string_view>

#include "link/protocol.h"

namespace tiltproof::harness {

std::span<const std::string_view> ShippedProtocolNames();
std::span<const std::shared_ptr<const link::Protocol>> ShippedProtocols();
// Null when there is no protocol of that name.
std::shared_ptr<const link::Protocol> FindProtocol(std::string_view name);

}  // namespace tiltproof::harness
