// "did you mean": the valid name closest to a mistyped one.
#pragma once

#include <cstddef>
#include <span>
#include <string_view>

namespace tiltproof::faults {

// Insertions, deletions, replacements and swaps of neighbours that turn one into the other (optimal string
// alignment).
std::size_t EditDistance(std::string_view a, std::string_view b);

// The candidate with the least distance, the first of equals; when none is near - within a third of the longer
// name, and at least two edits - the shortest that the name abbreviates, as pos_err does position_error_m;
// otherwise empty.
std::string_view NearestName(std::string_view name, std::span<const std::string_view> candidates);

}  // namespace tiltproof::faults
