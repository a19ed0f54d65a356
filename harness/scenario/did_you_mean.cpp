#include "harness/scenario/did_you_mean.h"

#include <fmt/format.h>

#include <cstddef>

#include "faults/nearest_name.h"

namespace tiltproof::harness {
namespace {

constexpr std::size_t kNameLengthMax =
    100;  // nothing longer is a mistyped name; the search takes quadratic time
constexpr std::size_t kListedMax = 24;

}  // namespace

std::string_view ClosestName(std::string_view name, std::span<const std::string_view> valid) {
  return name.size() > kNameLengthMax ? std::string_view() : faults::NearestName(name, valid);
}

std::string DidYouMean(std::string_view name, std::span<const std::string_view> valid) {
  if (const auto closest = ClosestName(name, valid); !closest.empty())
    return fmt::format("; did you mean '{}'?", closest);
  if (valid.empty() || valid.size() > kListedMax) return {};
  return fmt::format("; valid: {}", fmt::join(valid, ", "));
}

std::string UnknownBuild(std::string_view build, std::span<const std::string_view> builds) {
  const std::string_view other =
      ClosestName(build, builds).empty() ? "; --client flies a firmware of your own" : "";
  return fmt::format("unknown build '{}'{}{}", build, DidYouMean(build, builds), other);
}

}  // namespace tiltproof::harness
