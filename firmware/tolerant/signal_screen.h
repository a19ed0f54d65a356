// Decides which of the 16 signals of a reply to believe, and supplies a substitute for one that lies.
//
//   SignalScreen screen;
//   screen.Begin(first_sample);
//   // `predicted` is what the model makes of the last clean sample.
//   const Sensors clean = screen.Screen(sensed, predicted, 0.012F);
//   if (screen.substitutes()) ...
//
// Signals come in pairs, a position (or angle) and its rate. A pair that moves together is a real motion, whatever
// caused it: a wind, a lost command, another vehicle than the model's. Only a pair that contradicts itself has a
// liar; to see that needs no model. The model identifies the liar: the signal whose acceleration it cannot
// explain. Without a clear answer, nothing is replaced. A sample that shows another instant than believed moves all
// three positions along the velocity: no liar either.
//
// A position is replaced by the integral of its rate, a rate by a filter on its position and the model. As long as
// no pair contradicts itself, the sample passes with its bits.
//
// A signal that is not finite counts as a liar. Angular rates are judged as rates of roll, pitch and yaw.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "firmware/signals.h"

namespace tiltproof::firmware {

class SignalScreen {
 public:
  // Believes this sample, whose signals are finite, and forgets all others.
  void Begin(const Sensors& sample);

  // `predicted` is what the model makes of the last clean sample in `elapsed_s`, more than 0. The result is finite.
  Sensors Screen(const Sensors& sensed, const Sensors& predicted, float elapsed_s);

  // `sensed` with what is not finite or lied in the last sample taken from `predicted`.
  Sensors Patch(const Sensors& sensed, const Sensors& predicted) const;

  // In the last sample.
  bool substitutes() const { return substitutes_; }
  // True if a signal that had been believed before jumped in the last sample.
  bool startled() const { return startled_; }

 private:
  static constexpr std::size_t kPairCount = kSensorCount / 2;
  // Signals in the order of kSensorFields, angular rates as those of roll, pitch and yaw.
  using Values = std::array<float, kSensorCount>;

  enum class Liar : std::uint8_t { kNone, kPosition, kRate };

  // Sums that forget, each over its span of time.
  struct Window {
    float contradiction = 0;  // change of the position without the integral of its rate
    // The same, forgetting twice, as the surprise does: a rate that lies makes the two equal and opposite.
    float contradiction_twice = 0;
    float rate_surprise = 0;     // change of the rate that the model does not explain
    float surprise = 0;          // integral of that
    float usual_surprise = 0;    // its largest of late
    float surprise_doubt_2 = 0;  // square of what the model may add to it
    // A rate that is believed again may be wrong by so much still, and what that adds to the surprise.
    float rate_rest = 0;
    float surprise_rest = 0;
    float integral_error_2 = 0;  // square of the error of the rate's integral between the samples
  };
  static constexpr std::size_t kWindowCount = 2;
  struct Pair {
    std::array<Window, kWindowCount> windows;
    Liar liar = Liar::kNone;
    float moved_before = 0;                               // the position's change, a sample ago
    float contradiction_before = 0;                       // that of the short window, a sample ago
    std::int32_t agreeing_count = 0;                      // samples in a row in which the liar is right
    std::int32_t position_repeats = 0, rate_repeats = 0;  // samples in a row with the same bits
    float lying_s = 0;
    float steady_per_s = 0;   // acceleration that the model does not know
    float strayed = 0;        // sum of the contradictions, forgetting slowly
    bool rate_steps = false;  // in the last sample by more than noise
    bool returns = false;     // the position was wrong when it was believed, and is right now
    bool jumps = false;       // the last sample's rate follows from no input
    float average_lie = 0;    // of a rate
  };

  static void Call(Pair& pair, Liar liar);
  static Liar Verdict(const Window& window, float tolerance);

  void Accumulate(const Values& values, const Values& model, float elapsed_s);
  bool IsShiftInTime(std::size_t window, const Values& values) const;
  // True if a position that jumps comes back from a lie that was not seen.
  static bool IsBack(const Pair& pair, float tolerance);
  // The window that convicts, if a liar is found.
  const Window* Accuse(std::size_t pair_index, float tolerance,
                       const std::array<bool, kWindowCount>& shifted);
  // Replaces the pair's liar in `clean`, and ends its replacement.
  void Replace(std::size_t pair_index, const Values& model, float elapsed_s, float tolerance,
               const Window* accusing, Values& clean);

  Values sensed_{};  // the last sample, as it came: with angular rates along the world's axes
  Values raw_{};     // the last sample as sensed
  Values clean_{};   // and as passed on
  std::array<Pair, kPairCount> pairs_{};
  bool substitutes_ = false;
  bool startled_ = false;
};

}  // namespace tiltproof::firmware
