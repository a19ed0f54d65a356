#include "faults/fault.h"

#include "faults/model.h"

namespace tiltproof::faults {

std::string TargetText(const FaultSpec& spec) {
  if (spec.line.empty()) return std::string(Name(spec.target));
  return spec.line_end.empty() ? spec.line : spec.line + "_to_" + spec.line_end;
}

std::string_view Name(Target target) {
  switch (target) {
    case Target::kNone:
      return "none";
    case Target::kToClient:
      return "to_client";
    case Target::kToPlant:
      return "to_plant";
    case Target::kBoth:
      return "both";
    case Target::kReference:
      return "reference";
  }
  return "unknown";
}

std::string_view Name(Edge edge) { return edge == Edge::kRising ? "rising" : "level"; }

void WireContext::Say(std::string_view text) const {
  constexpr std::string_view kRest = ", ...";
  if (what == nullptr || what->ends_with(kRest)) return;
  if (what->size() + text.size() > kWhatBytesMax) {
    what->append(kRest);
  } else {
    what->append(what->empty() ? "" : ", ").append(text);
  }
}

}  // namespace tiltproof::faults
