// Signals as data: a vehicle provides a table of its signals when it is loaded, and values are plain rows of
// numbers in that table's order.
//
//   const SignalTable sensors = model.signals().sensors;
//   if (const auto z = sensors.Find("z_m")) values[*z] += 0.5F;
//
// A name is looked up once, when something is loaded; code that runs every step has the index.
//
// Only the firmware has structs of named fields (firmware/signals.h): it is written for one vehicle.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "link/check.h"

namespace tiltproof {

// The axes along which a vector's components are measured.
enum class SignalFrame : unsigned char {
  kNone,   // no vector: a time, a count
  kWorld,  // W, z up
  kBody,   // the main body's axes
  kEuler,  // Z-Y-X angles of the body in the world, and their derivatives
  kHinge,  // about a servo's hinge
  kRotor,  // along a rotor's thrust
};

struct Signal {
  std::string name;    // trace column and scenario name; ends in its unit: "vx_m_s"
  std::string unit;    // "m", "rad", "m/s", "rad/s", "N", "N m"
  double scale = 1.0;  // divides the margin of a comparison; > 0
  SignalFrame frame{};
  // Limits of an input: the vehicle's range, to which commands are clamped. Any other signal has no limits.
  double min = -std::numeric_limits<double>::infinity(), max = std::numeric_limits<double>::infinity();
  // The group that faults may name in place of its signals: "acc". Empty: in none.
  std::string group = {};
  friend bool operator==(const Signal&, const Signal&) = default;
};

// The signal of that name. The end of the name gives the unit: "vx_m_s" is in m/s. Its scale is what counts
// as "a lot" in that unit: 0.5 rad, a fifth of the Earth's magnetic field, the pressure of a metre of air, a metre in
// degrees, and 1 of everything else. A name without a unit has none, and the scale 1.
inline Signal SignalNamed(std::string name, SignalFrame frame) {
  struct Unit {
    std::string_view suffix, unit;
    double scale;
  };
  // When two endings fit, the longer one comes first.
  static constexpr std::array<Unit, 14> kUnits = {{{"_rad_s", "rad/s", 1.0},
                                                   {"_m_s2", "m/s2", 1.0},
                                                   {"_m_s", "m/s", 1.0},
                                                   {"_rad", "rad", 0.5},
                                                   {"_nm", "N m", 1.0},
                                                   {"_m", "m", 1.0},
                                                   {"_n", "N", 1.0},
                                                   {"_x_t", "T", 1e-5},
                                                   {"_y_t", "T", 1e-5},
                                                   {"_z_t", "T", 1e-5},
                                                   {"_pa", "Pa", 10.0},
                                                   {"_lat_deg", "deg", 1e-5},
                                                   {"_lon_deg", "deg", 1e-5},
                                                   {"_s", "s", 1.0}}};
  for (const Unit& unit : kUnits)
    if (std::string_view(name).ends_with(unit.suffix))
      return {.name = std::move(name), .unit = std::string(unit.unit), .scale = unit.scale, .frame = frame};
  return {.name = std::move(name), .unit = "", .scale = 1.0, .frame = frame};
}

class SignalTable {
 public:
  SignalTable() = default;
  // Names must be unique.
  explicit SignalTable(std::vector<Signal> signals) : signals_(std::move(signals)) {}

  std::size_t size() const { return signals_.size(); }
  bool empty() const { return signals_.empty(); }
  const Signal& operator[](std::size_t index) const {
    CheckIndex(index, signals_.size(), "a signal is looked up within its table");
    return signals_[index];
  }
  auto begin() const { return signals_.begin(); }
  auto end() const { return signals_.end(); }
  // Its place in a row of values.
  std::optional<std::size_t> Find(std::string_view name) const {
    const auto found =
        std::find_if(begin(), end(), [&](const Signal& signal) { return signal.name == name; });
    if (found == end()) return std::nullopt;
    return static_cast<std::size_t>(found - begin());
  }
  friend bool operator==(const SignalTable&, const SignalTable&) = default;

 private:
  std::vector<Signal> signals_;
};

// The signals of one vehicle.
struct VehicleSignals {
  SignalTable states;   // the truth, as in the trace
  SignalTable sensors;  // what may be sent; its frame may differ from that of the state with the same name
  SignalTable inputs;   // what actuator messages command
  // Readings of the sensors in the vehicle's file: the last of `sensors`, which begin with the states. The others are
  // numbers of 32 bits when they are sent.
  SignalTable measured = {};
  // Its parts by their names in the vehicle's file, in the order of Disturbance's thrust factors and hinges.
  std::vector<std::string> rotors = {}, joints = {};
  bool feels_wind = true;  // it has drag
  friend bool operator==(const VehicleSignals&, const VehicleSignals&) = default;
};

}  // namespace tiltproof
