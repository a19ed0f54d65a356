// Files of a fuzz target, for readers that take a path, and the vehicle that the program has with it.
//
//   const std::filesystem::path file = ScratchFile("image.elf", {data, size});
//   harness::ElfSymbols symbols(file);
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

#include "plant/vehicle_model.h"

namespace tiltproof::testing {

// A folder of this process alone, removed at its end.
const std::filesystem::path& ScratchFolder();

// Writes the whole file of that name there.
std::filesystem::path ScratchFile(const std::filesystem::path& name, std::span<const std::uint8_t> content);

// plant/models/tiltrotor.sdf as it was built in, as a file and loaded.
std::filesystem::path TiltrotorFile();
const plant::VehicleModel& Tiltrotor();

}  // namespace tiltproof::testing
