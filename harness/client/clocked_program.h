// A program that flies in lockstep under the preloaded virtual clock, `--client 'clocked:CMD'`: what of a command can be told
// before it starts, and the environment that the clock needs.
//
//   if (const auto mistake = ClockMistake("./firmware {port}")) throw UsageError(*mistake);
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "harness/client/serial_program.h"

namespace tiltproof::harness {

// The paths of its ports, which exist for the program only.
inline constexpr const char* kClockedPort = "/dev/tiltproof0";
inline constexpr const char* kClockedReferencePort = "/dev/tiltproof1";

// The library that the program preloads.
std::filesystem::path ClockLibrary();

// The reason why the clock cannot be loaded into the program that the command starts: it is statically linked, for another
// processor, or has more rights than its user. Nullopt: it can, or a shell decides what it starts (the preloaded clock and the
// harness then find it out). Looks at files only.
std::optional<std::string> ClockMistake(const std::string& command);

// The command, with `exec` in front where it is a single one: the clock holds the process that a command becomes, and a shell
// may start it as a child.
std::string Executed(const std::string& command);

}  // namespace tiltproof::harness
