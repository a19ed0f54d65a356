// "did you mean": the valid name closest to a mistyped one.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace tiltproof::harness {

// Least number of insertions, deletions and replacements of one character that turn a into b (Levenshtein
// distance).
std::size_t EditDistance(std::string_view a, std::string_view b);

// The closest candidate, the first of equals; none when no candidate is within a third of the name's length
// plus one.
std::optional<std::string> NearestName(std::string_view name, std::span<const std::string> candidates);

}  // namespace tiltproof::harness
