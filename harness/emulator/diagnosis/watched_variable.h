// A variable of a firmware image by its name in the source: where it is and what its bytes mean, by the image's
// debug information.
//
//   const WatchedVariable gain = FindVariable("firmware.elf", "controller.gains[3]");
//   gain.Value(bytes);                        // of the memory from gain.address on
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>

namespace tiltproof::harness {

struct WatchedVariable {
  enum class Kind : std::uint8_t { kSigned, kUnsigned, kFloat, kBool };
  std::uint32_t address = 0;
  std::uint32_t size_bytes = 0;  // 1, 2, 4 or 8
  Kind kind = Kind::kUnsigned;

  // Little-endian. NaN when there are too few bytes. An integer beyond 2^53 is rounded.
  double Value(std::span<const std::uint8_t> bytes) const;
};

// The name of a global or static variable, also of one in a function, with its namespaces in C++; then members
// (`.name`) and elements (`[3]`) down to a number, a boolean, an enumeration or a pointer. A static one also by its
// file: `motor.c:state`. Throws std::runtime_error that says what is wrong: no debug information, no such variable
// (with a similar name), several of that name, a structure or an array as a whole.
WatchedVariable FindVariable(const std::filesystem::path& image, std::string_view name);

}  // namespace tiltproof::harness
