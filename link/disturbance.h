// The effect of a fault on the vehicle itself during one step: plain numbers that the plant applies in
// addition to its input.
//
//   Disturbance gust;
//   gust.wind_m_s = {3, 0, 0};
//   plant.Step(input, Combined(gust, push));
//
// The default, Disturbance{}, changes no bit of a step.
#pragma once

#include <array>
#include <cstddef>

namespace tiltproof {

// The most rotors, and hinges, that a vehicle may have: one with more is refused when it is loaded.
inline constexpr std::size_t kRotorsMax = 8;

struct Disturbance {
  using Vector = std::array<double, 3>;
  // A hinge that does not follow its servo, but turns at this rate until it meets its stop. 0 is a jam.
  struct Hinge {
    bool held = false;
    double rate_rad_s = 0.0;
    friend bool operator==(const Hinge&, const Hinge&) = default;
  };

  Vector force_n{};             // at the main body's centre of mass, along the world's axes
  Vector torque_nm{};           // on the main body, along the world's axes
  Vector torque_body_nm{};      // the same, along its own axes
  Vector wind_m_s{};            // velocity of the air, world; it pushes a vehicle that has drag
  double mass_factor = 1.0;     // of every body; > 0
  double inertia_factor = 1.0;  // of every body, about its centre of mass; > 0
  Vector com_shift_m{};         // of the main body's centre of mass, in its frame
  std::array<double, kRotorsMax> thrust_factor = {1, 1, 1, 1, 1, 1, 1, 1};  // of each rotor
  std::array<Hinge, kRotorsMax> hinges{};
  friend bool operator==(const Disturbance&, const Disturbance&) = default;
};

// Both at once: forces, torques, winds and shifts add up, and factors multiply. If both hold the same hinge,
// the later one applies.
inline Disturbance Combined(const Disturbance& first, const Disturbance& second) {
  Disturbance both = first;
  for (std::size_t i = 0; i < 3; ++i) {
    both.force_n[i] += second.force_n[i];
    both.torque_nm[i] += second.torque_nm[i];
    both.torque_body_nm[i] += second.torque_body_nm[i];
    both.wind_m_s[i] += second.wind_m_s[i];
    both.com_shift_m[i] += second.com_shift_m[i];
  }
  both.mass_factor *= second.mass_factor;
  both.inertia_factor *= second.inertia_factor;
  for (std::size_t i = 0; i < kRotorsMax; ++i) {
    both.thrust_factor[i] *= second.thrust_factor[i];
    if (second.hinges[i].held) both.hinges[i] = second.hinges[i];
  }
  return both;
}

}  // namespace tiltproof
