// The executed code of a firmware in a flight, as features: numbers that mean "this place of the code, about so often".
// A search for inputs keeps those that show a feature which no other has shown.
//
//   LibraryCoverage::Count(true);                       // from here on
//   const Coverage coverage = LibraryCoverage::Read();  // {CoverageKind::kEdges, {17, 24, ...}}
//   std::uint32_t place = coverage.features[0] / kBucketsCount;
//
// A library reports its executed code when it is built with clang's -fsanitize-coverage=inline-8bit-counters or
// trace-pc-guard, or gcc's -fsanitize-coverage=trace-pc. This program has the functions that such code calls. An image
// needs nothing: the emulator counts. A place is a number in the file, not an address: it is the same in every process.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string_view>
#include <vector>

namespace tiltproof::harness {

// The meaning of a place.
enum class CoverageKind : std::uint8_t {
  kBlackBox,  // nothing is known
  kEdges,     // of a library: whatever its compiler counts, edges or blocks
  kBlocks,    // of an image
};
constexpr CoverageKind LastOf(CoverageKind) { return CoverageKind::kBlocks; }
// "black box", "edges", "blocks".
std::string_view Name(CoverageKind kind);

struct Coverage {
  CoverageKind kind = CoverageKind::kBlackBox;
  std::vector<std::uint32_t> features;  // sorted, each once
};

inline constexpr std::uint32_t kBucketsCount = 8;
// A place that was executed `count` times, 1 to 255: 1, 2, 3, 4-7, 8-15, 16-31, 32-127, 128 and more.
std::uint32_t FeatureOf(std::uint32_t place, std::uint8_t count);
// Adds those of counts by place, the first of which is `first_place`.
void AddFeatures(std::span<const std::uint8_t> counts, std::uint32_t first_place,
                 std::vector<std::uint32_t>& features);

// Coverage of the library under test, one at a time in a process. Its places are numbered in the order in which its
// modules were loaded: those of the library, and of what was loaded because of it.
class LibraryCoverage {
 public:
  // Loads it: `load` returns dlopen's handle, null when that fails.
  static void* Load(const std::function<void*()>& load);
  // Begins with nothing executed, or stops counting.
  static void Count(bool counts);
  static Coverage Read();
};

}  // namespace tiltproof::harness
