#include "firmware/failover/role_protocol.h"

#include <algorithm>
#include <array>
#include <limits>

namespace tiltproof::firmware {
namespace {

using enum Role;

// Rows: roles by number; columns: events in their order.
constexpr std::array<std::array<Role, kRoleEventCount>, kRoleCount> kRoleAfter = {{
    // clang-format off
    //             kNothing  kNoClaim  kPeerLost kPeerWeak kPeerPrecedes kAway     kLinkBad  kLinkGood
    /* standby */ {kStandby, kActive,  kActive,  kActive,  kStandby,     kStandby, kFailed,  kStandby},
    /* active  */ {kActive,  kActive,  kActive,  kActive,  kStandby,     kStandby, kActive,  kActive},
    /* failed  */ {kFailed,  kFailed,  kFailed,  kFailed,  kFailed,      kFailed,  kFailed,  kStandby},
    // clang-format on
}};

template <class Number>
void Count(Number& number) {
  if (number < std::numeric_limits<Number>::max()) ++number;
}

}  // namespace

Role RoleAfter(Role role, RoleEvent event) {
  return kRoleAfter[static_cast<std::size_t>(role)][static_cast<std::size_t>(event)];
}

Heartbeat RoleProtocol::BeginPeriod(TimeNs now, bool link_good) {
  const bool was_away = own_.period_ns && now - *own_.period_ns > kLease_ns;
  own_.period_ns = now;
  own_.link_good = link_good;
  Count(own_.silent_periods);
  if (own_.peer && !IsLost())
    Count(own_.idle_periods);
  else
    own_.idle_periods = 0;
  if (own_.role == kActive) Count(own_.claim_age);
  if (was_away && own_.role == kActive) On(RoleEvent::kAway);
  Decide();
  return {.sequence = own_.sequence++,
          .echo = own_.peer ? own_.peer->sequence : std::uint16_t{0},
          .claim_age = own_.claim_age,
          .heard = own_.peer.has_value(),
          .role = own_.role,
          .link_good = own_.link_good,
          .keeps = own_.keeps,
          .ready = own_.ready};
}

void RoleProtocol::Hear(const Heartbeat& heartbeat) {
  if (!own_.peer && heartbeat.heard) ContinueAfter(heartbeat.echo);
  own_.peer = heartbeat;
  own_.silent_periods = 0;
  if (heartbeat.role == kActive) own_.idle_periods = 0;
  // Only now do the ages of both claims belong to one instant.
  if (own_.role == kActive && heartbeat.role == kActive && PeerPrecedes(heartbeat))
    On(RoleEvent::kPeerPrecedes);
  Decide();
}

void RoleProtocol::NoteLinkGood() {
  if (own_.link_good) return;
  own_.link_good = true;
  Decide();
}

bool RoleProtocol::IsLost() const {
  return own_.silent_periods >= (own_.peer ? kLostPeriods : kListenPeriods[own_.is_second ? 1 : 0]);
}

bool RoleProtocol::IsFresh(const Heartbeat& heartbeat) const {
  return heartbeat.heard && static_cast<std::uint16_t>(own_.sequence - heartbeat.echo) <= kFreshEchoPeriods;
}

// The peer may have heard this board before its reset. Numbers of that time must not look like those that are fresh.
void RoleProtocol::ContinueAfter(std::uint16_t number) {
  constexpr std::uint16_t kFar = 4 * kFreshEchoPeriods;
  const auto ahead = static_cast<std::uint16_t>(own_.sequence - number);
  if (ahead < kFar || ahead >= 0x8000) own_.sequence = static_cast<std::uint16_t>(number + kFar);
}

// Both claim. Only one of the boards may answer true, also when their answers come at different times.
bool RoleProtocol::PeerPrecedes(const Heartbeat& peer) {
  if (!IsFresh(peer)) return false;
  if (own_.link_good != peer.link_good) return peer.link_good;
  if (own_.is_second) return peer.keeps;
  if (!own_.keeps && peer.claim_age > own_.claim_age) return true;
  own_.keeps = true;
  return false;
}

RoleEvent RoleProtocol::Next() const {
  if (own_.role == kActive) return RoleEvent::kNothing;
  if (!own_.link_good) return RoleEvent::kLinkBad;
  if (own_.role == kFailed) return RoleEvent::kLinkGood;
  if (IsLost()) return RoleEvent::kPeerLost;
  if (!own_.peer) return RoleEvent::kNothing;
  if (PeerClaims()) return own_.peer->link_good ? RoleEvent::kNothing : RoleEvent::kPeerWeak;
  return IsNext() ? RoleEvent::kNoClaim : RoleEvent::kNothing;
}

// A board that was just reset has lost its integrals: one that has them goes before it. Otherwise the first board does.
bool RoleProtocol::IsNext() const {
  const bool goes_first = own_.ready != own_.peer->ready ? own_.ready : !own_.is_second;
  return goes_first || own_.idle_periods >= kLostPeriods;
}

void RoleProtocol::Decide() {
  Role before;
  do {
    before = own_.role;
    On(Next());
  } while (own_.role != before);
  own_.ready = own_.ready || own_.role == kActive || follows();
}

void RoleProtocol::On(RoleEvent event) {
  const Role before = own_.role;
  own_.role = RoleAfter(before, event);
  if (event == RoleEvent::kAway) {
    // All that it has heard is old.
    own_.peer.reset();
    own_.silent_periods = 0;
  }
  if (own_.role == before) return;
  own_.claim_age = 0;
  own_.idle_periods = 0;
  own_.keeps = false;
}

}  // namespace tiltproof::firmware
