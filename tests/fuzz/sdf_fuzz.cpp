// The reader of vehicles: any file is a vehicle that can be flown, or a list of problems.
//
// Input: the SDF file.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "plant/plant.h"
#include "plant/vehicle_model.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/scratch.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  namespace plant = tiltproof::plant;
  using tiltproof::testing::Require;
  const auto file = tiltproof::testing::ScratchFile("fuzz.sdf", {data, size});
  // With the waiver first: what is refused with it is refused without, and most inputs are.
  for (const bool allow_invalid_inertia : {true, false}) {
    std::vector<std::string> warnings;
    const auto model = tiltproof::testing::Tried<plant::VehicleError>([&] {
      return plant::LoadVehicle(file, {.allow_invalid_inertia = allow_invalid_inertia, .mapping = {}},
                                warnings);
    });
    for (const std::string& warning : warnings) Require(!warning.empty(), "a warning says something");
    if (!model) break;
    const auto signals = model->signals();
    Require(model->HoverInput().size() == signals.inputs.size(), "hover has all inputs");
    for (std::size_t i = 0; i < signals.inputs.size(); ++i)
      Require(model->InputMin()[i] <= model->InputMax()[i], "limits are in order");
    const auto flown = tiltproof::testing::Tried<plant::PlantError>([&] {
      plant::Plant vehicle(*model, {});
      for (int step = 0; step < 3; ++step) vehicle.Step(model->HoverInput());
      std::vector<double> state(signals.states.size());
      vehicle.State(state);
      return vehicle.Event() == plant::FlightEvent::kNotFinite || std::isfinite(state[0]);
    });
    Require(flown.value_or(true), "a state that is not finite is an event");
  }
  return 0;
}
