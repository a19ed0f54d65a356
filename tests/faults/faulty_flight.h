// Everything that a fault can change, over a flight without a vehicle: what the tests of all types look at.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {

inline constexpr std::int64_t kFrames = 1000;

// Sample n of a flight: every sensor moves. Of no use to a frozen sensor is one that stands still.
inline Sensors Sample(std::int64_t n) {
  Sensors sensors;
  float value = static_cast<float>(n);
  for (const auto& field : kSensorFields) sensors.*field.in_float = value += 0.25F;
  return sensors;
}

inline ActuatorsTruth Command(std::int64_t n) {
  return {.f_r_n = 10 + 0.01 * static_cast<double>(n), .f_l_n = 10.5, .tau_r_nm = 0.1, .tau_l_nm = -0.1};
}

// To the bit: readings that are no number compare equal too.
inline bool SameBits(const Sensors& a, const Sensors& b) {
  return std::all_of(kSensorFields.begin(), kSensorFields.end(), [&](const auto& field) {
    return std::bit_cast<std::uint32_t>(a.*field.in_float) == std::bit_cast<std::uint32_t>(b.*field.in_float);
  });
}

// Everything that a fault can change, over kFrames periods of 12 ms.
struct Outcome {
  std::vector<std::vector<link::Chunk>> frames;
  std::vector<Sensors> sensors;
  std::vector<ActuatorsTruth> actuators;
  std::vector<Disturbance> disturbances;
  std::vector<std::int64_t> counts;
  std::vector<Activation> activations;
};

inline bool SameFrames(const Outcome& a, const Outcome& b) {
  return std::equal(a.frames.begin(), a.frames.end(), b.frames.begin(), b.frames.end(),
                    [](const auto& x, const auto& y) { return Same(x, y); });
}

inline bool SameOutcome(const Outcome& a, const Outcome& b) {
  return SameFrames(a, b) &&
         std::equal(a.sensors.begin(), a.sensors.end(), b.sensors.begin(), b.sensors.end(), SameBits) &&
         a.actuators == b.actuators && a.disturbances == b.disturbances;
}

inline Outcome Fly(const std::vector<FaultSpec>& specs, std::uint64_t seed = 1) {
  FaultSchedule schedule = AtThePlant(specs, seed);
  Outcome outcome;
  outcome.frames = Send(schedule, kFrames);
  for (std::int64_t n = 0; n < kFrames; ++n) {
    outcome.sensors.push_back(Sample(n));
    EditSensors(schedule, n * kPeriod, outcome.sensors.back());
    outcome.actuators.push_back(Command(n));
    EditActuators(schedule, n * kPeriod, outcome.actuators.back());
    outcome.disturbances.push_back(schedule.DisturbanceOf(n * kPeriod));
  }
  outcome.counts = schedule.ActivationCounts();
  outcome.activations = schedule.TakeActivations(kOriginAtPowerOn);
  return outcome;
}

// The digest of what a fault makes of the same flight.
inline std::uint64_t DigestOf(const Outcome& outcome) {
  std::uint64_t digest = 0xcbf29ce484222325ULL;  // FNV-1a
  const auto add = [&](auto value) {
    for (const auto byte : std::bit_cast<std::array<std::uint8_t, sizeof value>>(value))
      digest = (digest ^ byte) * 0x100000001b3ULL;
  };
  for (const auto& chunks : outcome.frames) {
    for (const auto& chunk : chunks) {
      add(chunk.begin_ns);
      for (const std::uint8_t byte : chunk.bytes) add(byte);
    }
  }
  for (const auto& sensors : outcome.sensors)
    for (const auto& field : kSensorFields) add(sensors.*field.in_float);
  for (const auto& actuators : outcome.actuators)
    for (const auto& field : kActuatorFields) add(actuators.*field.in_double);
  for (const Disturbance& disturbance : outcome.disturbances) {
    for (const auto* vector :
         {&disturbance.force_n, &disturbance.torque_nm, &disturbance.wind_m_s, &disturbance.com_shift_m})
      for (const double part : *vector) add(part);
    if (disturbance.torque_body_nm != Disturbance::Vector{})
      for (const double part : disturbance.torque_body_nm) add(part);
    add(disturbance.mass_factor);
    add(disturbance.inertia_factor);
    for (const double factor : disturbance.thrust_factor) add(factor);
    for (const auto& hinge : disturbance.hinges) add(hinge.held ? hinge.rate_rad_s : -1e9);
  }
  add(outcome.counts.at(0));
  return digest;
}

}  // namespace tiltproof::faults
