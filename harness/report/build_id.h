// The build that flew. Without it, a replay that differs leaves open whether the flight or the program
// changed.
//
//   info.build = BuildId(library);  // "9f3c2b1a00e4d7f6"
#pragma once

#include <filesystem>
#include <string>

namespace tiltproof::harness {

// A hash of the running program's file and of the firmware library (empty: the firmware is a program or a
// board, not a library), 16 hexadecimal digits. The compiler's build id is not suitable: not every linker
// writes one. Throws FileError when a file cannot be read.
std::string BuildId(const std::filesystem::path& firmware_library);

}  // namespace tiltproof::harness
