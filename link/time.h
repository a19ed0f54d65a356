// Time is a count of nanoseconds, and is always passed in: no code below the real-time adapters reads a
// clock.
//
// There are two times, and mixing them does not compile:
//
//   BootTime  a line's, a client's and a node's clock: since power-on in lockstep, the machine's monotonic clock in
//             real time
//   TimeNs    simulation time, and durations. Simulation time t = 0 is when the server accepts the client's `start`
//             (arrival of its last byte); what happened before has negative time
//
// An Origin, the boot time of t = 0, converts one into the other:
//
//   Origin origin(arrival_of_start);
//   log(origin.SimulationTime(arrival));
//   wake_at(origin.ToBootTime(fault.start_ns));
#pragma once

#include <compare>
#include <cstdint>
#include <limits>

namespace tiltproof {

// Simulation time, or a duration.
using TimeNs = std::int64_t;

inline constexpr TimeNs kNsPerUs = 1'000;
inline constexpr TimeNs kNsPerMs = 1'000'000;
inline constexpr TimeNs kNsPerS = 1'000'000'000;

// Later than everything; "never" as the end of a window.
inline constexpr TimeNs kNever = std::numeric_limits<TimeNs>::max();
// Earlier than everything, power-on included.
inline constexpr TimeNs kPowerOn = std::numeric_limits<TimeNs>::min();

// An instant of a clock that runs before t = 0 is known.
class BootTime {
 public:
  constexpr BootTime() = default;
  constexpr explicit BootTime(std::int64_t ns) : ns_(ns) {}

  // Later than everything; "never" as a wake-up or arrival time.
  static constexpr BootTime Never() { return BootTime(kNever); }
  // Earlier than everything, power-on included.
  static constexpr BootTime Earliest() { return BootTime(kPowerOn); }

  // The clock's reading as a plain number.
  constexpr std::int64_t ns() const { return ns_; }

  constexpr BootTime& operator+=(TimeNs duration) { return *this = *this + duration; }
  friend constexpr BootTime operator+(BootTime t, TimeNs duration) { return BootTime(t.ns_ + duration); }
  friend constexpr BootTime operator-(BootTime t, TimeNs duration) { return BootTime(t.ns_ - duration); }
  friend constexpr TimeNs operator-(BootTime to, BootTime from) { return to.ns_ - from.ns_; }
  // NOLINTNEXTLINE(modernize-use-nullptr): the 0 that the compiler writes is not ours.
  friend constexpr auto operator<=>(BootTime, BootTime) = default;

 private:
  std::int64_t ns_ = 0;
};

// The boot time of t = 0, once it is known.
class Origin {
 public:
  constexpr Origin() = default;
  constexpr explicit Origin(BootTime of_t0) : of_t0_(of_t0) {}

  constexpr bool known() const { return of_t0_ != BootTime::Never(); }
  // Never() before it is known.
  constexpr BootTime boot_time() const { return of_t0_; }

  // kPowerOn for Earliest(), and for every time before the origin is known.
  constexpr TimeNs SimulationTime(BootTime t) const {
    return t == BootTime::Earliest() || !known() ? kPowerOn : t - of_t0_;
  }
  // For a known origin. kNever becomes Never().
  constexpr BootTime ToBootTime(TimeNs t) const { return t == kNever ? BootTime::Never() : of_t0_ + t; }

  // Without t = 0 there is no simulation time: what is logged then has the time since power-on.
  constexpr Origin OrPowerOn() const { return known() ? *this : Origin(BootTime()); }

  friend constexpr bool operator==(Origin, Origin) = default;

 private:
  BootTime of_t0_ = BootTime::Never();
};

// Nearest nanosecond (half away from zero) of a finite time in seconds, |s| < 9e9.
constexpr TimeNs FromSeconds(double s) {
  const double ns = s * 1e9;
  return static_cast<TimeNs>(ns < 0 ? ns - 0.5 : ns + 0.5);
}
constexpr double ToSeconds(TimeNs t) { return static_cast<double>(t) / 1e9; }

}  // namespace tiltproof
