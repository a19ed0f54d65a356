// The end of an "unknown name" message: the valid name that was probably meant.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace tiltproof::harness {

// The valid name that was probably meant; empty when none is close.
std::string_view ClosestName(std::string_view name, std::span<const std::string_view> valid);

// "; did you mean 'seed'?", or "; valid: a, b, c" when none is close and the list is short, or nothing.
std::string DidYouMean(std::string_view name, std::span<const std::string_view> valid);

// "unknown build 'tolerent'; did you mean 'tolerant'?", for a build of the firmware that is not among `builds`.
std::string UnknownBuild(std::string_view build, std::span<const std::string_view> builds);

}  // namespace tiltproof::harness
