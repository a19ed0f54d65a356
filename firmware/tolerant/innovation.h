// Distance of a sample from its prediction, measured in the spread to be expected.
//
//   const float misfit = Misfit(sample, predicted, previous_sample);   // 0 to kMisfitMax
//
// The spread of each signal is a floor, and a tenth of the signal's change since the previous sample. So much do other
// vehicles (mass +2 %, inertia +10 %, drag torque +20 %) and ordinary sensor noise add to the difference.
// Thresholds on the misfit therefore hold for more than one vehicle.
#pragma once

#include <array>

#include "firmware/tolerant/vehicle_dynamics.h"

namespace tiltproof::firmware {

// Differences of position, attitude (rotation vector), hinge angles, and the rates of the three, in the order
// of kSensorFields.
using Innovation = std::array<float, kSensorCount>;

Innovation Compare(const MotionState& sample, const MotionState& predicted);

// Squares of what a difference may well be: of a floor for the noise, and of a tenth of the change since the previous
// sample.
Innovation ExpectedVariance(const MotionState& sample, const MotionState& previous_sample);

// Limits of the misfit: of one signal, and of the sum.
inline constexpr float kSignalMisfitMax = 9;
inline constexpr float kMisfitMax = kSensorCount * kSignalMisfitMax;

// Sum over the signals of (difference / spread)^2, each limited to kSignalMisfitMax.
float Misfit(const MotionState& sample, const MotionState& predicted, const MotionState& previous_sample);

}  // namespace tiltproof::firmware
