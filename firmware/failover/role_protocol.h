// Roles of two boards on one vehicle: which one claims it. Pure: no clock, no input and no output.
//
//   RoleProtocol roles(0);                                   // the first board of two
//   const Heartbeat said = roles.BeginPeriod(now, link_good);  // once per control period; send it to the peer
//   roles.Hear(received);                                    // each heartbeat of the peer
//   if (roles.role() == Role::kActive) ...
//
// A standby claims when it has not heard the peer for kLostPeriods, or when the peer has a bad link to the vehicle and its
// own is good. An active board keeps its claim until it notices that it did not run for longer than kLease_ns, or until the
// peer's claim precedes.
//
// While the line between the boards is lost, both may claim, because no two boards can decide alone. An arbiter keeps the
// claim in force, which is the elder one. So the younger claim ends when the boards hear each other again. The ages of two
// claims come from two clocks, and their messages take time. So only the first board compares them, and tells its decision
// with `keeps`. It decides on heartbeats that answer a recent one of its own only: a late one shows a claim that may be over.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "link/time.h"

namespace tiltproof::firmware {

// The numbers are those of tiltproof_client_role.
enum class Role : std::uint8_t { kStandby = 0, kActive = 1, kFailed = 2 };
inline constexpr std::size_t kRoleCount = 3;

// Control periods without a heartbeat after which the peer counts as lost: the usual time-out of an arbiter.
inline constexpr std::uint8_t kLostPeriods = 3;
// The same before the first heartbeat, of the first and the second board. They differ, so that both do not claim at once
// when the line is lost from the beginning.
inline constexpr std::uint8_t kListenPeriods[2] = {3, 6};
// A heartbeat is fresh when it answers one that was sent at most so many control periods ago.
inline constexpr std::uint16_t kFreshEchoPeriods = 2;
// An active board that did not run for longer has lost its claim: an arbiter has dropped it.
inline constexpr TimeNs kLease_ns = 36 * kNsPerMs;

// State of a board, as its peer gets it once per control period.
struct Heartbeat {
  std::uint16_t sequence = 0;   // counts the sender's since its power-on
  std::uint16_t echo = 0;       // the number of the last one that the sender took, if `heard`
  std::uint32_t claim_age = 0;  // control periods since the sender's claim
  bool heard = false;
  Role role = Role::kStandby;
  bool link_good = false;  // the sender gets valid replies
  bool keeps = false;      // the sender has compared both claims: its own precedes
  bool ready = false;      // the sender has claimed, or followed a claim, since its power-on
  friend bool operator==(const Heartbeat&, const Heartbeat&) = default;
};

enum class RoleEvent : std::uint8_t {
  kNothing,
  kNoClaim,       // the peer is there, and neither board claims
  kPeerLost,      // not heard any more
  kPeerWeak,      // the peer claims with a bad link
  kPeerPrecedes,  // both claim, and the peer's claim is the one to stay
  kAway,          // this board did not run for a while
  kLinkBad,
  kLinkGood
};
inline constexpr std::size_t kRoleEventCount = 8;

Role RoleAfter(Role role, RoleEvent event);

// All that a board remembers of its role and its peer: plain data, so that a test can explore every state.
struct RoleMemory {
  bool is_second = false;
  Role role = Role::kStandby;
  bool link_good = false;
  bool keeps = false;
  bool ready = false;
  std::uint8_t silent_periods = 0;  // since the last heartbeat
  std::uint8_t idle_periods = 0;    // in which neither claimed
  std::uint16_t sequence = 0;       // of the next heartbeat
  std::uint32_t claim_age = 0;      // of an active board
  std::optional<TimeNs> period_ns;  // begin of the present one
  std::optional<Heartbeat> peer;    // the last one; none before, and after this board was away
  friend bool operator==(const RoleMemory&, const RoleMemory&) = default;
};

class RoleProtocol {
 public:
  // `place`: 0 for the first board, 1 for the second. A reset makes a new one.
  explicit RoleProtocol(std::size_t place) { own_.is_second = place != 0; }
  explicit RoleProtocol(const RoleMemory& memory) : own_(memory) {}

  // Begins a control period. `link_good`: valid replies come. Returns the heartbeat to send at once.
  Heartbeat BeginPeriod(TimeNs now, bool link_good);
  // A heartbeat of the peer. A late one is taken, too: the next one comes within a period.
  void Hear(const Heartbeat& heartbeat);
  // A valid reply has come: the link is good, before the next period begins.
  void NoteLinkGood();

  Role role() const { return own_.role; }
  // True while the peer is heard and claims, and this board does not: the peer's integrals are to be followed.
  bool follows() const { return own_.role != Role::kActive && PeerClaims(); }
  const RoleMemory& memory() const { return own_; }

 private:
  bool IsLost() const;
  bool PeerClaims() const { return own_.peer && !IsLost() && own_.peer->role == Role::kActive; }
  bool IsFresh(const Heartbeat& heartbeat) const;
  void ContinueAfter(std::uint16_t number);
  bool PeerPrecedes(const Heartbeat& peer);
  RoleEvent Next() const;
  bool IsNext() const;
  void Decide();
  void On(RoleEvent event);

  RoleMemory own_;
};

}  // namespace tiltproof::firmware
