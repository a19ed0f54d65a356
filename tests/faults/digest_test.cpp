// The bits that faults draw.
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <sstream>
#include <string>

#include "faults/registry.h"
#include "tests/faults/faulty_flight.h"

namespace tiltproof::faults {
namespace {

class FaultDigestTest : public ::testing::TestWithParam<FaultType> {};

std::vector<FaultType> TypesThatEdit() {
  std::vector<FaultType> types;
  for (const FaultType& type : FaultTypes())
    if (type.IsOneOf<WireKind, SensorKind, ActuatorKind, PlantKind>()) types.push_back(type);
  return types;
}

// The release and the sanitizer build (other optimisation, other code) must agree on every bit, so a digest of each
// type is written down: tests/golden/fault_digests.txt, one line "type digest" each. It changes with a fault's
// semantics: then replays of old seeds change too, and the release notes must say so.
TEST_P(FaultDigestTest, EveryBuildDrawsTheSameBits) {
  std::ifstream golden(TILTPROOF_SOURCE_DIR "/tests/golden/fault_digests.txt");
  std::map<std::string, std::string> expected;
  for (std::string name, digest; golden >> name >> digest;) expected[name] = digest;
  std::ostringstream found;
  found << std::hex << DigestOf(Fly({ExampleSpec(GetParam())}, 20));
  EXPECT_EQ(found.str(), expected[std::string(GetParam().name)])
      << "line: " << GetParam().name << " " << found.str();
}

INSTANTIATE_TEST_SUITE_P(All, FaultDigestTest, ::testing::ValuesIn(TypesThatEdit()), TestName);

}  // namespace
}  // namespace tiltproof::faults
