// The kind of what decided a verdict, so that no script and no search has to read the reason.
#pragma once

#include <cstdint>
#include <string_view>

namespace tiltproof::harness {

enum class VerdictCause : std::uint8_t {
  kCriterion,       // a criterion, the implicit ones included
  kNeverActivated,  // every criterion holds, and a fault never acted
  kTooBusy,         // this machine, or the firmware's own processes, made the harness too late to judge
  kNotFlown,        // the run ended before
  kFirmware,        // the firmware took its process with it: there is no flight to score
  kHarness,         // an error of the harness
};
constexpr std::string_view Name(VerdictCause cause) {
  switch (cause) {
    case VerdictCause::kCriterion:
      return "criterion";
    case VerdictCause::kNeverActivated:
      return "never_activated";
    case VerdictCause::kTooBusy:
      return "too_busy";
    case VerdictCause::kNotFlown:
      return "not_flown";
    case VerdictCause::kFirmware:
      return "firmware";
    case VerdictCause::kHarness:
      return "harness";
  }
  return "unknown";
}
constexpr VerdictCause LastOf(VerdictCause) { return VerdictCause::kHarness; }

}  // namespace tiltproof::harness
