// The plant of the tilt-rotor with its rows of numbers as named fields, for tests that are written for this
// vehicle.
//
//   TiltrotorPlant plant(model, {});
//   plant.Step({.f_r_n = 10, .f_l_n = 10});
//   EXPECT_GT(plant.State().vz_m_s, 0);
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "firmware/signals.h"
#include "plant/plant.h"

namespace tiltproof::testing {

template <template <class> class Group, std::size_t n>
std::vector<double> ToRow(const Group<double>& group, const std::array<SignalField<Group>, n>& fields) {
  std::vector<double> row;
  for (const auto& field : fields) row.push_back(group.*field.in_double);
  return row;
}

template <template <class> class Group, std::size_t n>
Group<double> FromRow(const std::vector<double>& row, const std::array<SignalField<Group>, n>& fields) {
  Group<double> group;
  for (std::size_t i = 0; i < n; ++i) group.*fields[i].in_double = row.at(i);
  return group;
}

inline std::vector<double> Row(const SensorsTruth& state) { return ToRow(state, kSensorFields); }
inline std::vector<double> Row(const ActuatorsTruth& input) { return ToRow(input, kActuatorFields); }
inline ActuatorsTruth ActuatorsOf(const std::vector<double>& row) { return FromRow(row, kActuatorFields); }

class TiltrotorPlant : public plant::Plant {
 public:
  using Plant::Plant;
  using Plant::Reset;
  void Reset(const SensorsTruth& state) { Plant::Reset(Row(state)); }
  void Step(const ActuatorsTruth& input) { Plant::Step(Row(input)); }
  ActuatorsTruth InputInForce(const ActuatorsTruth& command) const {
    std::vector<double> row = Row(command);
    Plant::InputInForce(row);
    return ActuatorsOf(row);
  }
  SensorsTruth State(plant::RatesFrame frame = plant::RatesFrame::kWorld) const {
    std::vector<double> row(kSensorCount);
    Plant::State(row, frame);
    return FromRow(row, kSensorFields);
  }
  SensorsTruth ReadSensors(plant::RatesFrame frame = plant::RatesFrame::kWorld) const {
    std::vector<double> row(kSensorCount);
    Plant::ReadSensors(row, frame);
    return FromRow(row, kSensorFields);
  }
};

}  // namespace tiltproof::testing
