#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

std::string_view Name(Verdict verdict) {
  switch (verdict) {
    case Verdict::kPass:
      return "pass";
    case Verdict::kInconclusive:
      return "inconclusive";
    case Verdict::kFail:
      return "fail";
    case Verdict::kError:
      return "error";
  }
  return "unknown";
}

std::string_view Name(AngularRates rates) {
  switch (rates) {
    case AngularRates::kWorld:
      return "world";
    case AngularRates::kBody:
      return "body";
    case AngularRates::kEuler:
      return "euler";
  }
  return "unknown";
}

}  // namespace tiltproof::harness
