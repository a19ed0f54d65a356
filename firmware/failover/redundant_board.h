// One of several boards on a vehicle: its role among them, and the integrals that keep their commands together.
//
//   RedundantBoard board(Redundancy::kFailover, 0, port);
//   board.Receive(Uart::kCross, bytes);
//   if (const auto integrals = board.TakeIntegrals(law.integrals())) law.SetIntegrals(*integrals);
//   board.BeginPeriod(now, law.integrals());     // once per control period: sends to the other boards
//   board.NoteReply();                           // a valid reply of the vehicle
//
// `failover`: two boards, one line. The protocol is role_protocol.h. A standby takes the integrals of the active board from
// each of its messages, so that its commands go on where those of the active one end.
//
// `triplex`: three boards, two lines each, every board flies. Each takes the median of all three integrals. A board that was
// reset thus has those of the two others in the next period; without this its commands would stay off for good, because the
// others hold the vehicle and its own integrals see no error. When it hears one board only, it takes that board's during
// its first second.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "firmware/control_law.h"
#include "firmware/failover/cross_line.h"
#include "firmware/failover/role_protocol.h"
#include "firmware/port.h"

namespace tiltproof::firmware {

enum class Redundancy : std::uint8_t { kNone, kFailover, kTriplex };

// Control periods without a valid reply after which the link to the vehicle is bad.
inline constexpr std::uint8_t kLinkLostPeriods = 3;
// Control periods of a board of `triplex` in which it may take the integrals of one other board.
inline constexpr std::uint32_t kYoungPeriods = 83;

class RedundantBoard {
 public:
  // `place`: of the board among them, from 0. `port` must outlive it.
  RedundantBoard(Redundancy redundancy, std::size_t place, Port& port);

  void Receive(Uart uart, std::span<const std::uint8_t> bytes);
  void BeginPeriod(TimeNs now, const Integrals& own);
  void NoteReply();
  // The integrals to go on with, if others than `own`.
  std::optional<Integrals> TakeIntegrals(const Integrals& own);
  Role role() const;
  // False for a board of `failover` that has neither claimed nor followed since its power-on: without integrals, its
  // commands would differ from those of the other board, whose model of the vehicle would see that as a fault.
  bool commands() const { return redundancy_ != Redundancy::kFailover || roles_.memory().ready; }

 private:
  struct Peer {
    CrossMessage message;
    std::uint8_t silent_periods = kLostPeriods;  // since it came
    bool is_new = false;
  };

  bool LinkGood() const { return heard_vehicle_ && silent_periods_ <= kLinkLostPeriods; }
  Integrals Together(const Integrals& own) const;

  Redundancy redundancy_;
  RoleProtocol roles_;  // of failover
  std::array<CrossLine, 2> lines_;
  std::array<Peer, 2> peers_;
  std::uint32_t age_ = 0;  // control periods with a good link, for triplex
  std::uint16_t sequence_ = 0;
  bool heard_vehicle_ = false;
  std::uint8_t silent_periods_ = 0;  // without a valid reply
};

}  // namespace tiltproof::firmware
