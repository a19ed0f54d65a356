// A test case of a fuzz campaign: what is said on a line, one input in each control period, and the short flight that says
// it. The flight is an ordinary scenario with one fault of type frame.script.
//
//   HostileSequence sequence;
//   sequence.inputs = {{0x7E, 0x7D, 0x7E}, {}};  // the second frame is left as it is
//   const Scenario scenario = FlightOf(base, sequence);
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "faults/fault.h"
#include "harness/campaign/hostile_frames.h"
#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

inline constexpr std::size_t kInputsMax = 256;
// Control periods after the last input, in which the firmware must come to itself; in the second half it is heard.
inline constexpr int kTailPeriods = 50;
// As many that an emulated processor in an endless loop, which neither sleeps nor sends for 2 s, is known to hang.
inline constexpr int kHangTailPeriods = 250;

struct HostileSequence {
  faults::Target target = faults::Target::kToClient;  // or kReference
  std::string place = "instead";                      // of the frame of that period; "before" or "after" it
  std::vector<LineBytes> inputs;                      // empty: the frame is left as it is
  int tail_periods = kTailPeriods;
  friend bool operator==(const HostileSequence&, const HostileSequence&) = default;
};

// Id of the one fault.
inline constexpr std::string_view kHostileFault = "hostile";

// When the first input is said. A firmware that has heard nothing may say `start` again: that is no restart, so the first
// reply is left alone.
TimeNs HostileFrom(const link::Protocol& protocol);
// For a person: "instead of the frame of each period".
std::string PlaceText(const HostileSequence& sequence);
// The parameter `frames`.
std::string FramesText(const HostileSequence& sequence);
// `base` says everything but faults and duration.
Scenario FlightOf(const Scenario& base, const HostileSequence& sequence);
// A flight in which no frame is broken: replies are lost, late, or of another server. What a firmware does here it does by
// design.
Scenario WellFormedFlight(const Scenario& base);
// The number of inputs until `said_count` that are not empty have been said.
std::size_t InputsUntil(const HostileSequence& sequence, std::size_t said_count);

// A file of a corpus, and back. Throws std::runtime_error that says what is wrong with the text.
std::string ToText(const HostileSequence& sequence);
HostileSequence ReadSequence(std::string_view text);

// The sequence as a mutator sees it: another one that resembles `parent`, which may be empty; `other` gives inputs of its
// own. As many inputs as `count` says.
HostileSequence ChangeSequence(const HostileSequence& parent, const HostileSequence& other,
                               const HostileFrames& frames, std::size_t count, faults::Random& random);

// One line for each input: what a receiver makes of it between the frames of that flight, whose flags close and open its
// own.
std::vector<std::string> Describe(const HostileSequence& sequence, const link::Protocol& protocol);

}  // namespace tiltproof::harness
