#include "faults/fault.h"

namespace tiltproof::faults {

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

}  // namespace tiltproof::faults
