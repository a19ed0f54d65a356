#include "firmware/failover/redundant_board.h"

#include <algorithm>

namespace tiltproof::firmware {
namespace {

constexpr std::uint8_t kSilentMax = 0xFF;

float Median(float a, float b, float c) { return std::max(std::min(a, b), std::min(std::max(a, b), c)); }

}  // namespace

RedundantBoard::RedundantBoard(Redundancy redundancy, std::size_t place, Port& port)
    : redundancy_(redundancy),
      roles_(place),
      lines_{CrossLine(Uart::kCross, port), CrossLine(Uart::kSecondCross, port)} {}

void RedundantBoard::Receive(Uart uart, std::span<const std::uint8_t> bytes) {
  const std::size_t which = uart == Uart::kCross ? 0 : 1;
  lines_[which].Receive(bytes, [&](const CrossMessage& message) {
    peers_[which] = {.message = message, .silent_periods = 0, .is_new = true};
    if (redundancy_ == Redundancy::kFailover && which == 0) roles_.Hear(message.heartbeat);
  });
}

void RedundantBoard::BeginPeriod(TimeNs now, const Integrals& own) {
  if (silent_periods_ < kSilentMax) ++silent_periods_;
  for (Peer& peer : peers_)
    if (peer.silent_periods < kSilentMax) ++peer.silent_periods;
  if (redundancy_ == Redundancy::kFailover) {
    lines_[0].Send(now, {.heartbeat = roles_.BeginPeriod(now, LinkGood()), .integrals = own});
    return;
  }
  if (LinkGood()) ++age_;
  const Heartbeat heartbeat = {
      .sequence = sequence_++, .claim_age = age_, .role = role(), .link_good = LinkGood()};
  for (CrossLine& line : lines_) line.Send(now, {.heartbeat = heartbeat, .integrals = own});
}

void RedundantBoard::NoteReply() {
  heard_vehicle_ = true;
  silent_periods_ = 0;
  roles_.NoteLinkGood();
}

std::optional<Integrals> RedundantBoard::TakeIntegrals(const Integrals& own) {
  bool has_new = false;
  for (Peer& peer : peers_) {
    has_new = has_new || peer.is_new;
    peer.is_new = false;
  }
  if (!has_new) return std::nullopt;
  if (redundancy_ == Redundancy::kTriplex) return Together(own);
  if (!roles_.follows()) return std::nullopt;
  return peers_[0].message.integrals;
}

Integrals RedundantBoard::Together(const Integrals& own) const {
  const auto counts = [](const Peer& peer) {
    return peer.silent_periods < kLostPeriods && peer.message.heartbeat.link_good;
  };
  const Peer& first = peers_[0];
  const Peer& second = peers_[1];
  if (counts(first) && counts(second)) {
    Integrals together;
    for (std::size_t i = 0; i < kIntegralCount; ++i)
      together[i] = Median(own[i], first.message.integrals[i], second.message.integrals[i]);
    return together;
  }
  const Peer& other = counts(first) ? first : second;
  const bool follows = counts(other) && age_ < kYoungPeriods && other.message.heartbeat.claim_age > age_;
  return follows ? other.message.integrals : own;
}

Role RedundantBoard::role() const {
  if (redundancy_ == Redundancy::kFailover) return roles_.role();
  if (!heard_vehicle_) return Role::kStandby;
  return LinkGood() ? Role::kActive : Role::kFailed;
}

}  // namespace tiltproof::firmware
