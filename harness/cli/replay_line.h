// The command that flies a recorded flight again, for a user to paste into a shell.
//
//   ReplayLine("tiltproof", "my results/hover") ...   // tiltproof replay 'my results/hover'
#pragma once

#include <filesystem>
#include <string>

namespace tiltproof::harness {

// `program`: as the user has typed it.
std::string ReplayLine(const std::string& program, const std::filesystem::path& folder);

}  // namespace tiltproof::harness
